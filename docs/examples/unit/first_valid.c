/* The smallest unit: votes the first channel that says it is valid and is in range, else holds the last vote.
 * It compares no channels. A unit that does takes differences of heading and roll angle the short way round, where
 * config.signal[i].wraps is 1: 359 and 1 degree are 2 degrees apart, see median.c. */
#include <string.h>

#include "rig_unit.h"

static struct rig_config config;
static double vote[RIG_SIGNALS];
static uint64_t stepped;

int rig_unit_open(const struct rig_config *wanted)
{
    config = *wanted;
    memset(vote, 0, sizeof vote);
    stepped = 0;
    return wanted->layout == RIG_UNIT_LAYOUT ? 0 : 1;
}

int rig_unit_step(const struct rig_input *in, struct rig_output *out)
{
    for (int i = 0; i < RIG_SIGNALS; i++) {
        const struct rig_signal_config *p = &config.signal[i];
        for (int c = (int)p->fitted - 1; c >= 0; c--) { /* backwards: the first channel has the last word */
            const double x = in->channels[i][c];
            if (in->valid[i][c] && p->low <= x && x <= p->high) { /* false for NaN */
                vote[i] = x;
            }
        }
        memset(&out->state[i][p->fitted], RIG_STATE_ABSENT, (size_t)(RIG_CHANNELS - p->fitted));
        out->level[i] = (uint8_t)p->fitted;
    }
    memcpy(out->voted, vote, sizeof vote);
    out->stepped = ++stepped;
    out->said = RIG_SAID_VOTED | RIG_SAID_STATE;
    return 0;
}

void rig_unit_close(void)
{
}
