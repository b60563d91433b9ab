/* A small control law: holds pitch and roll angle, about those of its first frame, by PID.
 *
 * The rig votes; the law reads the votes, and has no channel to choose from.  Surfaces are changes from trim; the gains
 * are those of the F-16 at the reference dynamic pressure and fall with the dynamic pressure, as surfaces work the more
 * the faster the air.  The F-16 diverges in pitch: pitch rate and angle of attack are fed back to hold it.
 * A signal that is lost (level 0) comes from its reference, if the manager vouches for it, and else keeps its last value.
 * Signs: the elevator pitches down when it is positive, the aileron rolls right, the rudder yaws left.
 */
#include <math.h>
#include <string.h>

#include "rig_unit.h"

#define REFERENCE_PRESSURE 5276.0 /* Pa */
#define LEAST_PRESSURE 2000.0     /* Pa; below it the gains stay */
#define ALPHA_GAIN 0.15           /* rad of elevator per rad of angle of attack */
#define YAW_GAIN 3.0              /* s; rad of rudder per rad/s */
#define WASHOUT_S 2.0             /* a yaw rate that lasts longer is a turn, which is not damped */

struct pid {
    double p, i_1_s, d_s; /* gains: surface per angle, per its integral and per its rate */
    double held;          /* angle of the first frame */
    double integral;      /* rad s */
};

static struct rig_config config;
static struct pid pitch, roll;
static double measured[RIG_SIGNALS]; /* the last value of each signal that was known */
static double alpha_trim, yaw_rate_slow;
static uint64_t stepped;

/* Take the vote of a signal; its reference when no channel is left. */
static void read(const struct rig_law_input *in, int i)
{
    const double value = in->level[i] > 0 ? in->voted[i] : in->reference[i];
    const int known = in->level[i] > 0 || in->reference_usable[i];
    if (known && isfinite(value)) {
        measured[i] = value;
    }
}

/* Set a surface to trim + change within its stops; whether it reached none. */
static int set(struct rig_output *out, int i, double change)
{
    const double wanted = config.trim_surface[i] + change;
    out->surface[i] = fmin(fmax(wanted, config.surface_low[i]), config.surface_high[i]);
    return out->surface[i] == wanted;
}

/* What the surface owes to an angle's error, its integral and its rate. */
static double owed(const struct pid *pid, double error, double rate)
{
    return pid->p * error + pid->i_1_s * pid->integral + pid->d_s * rate;
}

static double commanded(const struct rig_law_input *in, int i)
{
    return isfinite(in->autopilot_command[i]) ? in->autopilot_command[i] : 0.0;
}

int rig_unit_open(const struct rig_config *wanted)
{
    config = *wanted;
    pitch = (struct pid){.p = 2.0, .i_1_s = 0.5, .d_s = 1.4};
    roll = (struct pid){.p = 2.0, .i_1_s = 0.4, .d_s = 1.2};
    memset(measured, 0, sizeof measured);
    stepped = 0;
    const int ours = wanted->role == RIG_ROLE_CONTROL_LAW && wanted->rate_hz > 0.0;
    return ours && wanted->layout == RIG_UNIT_LAYOUT ? 0 : 1;
}

int rig_unit_law(const struct rig_law_input *in, struct rig_output *out)
{
    const double dt = 1.0 / config.rate_hz;
    for (int i = 0; i < RIG_SIGNALS; i++) {
        read(in, i);
    }
    if (stepped++ == 0) {
        pitch.held = measured[RIG_SIGNAL_PITCH_ANGLE];
        roll.held = measured[RIG_SIGNAL_ROLL_ANGLE];
        alpha_trim = measured[RIG_SIGNAL_ANGLE_OF_ATTACK];
        yaw_rate_slow = measured[RIG_SIGNAL_YAW_RATE];
    }
    const double soft = REFERENCE_PRESSURE / fmax(measured[RIG_SIGNAL_DYNAMIC_PRESSURE], LEAST_PRESSURE);
    const double pitch_error =
        measured[RIG_SIGNAL_PITCH_ANGLE] - pitch.held - commanded(in, RIG_AUTOPILOT_COMMAND_PITCH_ANGLE_RAD);
    const double roll_error =
        measured[RIG_SIGNAL_ROLL_ANGLE] - roll.held - commanded(in, RIG_AUTOPILOT_COMMAND_ROLL_ANGLE_RAD);
    const double alpha = measured[RIG_SIGNAL_ANGLE_OF_ATTACK] - alpha_trim;
    const double elevator = soft * owed(&pitch, pitch_error, measured[RIG_SIGNAL_PITCH_RATE]) + ALPHA_GAIN * alpha;
    const double aileron = -soft * owed(&roll, roll_error, measured[RIG_SIGNAL_ROLL_RATE]);
    pitch.integral += set(out, RIG_SURFACE_ELEVATOR_RAD, elevator) ? pitch_error * dt : 0.0;
    roll.integral += set(out, RIG_SURFACE_AILERON_RAD, aileron) ? roll_error * dt : 0.0;
    yaw_rate_slow += (measured[RIG_SIGNAL_YAW_RATE] - yaw_rate_slow) * dt / WASHOUT_S;
    set(out, RIG_SURFACE_RUDDER_RAD, soft * YAW_GAIN * (measured[RIG_SIGNAL_YAW_RATE] - yaw_rate_slow));
    set(out, RIG_SURFACE_THROTTLE, 0.0);
    out->stepped = stepped;
    out->said = RIG_SAID_SURFACE;
    return 0;
}

void rig_unit_close(void)
{
}
