/* The cross-channel monitor: what its files share.
 *
 * monitor.c      the interface, and one signal's frame from the samples to the answer
 * compare.c      which samples are compared, their ranks, pattern and median
 * trend.c        the trend bytes of the two voting ranks, and what they say
 * slow_faults.c  sums of small deviations, samples that repeat
 * slow_tests.c   slow-fault tests: three means of each channel's residual
 * slow_halves.c  slow-fault tests: two channels that are wrong alike, or two that are left
 * slow_noise.c   slow-fault tests: the noisy one of two that are left
 * tie_break.c    splits
 * references.c   the references' own monitor, the last channel, two references against all channels
 * persistence.c  counts, answers that last, latched failures, readmission
 * boxes.c        LRU failures
 * rules.c        what version 3 of the records tells of a signal, and what becomes of a split that no rule settles
 * discretes.c    the voter of the discretes
 *
 * Zhang (2023), whose sections the comments name, and docs/explanation/decisions.md for what the paper leaves open (its headings
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
#define REFERENCE_MARGIN 1.5 /* reference thresholds that it takes to dispute channels that nothing else disputes */

typedef const struct rig_signal_config params;

/* What persists of the channels of one signal or discrete. */
struct latches {
    bool failed[RIG_CHANNELS];    /* latched: only a reset command clears it */
    double count[RIG_CHANNELS];   /* miscomparing frames in a row, less what agreeing ones took off */
    int64_t agreed[RIG_CHANNELS]; /* frames in a row that a failed channel agreed with the vote */
};

/* Slow faults of the channels of one signal; each part where it is on. */
struct slow_faults {
    const struct rig_slow_faults_config *set;
    double above[RIG_CHANNELS];       /* sums of residuals, unit times frames */
    double below[RIG_CHANNELS];
    double last_sample[RIG_CHANNELS]; /* comparable; NaN: none yet */
    double last_reference;            /* as given */
    int64_t repeats[RIG_CHANNELS];    /* frames in which it was the last one again while others moved */
    unsigned stale;                   /* channels that have repeated for too long, bits */
    bool standing;                    /* the samples of all channels in use repeat */
};

#define WAYS 3                /* to halve four channels */
#define TESTS_SLOW 100.0      /* frames of a slow mean */
#define TESTS_LEARNING 1000.0 /* frames of the mean that a bias is */
#define TESTS_LEAST 2.0       /* noise of the data sheet over slow_noise, the least that is reckoned with */
#define TESTS_BURST 14.0      /* frames that the largest steps need to reach a limit */
#define TESTS_MEANS_FROM 200  /* frames that are learned before a mean tells anything, */
#define TESTS_SQUARES_FROM 500 /* and before one of squares does */

/* Differences D of halves of the channels of one signal, by the way to halve them: first half less second. */
struct halves {
    double mean[WAYS];
    double energy[WAYS];  /* mean square, of limited steps */
    double whole[WAYS];   /* the same without the allowance for motion */
    double square[WAYS];  /* mean square of what counts in the product */
    double product[WAYS]; /* with the reference's difference from the median */
    double limit;         /* of a mean, over the deviation of the noise, */
    double square_limit;  /* of a mean square, over its variance, less 1 */
    double of_frames;     /* reciprocal of frames that are learned, at most TESTS_SLOW */
    double noise;         /* variance of the way that has least, its mean, */
    double shaken;        /* and of the last second */
    double apart;         /* difference of the first two halves in this frame */
    double share;         /* of its limit, of the way that has most */
    int run;              /* frames in a row: above zero the second half is wrong, below zero the first */
};

/* Second differences of the middle, and of D, the difference of two channels that are left. */
struct noise {
    int64_t turns;                 /* frames since the middle last moved as no aircraft does */
    int64_t turned;                /* frames that the means have counted */
    double change;                 /* of the middle, from the last frame, */
    double last_change;            /* and before that */
    double last_apart, last_moved; /* D of the last frame and its change */
    double shared;   /* mean product of those of both channels; of more channels mean square of the middle's */
    double roughest; /* largest one, less its noise */
    double rough;    /* mean square of those of D, of limited steps, */
    double rougher;  /* and mean of those of D times those of the middle, the same */
};

