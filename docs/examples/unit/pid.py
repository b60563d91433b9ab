"""A small control law: the same as pid.c, in Python.  ``law = "pid:Pid"`` in the unit file."""

from math import isfinite

from rig.core.frame import AUTOPILOT_COMMANDS, sig

REFERENCE_PRESSURE = 5276.0  # Pa
LEAST_PRESSURE = 2000.0  # Pa; below it the gains stay
ALPHA_GAIN = 0.15  # rad of elevator per rad of angle of attack
YAW_GAIN = 3.0  # s; rad of rudder per rad/s
WASHOUT_S = 2.0  # a yaw rate that lasts longer is a turn, which is not damped
PITCH, ROLL = (AUTOPILOT_COMMANDS.index(name) for name in ("pitch_angle_rad", "roll_angle_rad"))


class Axis:
    """One angle, held about its value in the first frame."""

    def __init__(self, p, i, d):
        self.p, self.i, self.d = p, i, d
        self.held, self.integral = None, 0.0

    def error(self, angle, command):
        """Return how far the angle is from what is commanded."""
        if self.held is None:
            self.held = angle
        return angle - self.held - (command if isfinite(command) else 0.0)

    def owed(self, error, rate):
        """Return what the surface owes to the error, its integral and its rate."""
        return self.p * error + self.i * self.integral + self.d * rate


class Pid:
    """Hold pitch and roll angle by PID; the rig votes, the law reads the votes."""

    def __init__(self, config):
        # config: rig_config of the reference page "Interface records"
        self.dt = 1.0 / float(config["rate_hz"])
        self.trim, self.low, self.high = (
            config[name].tolist() for name in ("trim_surface", "surface_low", "surface_high")
        )
        self.pitch, self.roll = Axis(2.0, 0.5, 1.4), Axis(2.0, 0.4, 1.2)
        self.measured = [0.0] * 16
        self.begun, self.alpha_trim, self.yaw_rate_slow = False, 0.0, 0.0

    def read(self, asked):
        """Take the vote of every signal; its reference when no channel is left; else the last value."""
        voted, level = asked["voted"].tolist(), asked["level"].tolist()
        reference, usable = asked["reference"].tolist(), asked["reference_usable"].tolist()
        for i, value in enumerate(voted):
            known, value = (True, value) if level[i] else (usable[i], reference[i])
            if known and isfinite(value):
                self.measured[i] = value
        return self.measured

    def limited(self, i, change):
        """Return surface i, trim + change within its stops, and whether it reached none."""
        wanted = self.trim[i] + change
        surface = min(max(wanted, self.low[i]), self.high[i])
        return surface, surface == wanted

    def step(self, asked):
        """Return elevator, aileron, rudder and throttle from one frame, rig_law_input of the reference page."""
        m, command = self.read(asked), asked["autopilot_command"].tolist()
        if not self.begun:
            self.begun, self.alpha_trim, self.yaw_rate_slow = True, m[sig.ALPHA], m[sig.R]
        soft = REFERENCE_PRESSURE / max(m[sig.Q_BAR], LEAST_PRESSURE)
        pitch = self.pitch.error(m[sig.THETA], command[PITCH])
        roll = self.roll.error(m[sig.PHI], command[ROLL])
        change = soft * self.pitch.owed(pitch, m[sig.Q]) + ALPHA_GAIN * (m[sig.ALPHA] - self.alpha_trim)
        elevator, free = self.limited(0, change)
        self.pitch.integral += pitch * self.dt if free else 0.0
        aileron, free = self.limited(1, -soft * self.roll.owed(roll, m[sig.P]))
        self.roll.integral += roll * self.dt if free else 0.0
        self.yaw_rate_slow += (m[sig.R] - self.yaw_rate_slow) * self.dt / WASHOUT_S
        rudder, _ = self.limited(2, soft * YAW_GAIN * (m[sig.R] - self.yaw_rate_slow))
        return elevator, aileron, rudder, self.trim[3]
