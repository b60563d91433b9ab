/* A unit that goes wrong at frame 50 in the way that FAULT, or a file beside it, names. */
#include <fcntl.h>
#include <fenv.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "rig_unit.h"

static const char *fault;
static long at;
static double vote[RIG_SIGNALS];
static double trim[4];

int rig_unit_open(const struct rig_config *config)
{
    static char named[32];
    FILE *file = fopen("fault", "r"); /* in the folder of the library */
    if (file) {
        named[fread(named, 1, sizeof named - 1, file)] = 0;
        fclose(file);
    }
    fault = getenv("FAULT") ? getenv("FAULT") : named;
    at = getenv("FAULT_FRAME") ? atol(getenv("FAULT_FRAME")) : 50;
    memset(vote, 0, sizeof vote);
    memcpy(trim, config->trim_surface, sizeof trim);
    if (strcmp(fault, "rounding") == 0) {
        fesetround(FE_UPWARD);
    }
    return config->layout != RIG_UNIT_LAYOUT || strcmp(fault, "open") == 0 ? 7 : 0;
}

static int go_wrong(struct rig_output *out)
{
    if (strcmp(fault, "segv once") == 0) { /* in the process that makes the file */
        if (open("has_died", O_CREAT | O_EXCL, 0600) >= 0) {
            *(volatile int *)0 = 0;
        }
    } else if (strcmp(fault, "segv") == 0) {
        *(volatile int *)0 = 0;
    } else if (strcmp(fault, "abort") == 0) {
        abort();
    } else if (strcmp(fault, "exit") == 0) {
        exit(3);
    } else if (strcmp(fault, "hang") == 0) {
        for (;;) {
            pause();
        }
    } else if (strcmp(fault, "sleep") == 0) {
        sleep(3);
    } else if (strcmp(fault, "error") == 0) {
        return 5;
    } else if (strcmp(fault, "print") == 0) {
        puts("hello from the unit");
        fflush(stdout);
    } else if (strcmp(fault, "nan vote") == 0) {
        out->voted[RIG_SIGNAL_HEADING] = NAN;
    } else if (strcmp(fault, "nan surface") == 0) {
        out->surface[RIG_SURFACE_ELEVATOR_RAD] = NAN;
    } else if (strcmp(fault, "state") == 0) {
        out->state[0][1] = 17;
    } else if (strcmp(fault, "silent") == 0) {
        out->said = 0;
    }
    return 0;
}

int rig_unit_step(const struct rig_input *in, struct rig_output *out)
{
    for (int i = 0; i < RIG_SIGNALS; i++) {
        if (in->valid[i][0] && isfinite(in->channels[i][0])) {
            vote[i] = in->channels[i][0];
        }
        out->voted[i] = vote[i];
        out->level[i] = 4;
    }
    out->said = RIG_SAID_VOTED | RIG_SAID_STATE;
    return in->frame == at ? go_wrong(out) : 0;
}

/* A law that leaves the surfaces at trim, but for the elevator, which follows the frame's number a little. */
int rig_unit_law(const struct rig_law_input *in, struct rig_output *out)
{
    memcpy(out->surface, trim, sizeof trim);
    out->surface[RIG_SURFACE_ELEVATOR_RAD] += 1e-7 * (double)in->frame;
    out->said = RIG_SAID_SURFACE;
    return in->frame == at ? go_wrong(out) : 0;
}

void rig_unit_close(void)
{
}