/* Slow-fault tests of one signal. */
struct slow_tests {
    const struct rig_slow_tests_config *set;
    uint8_t by;                  /* which test isolates in this frame */
    int64_t learned;             /* frames, */
    double known;                /* and the sum of their weights */
    int level;                   /* channels of which the means are */
    double bias[RIG_CHANNELS];
    double value[RIG_CHANNELS];  /* samples without it, */
    int order[RIG_CHANNELS];     /* and the channels of which it is */
    double fast[RIG_CHANNELS];   /* means of residuals, in units of the noise, */
    double slow[RIG_CHANNELS];
    double square[RIG_CHANNELS]; /* and of their squares, in the square of the signal's unit; */
    double whole[RIG_CHANNELS];  /* the same without the allowance for motion */
    double share[RIG_CHANNELS];  /* of its limit, the largest of the three */
    double noise;                /* variance that the channels have in common, its mean, */
    double shaken;               /* and of the last second */
    double fast_limit, slow_limit, square_limit;
    double fast_step, slow_step, square_step; /* largest residual that counts, in the same units */
    double limits_until;         /* what is known when they are renewed */
    double of_fast, of_slow, of_square; /* reciprocals: of the limits, */
    double of_learned;           /* of frames that are learned, at most TESTS_LEARNING, */
    double of_squares;           /* and at most those of the mean of squares */
    double usual_middle;         /* mean of the middle over the frames of which the biases are */
    double last_middle;
    int64_t away;                /* frames without tests since then */
    double rate;                 /* mean change of the middle a frame, */
    double usual_rate;           /* its mean over the same frames, */
    double motion;               /* and the largest one of the last second */
    double vote_off;             /* mean of what the biases move the vote, */
    double reference_vote;       /* and that, and of the rate, over the frames of which the next is */
    double reference_rate;
    double reference_bias;
    int64_t reference_learned;   /* frames */
    double reference_off;        /* of this frame, without its bias; NaN: none */
    struct halves halves;
    struct noise second;         /* differences */
};

/* What the trend bytes say. */
enum verdict { TREND_UNKNOWN, TREND_SMALLER_TRUE, TREND_LARGER_TRUE, TREND_BOTH_FALSE };

/* The two voting ranks over the last frames. */
struct trend {
    double last_low, last_high;
    unsigned low, high;            /* bytes: the newest bit is the last one */
    int64_t seen;                  /* changes */
    int64_t still_low, still_high; /* frames in a row without a change */
    enum verdict says;             /* the last whole window, where they tumble */
};

/* A split: the answer to it, and the vote while there is none. */
struct split {
    uint8_t rule;            /* that answers, */
    unsigned blames;         /* the channels that it would fail, bits, */
    int64_t stood;           /* and for how many frames in a row */
    int64_t silent;          /* frames in a row that no rule has answered, */
    int64_t unresolved;      /* and all since an answer has stood or all had a majority */
    bool whole;              /* all channels in use are compared */
    bool basis;              /* the last vote is of all channels in use, or held */
    unsigned held_of;        /* channels compared when the shares below were found, bits; 0: none are kept */
    int held_low, held_high; /* channels that the vote is between, */
    double held_share;       /* the share of the second, */
    double held_gap;         /* and how far it was above the first when last used */
};

/* Rules that version 3 of the records tells of a signal: rules.c. */
struct rules {
    double count_down;         /* frames that an agreeing one takes off a count; 0: all */
    int64_t unresolved_frames; /* until a split is given up; 0: never */
    double trend_small;        /* changes that are trend enough after one frame; -1: none */
    bool trend_tumbles;
    bool asks_trend;
    int64_t tells;   /* its bit, where references of others read it */
    int64_t sources; /* bits of signals that its references read */
    int64_t box;     /* from 1; 0: none */
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
    int n;                      /* comparable samples */
    int order[RIG_CHANNELS];    /* their channels, by ascending value */
    double x[RIG_CHANNELS];     /* their values, by channel */
    double seen_reference;      /* what is compared: behind the filter, if there is one */
    double y[RIG_CHANNELS];     /* the same of the channels, */
    int by[RIG_CHANNELS];       /* and the channels by ascending y */
    unsigned ranked;            /* their channels, bits */
    double low, high;           /* the two voting ranks, */
    double rise_low, rise_high; /* and their changes since the last frame */
    bool alone[RIG_CHANNELS];   /* agrees with no other channel */
    bool together;              /* behind a filter: the samples of a split agree again */
    bool blamed[RIG_CHANNELS];  /* would be failed by the answer to a split */
    uint8_t decided_by;           /* who decided */
    double vote;                /* before the fade */
    uint8_t slow_by;            /* who fails a channel by small deviations */
};

