/* A box as it is on a bench: it powers up and tests itself before it answers, and reports its own faults.
 *
 * `make build/box_udp` makes a process of it (udp_main.c), which SIGHUP reboots.  While it powers up and tests itself
 * the rig holds trim.  Then it votes the middle of the valid channels; its fault word has a bit for each signal on
 * which a channel is off, and its first output discrete is a lamp for any of them.
 */
#include <math.h>
#include <string.h>

#include "rig_unit.h"

#define POWER_UP_S 0.2
#define SELF_TEST_S 0.3
#define TURN 6.283185307179586 /* rad */

static struct rig_config config;
static uint64_t stepped;
static uint32_t fault_word; /* latched: cleared by a reboot alone */

int rig_unit_open(const struct rig_config *wanted)
{
    config = *wanted;
    stepped = 0;
    fault_word = 0;
    return wanted->layout == RIG_UNIT_LAYOUT ? 0 : 1;
}

/* The valid samples of a signal in rising order, angles on the side of the first; returns how many there are. */
static int sorted(const struct rig_input *in, int i, double samples[RIG_CHANNELS])
{
    int count = 0;
    double first = 0.0;
    for (int c = 0; c < (int)config.signal[i].fitted; c++) {
        double x = in->channels[i][c];
        int place = count;
        if (!in->valid[i][c] || !isfinite(x)) {
            continue;
        }
        first = count == 0 ? x : first;
        x -= config.signal[i].wraps ? TURN * floor((x - first) / TURN + 0.5) : 0.0;
        for (; place > 0 && samples[place - 1] > x; place--) {
            samples[place] = samples[place - 1];
        }
        samples[place] = x;
        count++;
    }
    return count;
}

static void vote(const struct rig_input *in, struct rig_output *out)
{
    for (int i = 0; i < RIG_SIGNALS; i++) {
        double samples[RIG_CHANNELS] = {0.0};
        const int count = sorted(in, i, samples);
        out->voted[i] = count > 0 ? (samples[(count - 1) / 2] + samples[count / 2]) / 2.0 : NAN;
        if (count < (int)config.signal[i].fitted || samples[count - 1] - samples[0] > 2.0 * config.signal[i].threshold) {
            fault_word |= UINT32_C(1) << i;
        }
    }
    out->said = RIG_SAID_VOTED;
}

int rig_unit_step(const struct rig_input *in, struct rig_output *out)
{
    const double since_s = (double)stepped / config.rate_hz;
    out->stepped = ++stepped;
    if (since_s < POWER_UP_S) {
        out->status = RIG_STATUS_POWER_UP;
        return 0;
    }
    if (since_s < POWER_UP_S + SELF_TEST_S) {
        out->status = RIG_STATUS_SELF_TEST;
        return 0;
    }
    vote(in, out);
    out->status = fault_word != 0 ? RIG_STATUS_DEGRADED : RIG_STATUS_READY;
    out->fault_word = fault_word;
    out->output_discretes[0] = fault_word != 0;
    return 0;
}

void rig_unit_close(void)
{
}
