/* The cross-channel monitor: what its files share.
 *
 * monitor.c    the interface, and one signal's frame from the samples to the answer
 * compare.c    which samples are compared, their ranks, pattern, trend and median
 * lasting.c    learned biases, sums of small deviations, samples that repeat
 * resolvers.c  patterns without a majority
 * discretes.c  the voter of the discretes
 *
 * Zhang (2023), whose sections the comments name, and docs/redundancy.md for what the paper leaves open (its headings
 * in quotes).  No dynamic memory, no recursion, every loop bounded by a constant or by a number of channels.
 * Build with -ffp-contract=off and without -ffast-math: the order of the operations is part of the result.
 */
#ifndef MONITOR_H
#define MONITOR_H

#include <math.h>
#include <stdbool.h>

#include "rig_unit.h"

#define PI 3.141592653589793
#define TURN 6.283185307179586

typedef const struct rig_signal_config params;

/* What persists of the channels of one signal or discrete. */
struct latches {
    bool failed[RIG_CHANNELS];    /* latched: only a reset command clears it */
    int64_t count[RIG_CHANNELS];  /* miscomparing frames in a row */
    int64_t agreed[RIG_CHANNELS]; /* frames in a row that a failed channel agreed with the vote */
};

/* What lasts of the channels of one signal; each part where it is on. */
struct lasting {
    const struct rig_lasting_config *set;
    double bias[RIG_CHANNELS];
    int64_t learned[RIG_CHANNELS]; /* frames that the bias is of */
    double above[RIG_CHANNELS];    /* sums of residuals, unit times frames */
    double below[RIG_CHANNELS];
    double last_sample[RIG_CHANNELS];
    int64_t repeats[RIG_CHANNELS]; /* frames in a row in which it was the last one again */
};

/* One signal in one frame. */
struct frame {
    const double *samples;      /* by channel, as are valid and ilm */
    const uint8_t *valid;
    const uint8_t *ilm;         /* what the channels' in-line monitors say */
    double base;                /* an angle is taken within half a turn of it */
    double reference;           /* NaN: none */
    double second;              /* reference of other physics; NaN: none */
    double reference_threshold;
    double threshold;           /* of as many samples */
    double outlier_threshold;   /* the same of those who all agree; 0: none */
    int n;                      /* comparable samples */
    int order[RIG_CHANNELS];    /* their channels, by ascending value */
    double x[RIG_CHANNELS];     /* their values, by channel */
    double seen_reference;      /* what is compared: behind the filter, if there is one */
    double y[RIG_CHANNELS];     /* the same of the channels, */
    double z[RIG_CHANNELS];     /* less what each is biased by, if that is learned, */
    int by[RIG_CHANNELS];       /* and the channels by ascending z */
    unsigned ranked;            /* their channels, bits */
    double low, high;           /* the two voting ranks, */
    double rise_low, rise_high; /* and their changes since the last frame */
    bool alone[RIG_CHANNELS];   /* agrees with no other channel, or repeats its sample */
    bool blamed[RIG_CHANNELS];  /* would be failed by the answer to a pattern without a majority */
    uint8_t resolver;           /* who decided */
    double vote;                /* before the fade */
};

/* One signal, from frame to frame. */
struct signal {
    struct latches latches;
    struct lasting lasting;
    double smooth[RIG_CHANNELS]; /* behind the filter; NaN: begins with the next value */
    double smooth_reference;
    double smooth_vote;
    double vote;       /* the last one, before the fade */
    double rise_vote;  /* its last change */
    double output;     /* the last one, after the fade */
    double fade;       /* output less vote when the level last changed */
    int64_t fade_left; /* frames */
    double last_low, last_high;
    int last_n;
    unsigned trend_low, trend_high;
    int64_t trend_seen;
    uint8_t pattern;
    int64_t pattern_frames; /* that it has lasted */
    int64_t singular_run;   /* frames in a row of any pattern without a majority */
    int64_t freeze;         /* frames for which the counts stand still after it */
    bool reference_usable;
    int64_t reference_run; /* frames in a row against the reference's present standing */
    int64_t common_run;    /* frames in a row in which two references contradicted all channels */
    bool common_mode;
    int64_t level; /* channels not failed */
    bool started;  /* there is a last vote */
};

