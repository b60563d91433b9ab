/* Open-loop steps before the first flight: does each surface move against the motion, and with the command?
 *
 *     signs airplane.txt f16.txt     # the settings files; exit code 1 if a sign is wrong
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "rig_unit.h"

#define RATE_HZ 100.0
#define STEP 0.1   /* rad, rad/s */
#define HELD 20    /* frames */
#define REST 100   /* frames between two steps */
#define LEAST 1e-3 /* rad of a surface that count as a movement */

enum kind { RATE, ANGLE, COMMAND };

static const struct {
    const char *name;
    enum kind kind;
    int at, surface, sign; /* sign: of the surface's movement after a positive step */
} steps[] = {
    {"pitch rate, nose up", RATE, RIG_SIGNAL_PITCH_RATE, RIG_SURFACE_ELEVATOR_RAD, 1},
    {"pitch angle, nose up", ANGLE, RIG_SIGNAL_PITCH_ANGLE, RIG_SURFACE_ELEVATOR_RAD, 1},
    {"pitch command, nose up", COMMAND, RIG_AUTOPILOT_COMMAND_PITCH_ANGLE_RAD, RIG_SURFACE_ELEVATOR_RAD, -1},
    {"roll rate, right", RATE, RIG_SIGNAL_ROLL_RATE, RIG_SURFACE_AILERON_RAD, -1},
    {"roll angle, right", ANGLE, RIG_SIGNAL_ROLL_ANGLE, RIG_SURFACE_AILERON_RAD, -1},
    {"roll command, right", COMMAND, RIG_AUTOPILOT_COMMAND_ROLL_ANGLE_RAD, RIG_SURFACE_AILERON_RAD, 1},
    {"yaw rate, right", RATE, RIG_SIGNAL_YAW_RATE, RIG_SURFACE_RUDDER_RAD, 1},
};
static const char *const surfaces[] = {"elevator", "aileron", "rudder"};
static const char *const ways[][2] = {
    {"trailing edge up", "trailing edge down"}, {"rolls left", "rolls right"}, {"yaws right", "yaws left"}};

static struct rig_law_input in;
static struct rig_output out;

static int run(int frames)
{
    for (int i = 0; i < frames; i++) {
        memset(&out, 0, sizeof out);
        if (rig_unit_law(&in, &out) != 0) {
            return 1;
        }
        in.frame++;
    }
    return 0;
}

/* Step one input by `size`; print the movement of its surface.  0: the sign is right, 1: wrong, 2: no answer. */
static int try_step(int i, double size)
{
    double *const value = steps[i].kind == COMMAND ? &in.autopilot_command[steps[i].at] : &in.voted[steps[i].at];
    const int surface = steps[i].surface;
    if (run(REST) != 0) {
        return 2;
    }
    const double before = out.surface[surface];
    *value += size;
    const int failed = run(HELD);
    *value -= size;
    if (failed) {
        return 2;
    }
    const double moved = out.surface[surface] - before;
    const int right = moved * size * steps[i].sign > LEAST * STEP;
    printf("%-24s %+5.1f deg%s  %-9s %+6.2f deg, %-18s  %s\n", steps[i].name, size * 57.29578,
           steps[i].kind == RATE ? "/s" : "  ", surfaces[surface], moved * 57.29578,
           fabs(moved) < LEAST ? "does not move" : ways[surface][moved > 0.0], right ? "correct" : "WRONG");
    return right ? 0 : 1;
}

static void begin(struct rig_config *config)
{
    config->role = RIG_ROLE_CONTROL_LAW;
    config->rate_hz = RATE_HZ;
    config->layout = RIG_UNIT_LAYOUT;
    for (int i = 0; i < 4; i++) {
        config->surface_low[i] = i == RIG_SURFACE_THROTTLE ? 0.0 : -0.4;
        config->surface_high[i] = i == RIG_SURFACE_THROTTLE ? 1.0 : 0.4;
    }
    config->trim_surface[RIG_SURFACE_THROTTLE] = 0.3;
    for (int i = 0; i < RIG_SIGNALS; i++) {
        in.level[i] = RIG_CHANNELS;
    }
    in.voted[RIG_SIGNAL_STATIC_PRESSURE] = 46600.0;
    in.voted[RIG_SIGNAL_DYNAMIC_PRESSURE] = 11700.0;
}

int main(int count, char **names)
{
    static struct rig_config config;
    char settings[1024] = "";
    int wrong = 0;
    for (int i = 1; i < count; i++) {
        snprintf(settings + strlen(settings), sizeof settings - strlen(settings), "%s%s", i > 1 ? ":" : "", names[i]);
    }
    if (count > 1) {
        setenv("BETAFLIGHT_SETTINGS", settings, 1);
    }
    begin(&config);
    if (rig_unit_open(&config) != 0) {
        return 2;
    }
    for (size_t i = 0; i < sizeof steps / sizeof steps[0] && wrong < 2; i++) {
        for (int sign = 1; sign >= -1 && wrong < 2; sign -= 2) {
            const int found = try_step((int)i, sign * STEP);
            wrong = found > wrong ? found : wrong;
        }
    }
    rig_unit_close();
    return wrong;
}
