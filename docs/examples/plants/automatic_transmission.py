"""The automatic transmission of the ARCH-COMP falsification benchmarks, as a plant of `rig search`.

    rig search automatic_transmission.toml --plant automatic_transmission.py:transmission --requirement AT1 ...

Model and requirements: Hoxha, Abbas and Fainekos, 'Benchmarks for temporal logic requirements for automotive systems',
ARCH 2014, after the Simulink demonstration sldemo_autotrans.  Written from the published equations and tables: an
engine with a torque map, a torque converter, four gears, a vehicle with drag and brakes.  Explicit Euler, 0.04 s; a
gear changes when the speed was beyond its threshold for 0.08 s.  Speed in mph, engine speed in rpm, torque in ft lb.
A public restatement has 0.667 in place of 0.677 for the fourth gear.
"""

from bisect import bisect_right

import numpy as np

STEP_S = 0.04
ENGINE_INERTIA = 0.0219914882835559
VEHICLE_INERTIA = 12.0941478573125
FINAL_DRIVE = 3.23
MPH = 2.0 * np.pi * 60.0 / 5280.0  # of a wheel speed in rpm: a radius of one foot

ENGINE_RPM = np.arange(800.0, 4801.0, 400.0)
THROTTLE = np.array([0.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0, 90.0, 100.0])  # percent
TORQUE = np.array(  # of the engine, by throttle and engine speed
    [
        [-40, -44, -49, -53, -57, -61, -65, -70, -74, -78, -82],
        [215, 117, 85, 66, 44, 29, 10, -2, -13, -22, -32],
        [245, 208, 178, 148, 122, 104, 85, 66, 48, 33, 18],
        [264, 260, 241, 219, 193, 167, 152, 133, 119, 96, 85],
        [264, 279, 282, 275, 260, 238, 223, 208, 189, 171, 152],
        [267, 290, 293, 297, 290, 275, 260, 256, 234, 212, 193],
        [267, 297, 305, 305, 305, 301, 293, 282, 267, 249, 226],
        [267, 301, 308, 312, 319, 323, 319, 316, 297, 279, 253],
        [267, 301, 312, 319, 327, 327, 327, 327, 312, 293, 267],
        [267, 301, 312, 319, 327, 334, 334, 334, 319, 305, 275],
    ],
    float,
)
SPEED_RATIO = np.array(
    [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.81, 0.82, 0.83, 0.84, 0.85, 0.86, 0.87, 0.88, 0.89, 0.9, 0.92, 0.94]
)
CAPACITY = np.array(  # of the torque converter, by speed ratio
    [137.4652, 137.0650, 135.8644, 135.6644, 137.5653, 140.3666, 145.2689, 152.8725, 162.9773, 164.2779, 166.1788]
    + [167.9797, 170.0807, 172.7820, 175.3832, 179.5852, 183.5871, 189.8901, 197.6938, 215.9024, 244.5160]
)
TORQUE_RATIO = np.array(
    [2.232, 2.075, 1.975, 1.846, 1.72, 1.564, 1.409, 1.254, 1.096, 1.08, 1.061]
    + [1.043, 1.028, 1.012, 1.002, 1.002, 1.001, 0.998, 0.999, 1.001, 1.002]
)
GEAR = (2.393, 1.45, 1.0, 0.677)
NEVER = 1e6
UP_AT = np.array([0.0, 25.0, 35.0, 50.0, 90.0, 100.0])  # throttle, percent
UP = ((10, 10, 15, 23, 40, 40), (30, 30, 30, 41, 70, 70), (50, 50, 50, 60, 100, 100), (NEVER,) * 6)  # mph, by gear
DOWN_AT = np.array([0.0, 5.0, 40.0, 50.0, 90.0, 100.0])
DOWN = ((0, 0, 0, 0, 0, 0), (5, 5, 5, 5, 30, 30), (20, 20, 25, 30, 50, 50), (35, 35, 40, 50, 80, 80))
SHIFT_STEPS = 2  # beyond a threshold, before the gear changes


def transmission(throttle, brake, duration_s):
    """Drive from standstill; throttle in percent, brake in ft lb."""
    times = np.arange(round(duration_s / STEP_S) + 1) * STEP_S
    throttles, brakes = throttle(times), brake(times)
    torques, ups, downs = _by_throttle(throttles)
    rpm, speed, gears = (np.empty(len(times)) for _ in range(3))
    engine, wheel, gear, beyond = 1000.0, 0.0, 0, 0
    ratios, capacity, torque_ratio = SPEED_RATIO.tolist(), CAPACITY.tolist(), TORQUE_RATIO.tolist()
    engine_rpm = ENGINE_RPM.tolist()
    for k, braking in enumerate(brakes.tolist()):
        mph = wheel * MPH
        if mph > ups[gear][k]:
            beyond = max(beyond, 0) + 1
        elif mph < downs[gear][k]:
            beyond = min(beyond, 0) - 1
        else:
            beyond = 0
        if beyond > SHIFT_STEPS and gear < 3:
            gear, beyond = gear + 1, 0
        elif beyond < -SHIFT_STEPS and gear > 0:
            gear, beyond = gear - 1, 0
        rpm[k], speed[k], gears[k] = engine, mph, gear + 1
        ratio = GEAR[gear] * FINAL_DRIVE * wheel / engine
        impeller = (engine / _on_line(ratio, ratios, capacity)) ** 2
        turbine = impeller * _on_line(ratio, ratios, torque_ratio) * GEAR[gear]
        load = (1.0 if mph >= 0.0 else -1.0) * (40.0 + 0.02 * mph * mph + braking)
        power = _on_line(engine, engine_rpm, torques[k])
        engine = min(max(engine + STEP_S * (power - impeller) / ENGINE_INERTIA, 600.0), 6000.0)
        wheel += STEP_S * (FINAL_DRIVE * turbine - load) / VEHICLE_INERTIA
    return times, {"speed": speed, "rpm": rpm, "gear": gears}


def _by_throttle(throttles):
    """Return, by step, the torque over the engine speed and the thresholds of each gear."""
    place = np.clip(np.searchsorted(THROTTLE, throttles, side="right") - 1, 0, len(THROTTLE) - 2)
    share = (throttles - THROTTLE[place]) / (THROTTLE[place + 1] - THROTTLE[place])
    torques = TORQUE[place] + share[:, None] * (TORQUE[place + 1] - TORQUE[place])
    ups = [np.interp(throttles, UP_AT, mph).tolist() for mph in UP]
    downs = [np.interp(throttles, DOWN_AT, mph).tolist() for mph in DOWN]
    return torques.tolist(), ups, downs


def _on_line(x, xs, ys):
    """Interpolate, and go straight on beyond the ends, as a table of Simulink does."""
    i = min(max(bisect_right(xs, x) - 1, 0), len(xs) - 2)
    return ys[i] + (x - xs[i]) / (xs[i + 1] - xs[i]) * (ys[i + 1] - ys[i])