/* ---- Numbers ---- */

/* x modulo one turn, from 0 up to one turn, never a negative zero; NaN stays NaN. */
static inline double modulo_turn(double x)
{
    const double rest = fmod(x, TURN);
    return rest + ((rest < 0.0) ? TURN : 0.0); /* -0.0 + 0.0 is 0.0 */
}

/* a - b; of an angle the short way round. */
static inline double difference(double a, double b, params *p)
{
    return (p->wraps != 0) ? (modulo_turn((a - b) + PI) - PI) : (a - b);
}

/* x within [low, high]; NaN stays NaN. */
static inline double clamp(double x, double low, double high)
{
    const double raised = (low > x) ? low : x;
    return (high < raised) ? high : raised;
}

/* Weighted mean that stays within [low, high] whatever the rounding. */
static inline double mean(double low, double high, double weight_high)
{
    return clamp(low + (weight_high * (high - low)), low, high);
}

/* Whether a pattern has no majority: sections 2 and 3. */
static inline bool is_singular(uint8_t pattern)
{
    return (pattern >= RIG_PATTERN_P2_2) && (pattern <= RIG_PATTERN_P1_1);
}

/* ---- compare.c ---- */

/* What a frame shows of one signal: its comparable samples, ranked, and its references. */
struct frame compare_samples(const struct rig_input *input, int signal, params *p, struct signal *s);

/* redundancy.md 'A filter before the comparison': the next value after `last`, which is NaN at the beginning. */
double compare_follow(double last, double x, const struct frame *f, params *p);

/* Name the pattern, mark who agrees with nobody or is stale, and count for how many frames the pattern has lasted. */
void compare_pattern(struct frame *f, struct signal *s);

/* Section 6 and table 1: shift this frame's bits into the trend bytes. */
void compare_trend(struct frame *f, params *p, struct signal *s);

/* Sections 4 and 5: the vote with a majority. */
double compare_median(const struct frame *f, params *p, const struct signal *s);

/* ---- lasting.c ---- */

/* Begin with a signal of `config`, which stays where it is. */
void lasting_open(const struct rig_config *config, int signal, struct lasting *l);

/* Forget the bias of the channels that were `failed` and are no longer. */
void lasting_readmit(const bool failed[RIG_CHANNELS], struct signal *s);

/* Count the frames in a row in which each channel's sample was the last one again. */
void lasting_count(const double *samples, params *p, struct lasting *l);

/* Whether a channel's sample has repeated for long enough to miscompare. */
bool lasting_is_stale(int c, const struct lasting *l);

/* Whether the bias of each channel with a sample is a mean over the time constant, or none is learned. */
bool lasting_is_learned(const struct frame *f, const struct lasting *l);

/* Move the sums and fail whom they fail. */
void lasting_watch(struct frame *f, params *p, struct signal *s);

/* Move each bias towards its channel's residual, within the bound; it begins as the mean of the residuals. */
void lasting_learn(const struct frame *f, struct signal *s);

/* Begin all sums again: another number of channels has another middle. */
void lasting_begin_sums(struct lasting *l);

/* ---- resolvers.c ---- */

/* redundancy.md 'Patterns without a majority': this frame's vote, who decided it, and whom that would fail. */
void resolvers_settle(struct frame *f, params *p, const struct signal *s);

/* ---- monitor.c ---- */

/* Clear the failures of the commanded channels, bits, that have agreed with the vote for readmit_frames. */
void monitor_readmit(struct latches *latches, unsigned commanded, int64_t fitted, int64_t readmit_frames);

/* ---- discretes.c ---- */

/* Begin with every discrete channel in use. */
void discretes_open(const struct rig_discrete_config config[RIG_DISCRETES]);

/* Vote and monitor the discretes of one frame. */
void discretes_step(const struct rig_input *input, struct rig_output *output);

#endif