/* One signal, from frame to frame. */
struct signal {
    struct rules rules;
    struct latches latches;
    struct slow_faults slow_faults;
    struct slow_tests slow_tests;
    struct trend trend;
    struct split split;
    double smooth[RIG_CHANNELS]; /* behind the filter; NaN: begins with the next value */
    double smooth_reference;
    double smooth_vote;
    double before[RIG_CHANNELS]; /* comparable samples of the last frame; NaN: none */
    int last_n;                  /* how many there were */
    double vote;                 /* the last one, before the fade */
    double rise_vote;            /* its last change */
    double output;               /* the last one, after the fade */
    double fade;                 /* output less vote when the level last changed */
    int64_t fade_left;           /* frames */
    uint8_t pattern;
    int64_t pattern_frames;      /* that it has lasted */
    int64_t split_run;        /* frames in a row of any split */
    int64_t freeze;              /* frames for which the counts stand still after it */
    bool after_extremes;         /* the two channels left are those that extremes have kept */
    int64_t cut_frames;          /* frames in a row in which the reference is off both */
    bool reference_usable;
    int64_t reference_run;       /* frames in a row against the reference's present standing */
    int64_t second_run;          /* frames in a row in which the second reference is off the vote */
    bool in_dispute;             /* a signal that its references read */
    int64_t common_run;          /* frames in a row in which two references contradicted all channels */
    bool common_mode;
    int64_t level;               /* channels not failed */
    unsigned accused;            /* channels that the frame's evidence speaks against, bits */
    bool started;                /* there is a last vote */
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

/* The larger of two limits. */
static inline double larger(double a, double b)
{
    return (b > a) ? b : a;
}

/* The smaller of two limits. */
static inline double smaller(double a, double b)
{
    return (b < a) ? b : a;
}

/* Whether a pattern has no majority: sections 2 and 3. */
static inline bool is_split(uint8_t pattern)
{
    return (pattern >= RIG_PATTERN_P2_2) && (pattern <= RIG_PATTERN_P1_1);
}

/* Whether a channel is in a set of bits. */
static inline bool has(unsigned channels, int c)
{
    return ((channels >> c) & 1U) != 0U;
}

/* ---- compare.c ---- */

/* What a frame shows of one signal: its comparable samples, ranked, and its references. */
struct frame compare_samples(const struct rig_input *input, int signal, params *p, struct signal *s);

/* Whether a sample is flagged valid, a number and within the sensor's range. */
bool compare_is_comparable(const struct frame *f, int c, params *p);

/* Put n channels into ascending order of x. */
void compare_sort(const double *x, int *order, int n);

/* decisions.md 'Noise: a filter before the comparison': the next value after `last`, which is NaN at the beginning. */
double compare_follow(double last, double x, const struct frame *f, params *p);

/* Name the pattern, mark channels that agree with none, and count for how many frames the pattern has lasted; behind a filter
 * not those in which the samples themselves have come together again. */
void compare_pattern(struct frame *f, params *p, struct signal *s);

/* Sections 4 and 5: the vote with a majority. */
double compare_median(const struct frame *f, params *p, const struct signal *s);

/* ---- trend.c ---- */

/* Section 6 and table 1: shift this frame's bits into the trend bytes. */
void trend_update(struct frame *f, params *p, struct signal *s);

/* What the bytes say now. */
enum verdict trend_says(const struct frame *f, params *p, const struct signal *s);

/* Section 4: the share of the larger of two values in their mean, by which change is nearer to the vote's. */
double trend_weight(double rise_high, double rise_low, double rise_vote);

/* ---- slow_faults.c ---- */

/* Begin with a signal of `config`, which stays where it is. */
void slow_open(const struct rig_config *config, int signal, struct slow_faults *l);

/* Count the frames in which each channel's sample was the last one again while another's moved. */
void slow_count(const struct frame *f, double reference, params *p, struct signal *s);

/* Whether a channel's sample has repeated for too long to be compared. */
bool slow_is_stale(int c, const struct slow_faults *l);

/* Move sums and tests, fail whom they fail, and say in slow_by which did. */
void slow_watch(struct frame *f, params *p, struct signal *s);

/* Begin all sums again: another number of channels has another middle. */
void slow_begin_sums(struct slow_faults *l);

/* ---- slow_tests.c ---- */

/* Begin with a signal of `config`, which stays where it is. */
void tests_open(const struct rig_config *config, int signal, struct slow_tests *t);

/* Learn the signal again where a channel was `failed` and is no longer. */
void tests_readmit(const bool failed[RIG_CHANNELS], struct signal *s);

/* Whether a signal is tested, and so the biases of its channels are learned. */
bool tests_run(const struct slow_tests *t);

/* The median of the ranked samples without their biases; their ranks are others, of which none but the middle is needed. */
double tests_middle(const struct frame *f, struct slow_tests *t);

/* Whether m, the middle, is so near an end of the range that a healthy sample may be cut off there: what is cut off is missing in
 * the mean, which would then be taken for a bias. */
bool tests_is_cut(double m, params *p, const struct slow_tests *t);

/* The share of a constant that a mean over as many frames reaches within the frames of a burst. */
double tests_reached(double frames, double burst);

/* Move all means by a frame and learn; the channels that a test isolates, bits, and which test in `by`. */
unsigned tests_watch(const struct frame *f, params *p, struct signal *s);

/* ---- slow_halves.c ---- */

/* Begin the means of all ways to halve n channels again. */
void halves_begin(int n, struct slow_tests *t);

/* Move the bias of the reference towards what it is off, by at most `most` a frame. */
void halves_learn_reference(double most, struct slow_tests *t);

/* Variance of D of four healthy channels, with n in use: the data sheet's where four were never in use. */
double halves_known_noise(int n, const struct slow_tests *t);

/* Move the means of the ways to halve n channels; the one that is suspected, below 0: none. */
int halves_suspect(int n, double allowed, struct slow_tests *t);

/* The half, bits, that the slope has decided against for long enough; `usable`: the reference may be asked. */
unsigned halves_isolate(int way, int n, bool usable, struct slow_tests *t);

/* ---- slow_noise.c ---- */

/* Begin all means again. */
void noise_begin(struct noise *s);

/* Move the means of the second differences by a frame; the bit of the noisy one of two channels, 0 for none.  With more channels
 * only the motion is followed. */
unsigned noise_isolate(int n, struct slow_tests *t);

/* ---- tie_break.c ---- */

/* decisions.md 'Splits': this frame's vote, who decided it, and whom that would fail. */
void tie_break_settle(struct frame *f, params *p, struct signal *s);
void tie_break_keep_basis(const struct frame *f, struct signal *s);

/* ---- references.c ---- */

/* Bits of the signals that others are told by, and that one of their own references disputes. */
int64_t references_in_dispute(const struct rig_config *config, const struct signal signals[RIG_SIGNALS]);

/* decisions.md 'The last channel': its monitor or its reference disputes it; reference or last vote instead. */
void references_check_last(struct frame *f, params *p, const struct signal *s);

/* Fail the pair that extremes have left, if a usable reference is off both for long enough. */
void references_cut_pair(struct frame *f, params *p, struct signal *s);

/* End the suspicion against that pair: the level has changed. */
void references_trust_pair(struct signal *s);

/* The same, where a channel that was `failed` is so no longer. */
void references_readmit(const bool failed[RIG_CHANNELS], struct signal *s);

/* A reference that left both voting ranks for `persistence` frames is unusable until it agreed as long. */
void references_monitor(const struct frame *f, params *p, struct signal *s);

/* Two references against all channels for `common_persistence` frames: report it and, by choice, fail every channel. */
void references_watch_common(struct frame *f, params *p, struct signal *s);

/* ---- persistence.c ---- */

/* Clear the failures of the commanded channels, bits, that have agreed with the vote for readmit_frames. */
void persistence_readmit(struct latches *latches, unsigned commanded, int64_t fitted, int64_t readmit_frames);

/* Count how long each failed channel has agreed with the vote again, for a readmission by command. */
void persistence_watch_failed(const struct frame *f, params *p, struct signal *s);

/* Section 2: frames in a row that each channel miscompared; a sample that is not comparable counts always.  Behind a
 * filter a miscompare counts while the sample itself is off the vote, and else takes one off. */
void persistence_count(const struct frame *f, params *p, struct signal *s);

/* Fail what has persisted: single miscompares, and whom an answer blames that has stood for long enough. */
void persistence_settle(struct frame *f, params *p, struct signal *s);

/* ---- boxes.c ---- */

/* Begin with the boxes of the signals, whose rules are known. */
void boxes_open(const struct rig_config *config, const struct signal signals[RIG_SIGNALS]);

/* Whom this frame's evidence of one signal accuses, bits; trend, extremes and middle are none. */
unsigned boxes_accuse(const struct frame *f, params *p, const struct signal *s);

/* Fail, box by box, on all its signals the channels accused long enough on enough of them. */
void boxes_watch(const struct rig_config *config, struct signal signals[RIG_SIGNALS], struct rig_output *output);

/* ---- rules.c ---- */

/* Whether every box has a number that there is. */
bool rules_usable(const struct rig_config *config);

/* Read the rules of a signal. */
void rules_open(const struct rig_config *config, int signal, struct rules *r);

/* Fail all channels of a split that no rule has answered for long enough; whether it did. */
bool rules_give_up(struct frame *f, params *p, struct signal *s);

/* ---- discretes.c ---- */

/* Begin with every discrete channel in use. */
void discretes_open(const struct rig_discrete_config config[RIG_DISCRETES]);

/* Vote and monitor the discretes of one frame. */
void discretes_step(const struct rig_input *input, struct rig_output *output);

#endif
