/* Betaflight as a control law: voted values go to the firmware as its sensors, commands as a pilot's sticks.
 *
 * Its servos move the surfaces about their trim.  Signs: q > 0, theta > 0 and a nose-down command move the servo of the
 * elevator beyond 1500 us, which pitches down; the aileron rolls right and the rudder yaws left beyond 1500 us.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "firmware.h"
#include "rig_unit.h"

#define G 9.80665
#define DEG_PER_RAD 57.29577951308232
#define ANGLE_LIMIT_DEG 45.0 /* full stick, as in the settings: angle_limit */
#define YAW_RATE_DEG_S 200.0 /* full pedals: yaw_rc_rate */
#define LEAST_RATE_HZ 51.0   /* it ignores the time stamps of slower frames */
#define ARM_S 6.0            /* it refuses to arm in the first 5 s after power-on */
#define THROTTLE_S 6.5
#define FLY_S 7.0
#define LEAST_THROTTLE 0.1 /* on the ground, to see that the motor follows */
#define ARMED_PWM 1050.0F
#define MOST_DISARMED 5 /* frames */

static struct rig_config config;
static struct state_packet state;
static struct stick_packet sticks;
static struct servo_packet servos;
static double measured[RIG_SIGNALS]; /* the last value of each signal that was known */
static double held_pitch;
static uint64_t stepped;
static int disarmed, silent; /* frames in a row */

static uint16_t stick(double share)
{
    return (uint16_t)lround(1500.0 + 500.0 * fmin(fmax(share, -1.0), 1.0));
}

static uint16_t throttle_stick(double share)
{
    return (uint16_t)lround(1000.0 + 1000.0 * fmin(fmax(share, 0.0), 1.0));
}

/* Stand on the ground until it is armed: its motor follows the throttle.  Every flight gets the same packets. */
static int arm(void)
{
    bool answered = false;
    const long frames = lround(FLY_S * config.rate_hz);
    const double throttle = fmax(config.trim_surface[RIG_SURFACE_THROTTLE], LEAST_THROTTLE);
    for (long i = 0; i < frames; i++) {
        const double t = (double)i / config.rate_hz;
        neutral(&state, &sticks);
        sticks.channel[SWITCH_ANGLE] = 2000;
        sticks.channel[SWITCH_ARM] = t >= ARM_S ? 2000 : 1000;
        sticks.channel[STICK_THROTTLE] = t >= THROTTLE_S ? throttle_stick(throttle) : 1000;
        if (!firmware_frame(&state, &sticks, &servos, &answered)) {
            return 1;
        }
    }
    if (!answered) {
        report("the firmware sends no servo positions to UDP port 9001");
        return 1;
    }
    if (!(servos.pwm[PWM_MOTOR] > ARMED_PWM)) {
        report("the firmware does not arm within %g s", FLY_S);
        return 1;
    }
    return 0;
}

/* Take the vote of a signal; its reference when no channel is left. */
static void measure(const struct rig_law_input *in, int i)
{
    const double value = in->level[i] > 0 ? in->voted[i] : in->reference[i];
    if ((in->level[i] > 0 || in->reference_usable[i]) && isfinite(value)) {
        measured[i] = value;
    }
}

static double commanded(const struct rig_law_input *in, int i)
{
    return isfinite(in->autopilot_command[i]) ? in->autopilot_command[i] : 0.0;
}

/* Quaternion of the body axes. */
static void attitude(double q[4])
{
    const double phi = 0.5 * measured[RIG_SIGNAL_ROLL_ANGLE], theta = 0.5 * measured[RIG_SIGNAL_PITCH_ANGLE];
    const double psi = 0.5 * measured[RIG_SIGNAL_HEADING];
    q[0] = cos(phi) * cos(theta) * cos(psi) + sin(phi) * sin(theta) * sin(psi);
    q[1] = sin(phi) * cos(theta) * cos(psi) - cos(phi) * sin(theta) * sin(psi);
    q[2] = cos(phi) * sin(theta) * cos(psi) + sin(phi) * cos(theta) * sin(psi);
    q[3] = cos(phi) * cos(theta) * sin(psi) - sin(phi) * sin(theta) * cos(psi);
}

static double airspeed(void)
{
    const double density = measured[RIG_SIGNAL_STATIC_PRESSURE] / (287.05 * 275.0);
    return sqrt(2.0 * fmax(measured[RIG_SIGNAL_DYNAMIC_PRESSURE], 100.0) / fmax(density, 0.1));
}

