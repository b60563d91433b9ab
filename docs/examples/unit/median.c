/* The least that a unit must answer: its votes (RIG_SAID_VOTED), here the median of the samples in range, as our manager
 * `median` votes; without one the last vote stands.  Levels and states are then the rig's: all channels are in use. */
#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "rig_unit.h"

#define PI 3.141592653589793
#define TURN (2.0 * PI) /* rad */

static struct rig_config config;
static double vote[RIG_SIGNALS];
static bool started[RIG_SIGNALS];

/* An angle moved by whole turns to where it is from 0 to a turn. */
static double within_a_turn(double angle)
{
    const double rest = fmod(angle, TURN);
    return rest + (rest < 0.0 ? TURN : 0.0);
}

/* The samples of a signal in range in rising order, angles within half a turn of the last vote; returns how many. */
static int sorted(const struct rig_input *in, int i, double samples[RIG_CHANNELS])
{
    const struct rig_signal_config *p = &config.signal[i];
    int n = 0;
    for (int c = 0; c < (int)p->fitted; c++) {
        double x = in->channels[i][c];
        int place = n;
        if (!in->valid[i][c] || !(p->low <= x && x <= p->high)) { /* NaN is in no range */
            continue;
        }
        if (!started[i]) { /* the first sample stands for the vote before it */
            vote[i] = x;
            started[i] = true;
        }
        x = p->wraps ? vote[i] + (within_a_turn(x - vote[i] + PI) - PI) : x;
        for (; place > 0 && samples[place - 1] > x; place--) {
            samples[place] = samples[place - 1];
        }
        samples[place] = x;
        n++;
    }
    return n;
}

int rig_unit_open(const struct rig_config *wanted)
{
    config = *wanted;
    memset(vote, 0, sizeof vote);
    memset(started, 0, sizeof started);
    return wanted->layout == RIG_UNIT_LAYOUT ? 0 : 1;
}

int rig_unit_step(const struct rig_input *in, struct rig_output *out)
{
    for (int i = 0; i < RIG_SIGNALS; i++) {
        double samples[RIG_CHANNELS] = {0.0};
        const int n = sorted(in, i, samples);
        if (n > 0) {
            const double low = samples[(n - 1) / 2], high = samples[n / 2];
            const double middle = n % 2 == 0 ? low + (0.5 * (high - low)) : low;
            const double begin = config.signal[i].low; /* of the circle of an angle */
            vote[i] = config.signal[i].wraps ? within_a_turn(middle - begin) + begin : middle;
        }
    }
    memcpy(out->voted, vote, sizeof vote);
    out->said = RIG_SAID_VOTED;
    return 0;
}

void rig_unit_close(void)
{
}
