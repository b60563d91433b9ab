/* A unit that raises a signal, or prints without end, in the function that PLACE names: open, step or close. */
#define _GNU_SOURCE
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "rig_unit.h"

static double vote[RIG_SIGNALS];

static void act(const char *place)
{
    const char *wanted = getenv("PLACE"), *how = getenv("RAISE");
    if (wanted && strcmp(wanted, place) == 0 && how) {
        int number = atoi(how);
        if (number > 0) {
            kill(getpid(), number);
        } else { /* so many lines */
            for (int i = 0; i < -number; i++) {
                printf("line %09d of what a unit prints\n", i);
            }
            fflush(stdout);
        }
    }
}

int rig_unit_open(const struct rig_config *config)
{
    act("open");
    return config->layout != RIG_UNIT_LAYOUT;
}

int rig_unit_step(const struct rig_input *in, struct rig_output *out)
{
    if (in->frame == 9) {
        act("step");
    }
    for (int i = 0; i < RIG_SIGNALS; i++) {
        if (in->valid[i][0] && isfinite(in->channels[i][0])) {
            vote[i] = in->channels[i][0];
        }
        out->voted[i] = vote[i];
        out->level[i] = 4;
    }
    out->said = RIG_SAID_VOTED | RIG_SAID_STATE;
    return 0;
}

void rig_unit_close(void)
{
    act("close");
}