static void fill(const struct rig_law_input *in)
{
    const double pitch_to = held_pitch + commanded(in, RIG_AUTOPILOT_COMMAND_PITCH_ANGLE_RAD);
    const double roll_to = commanded(in, RIG_AUTOPILOT_COMMAND_ROLL_ANGLE_RAD);
    neutral(&state, &sticks);
    state.rate[0] = measured[RIG_SIGNAL_ROLL_RATE];
    state.rate[1] = measured[RIG_SIGNAL_PITCH_RATE];
    state.rate[2] = measured[RIG_SIGNAL_YAW_RATE];
    state.acceleration[0] = -G * measured[RIG_SIGNAL_LONGITUDINAL_LOAD_FACTOR];
    state.acceleration[1] = G * measured[RIG_SIGNAL_LATERAL_LOAD_FACTOR];
    state.acceleration[2] = -G * measured[RIG_SIGNAL_NORMAL_LOAD_FACTOR];
    attitude(state.quaternion);
    state.pressure = measured[RIG_SIGNAL_STATIC_PRESSURE];
    sticks.channel[STICK_ROLL] = stick(roll_to * DEG_PER_RAD / ANGLE_LIMIT_DEG);
    sticks.channel[STICK_PITCH] = stick(-pitch_to * DEG_PER_RAD / ANGLE_LIMIT_DEG); /* forward is nose down */
    sticks.channel[STICK_YAW] = stick(G / airspeed() * sin(roll_to) * DEG_PER_RAD / YAW_RATE_DEG_S); /* turn */
    sticks.channel[STICK_THROTTLE] = throttle_stick(config.trim_surface[RIG_SURFACE_THROTTLE]);
    sticks.channel[SWITCH_ARM] = sticks.channel[SWITCH_ANGLE] = 2000;
}

/* A disarmed firmware holds its motor at 1000 us. */
static int still_armed(void)
{
    const int stopped = servos.pwm[PWM_MOTOR] <= 1000.5F && sticks.channel[STICK_THROTTLE] > 1001;
    disarmed = stopped ? disarmed + 1 : 0;
    if (disarmed < MOST_DISARMED) {
        return 1;
    }
    report("the firmware has disarmed in flight: its motor has stopped for %d frames", MOST_DISARMED);
    return 0;
}

/* Half of a surface's range is 500 us. */
static double surface(int i, double pwm)
{
    const double throw = 0.5 * (config.surface_high[i] - config.surface_low[i]);
    const double wanted = config.trim_surface[i] + throw * (pwm - 1500.0) / 500.0;
    return isfinite(pwm) ? fmin(fmax(wanted, config.surface_low[i]), config.surface_high[i]) : NAN;
}

static void answer(struct rig_output *out)
{
    const double motor = (servos.pwm[PWM_MOTOR] - 1000.0) / 1000.0;
    out->surface[RIG_SURFACE_ELEVATOR_RAD] = surface(RIG_SURFACE_ELEVATOR_RAD, servos.pwm[PWM_ELEVATOR]);
    out->surface[RIG_SURFACE_AILERON_RAD] = surface(RIG_SURFACE_AILERON_RAD, servos.pwm[PWM_AILERON]);
    out->surface[RIG_SURFACE_RUDDER_RAD] = surface(RIG_SURFACE_RUDDER_RAD, servos.pwm[PWM_RUDDER]);
    out->surface[RIG_SURFACE_THROTTLE] = isfinite(motor) ? fmin(fmax(motor, 0.0), 1.0) : NAN;
    out->said = RIG_SAID_SURFACE;
}

int rig_unit_open(const struct rig_config *wanted)
{
    const char *settings = getenv("BETAFLIGHT_SETTINGS");
    config = *wanted;
    stepped = 0;
    disarmed = silent = 0;
    if (config.role != RIG_ROLE_CONTROL_LAW || config.rate_hz < LEAST_RATE_HZ) {
        report("needs the role control-law and more than 50 Hz");
        return 1;
    }
    if (settings == NULL || settings[0] == '\0') {
        report("BETAFLIGHT_SETTINGS is not set: names of settings files, separated by colons");
        return 1;
    }
    if (!firmware_start(config.rate_hz, settings) || arm() != 0) {
        firmware_stop();
        return 1;
    }
    firmware_fly();
    return 0;
}

int rig_unit_law(const struct rig_law_input *in, struct rig_output *out)
{
    bool answered = false;
    for (int i = 0; i < RIG_SIGNALS; i++) {
        measure(in, i);
    }
    if (stepped == 0) {
        held_pitch = measured[RIG_SIGNAL_PITCH_ANGLE];
    }
    fill(in);
    if (!firmware_frame(&state, &sticks, &servos, &answered)) {
        return 1;
    }
    out->stepped = ++stepped;
    silent = answered ? 0 : silent + 1;
    if (silent == 1) {
        report("the firmware has sent no servo positions in frame %lld", (long long)in->frame);
    }
    if (answered) { /* otherwise the last answer flies, and the frame counts towards max_missed */
        answer(out);
    }
    return still_armed() ? 0 : 1;
}

void rig_unit_close(void)
{
    firmware_stop();
}
