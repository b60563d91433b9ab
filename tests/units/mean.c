/* The median of docs/examples/unit with another vote: the mean of all samples in range, and nothing else said. */
#define rig_unit_step median_step
#include "../../docs/examples/unit/median.c"
#undef rig_unit_step

int rig_unit_step(const struct rig_input *in, struct rig_output *out)
{
    for (int i = 0; i < RIG_SIGNALS; i++) {
        double samples[RIG_CHANNELS] = {0.0}, total = 0.0;
        const int n = sorted(in, i, samples);
        for (int c = 0; c < n; c++) {
            total += samples[c];
        }
        if (n > 0) {
            const double mean = fmin(fmax(total / n, samples[0]), samples[n - 1]);
            const double begin = config.signal[i].low; /* of the circle of an angle */
            vote[i] = config.signal[i].wraps ? within_a_turn(mean - begin) + begin : mean;
        }
    }
    memcpy(out->voted, vote, sizeof vote);
    out->said = RIG_SAID_VOTED;
    return 0;
}
