/* The cross-channel monitor of the rig as a unit under test: the same decisions and the same bits.
 *
 * Zhang (2023), whose sections the comments name, and docs/redundancy.md for what the paper leaves open (RED with the
 * heading of the rule).  One pass a signal and frame: rank the samples, name the pattern, vote, count, latch.
 * No dynamic memory, no recursion, every loop bounded by a constant or by the number of channels.
 * Build with -ffp-contract=off and without -ffast-math: the order of the operations is part of the result.
 */
#include <math.h>
#include <string.h>

#include "monitor.h"

#define PI 3.141592653589793
#define TURN 6.283185307179586
#define SEA_LEVEL_DENSITY 1.225 /* kg/m3; International Standard Atmosphere */
#define REFERENCE_MARGIN 1.5    /* reference thresholds that it takes to dispute a last channel or a vote */
#define RESOLVERS 5             /* places in the configured order */
#define NO_ANSWER (-1)          /* of a resolver that cannot tell */
#define LOW_SIDE 1              /* of a 2:2 or 1:1: the half of the smaller samples, */
#define HIGH_SIDE 2             /* and that of the larger */

/* One signal in one frame. */
struct frame {
    const double *samples;      /* by channel, as are valid and ilm */
    const uint8_t *valid;
    const uint8_t *ilm;         /* what the channels' in-line monitors say */
    double base;                /* an angle is taken within half a turn of it */
    double reference;           /* NaN: none */
    double second;              /* reference of other physics; NaN: none */
    double reference_threshold;
    int n;                      /* comparable samples */
    int order[RIG_CHANNELS];    /* their channels, by ascending value */
    double x[RIG_CHANNELS];     /* their values, by channel */
    unsigned ranked;            /* their channels, bits */
    double low, high;           /* the two voting ranks, */
    double rise_low, rise_high; /* and their changes since the last frame */
    bool alone[RIG_CHANNELS];   /* agrees with no other channel */
    bool blamed[RIG_CHANNELS];  /* would be failed by the answer to a pattern without a majority */
    uint8_t resolver;           /* who decided */
    double vote;                /* before the fade */
};

/* One signal, from frame to frame. */
struct signal {
    struct latches latches;
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

typedef const struct rig_signal_config params;

static struct rig_config config;
static struct signal signals[RIG_SIGNALS];
static unsigned accused[RIG_SIGNALS]; /* channels that the frame's evidence speaks against, bits */
static int64_t box_count[RIG_CHANNELS];
static uint64_t stepped;

/* ---- Numbers ---- */

/* x modulo one turn, from 0 up to one turn, never a negative zero; NaN stays NaN. */
static double modulo_turn(double x)
{
    const double rest = fmod(x, TURN);
    return (rest < 0.0) ? (rest + TURN) : fabs(rest);
}

/* a - b; of an angle the short way round. */
static double difference(double a, double b, params *p)
{
    return (p->wraps != 0) ? (modulo_turn((a - b) + PI) - PI) : (a - b);
}

/* x within [low, high]; NaN stays NaN. */
static double clamp(double x, double low, double high)
{
    const double raised = (low > x) ? low : x;
    return (high < raised) ? high : raised;
}

/* A vote within the sensor's range: an angle goes round the circle, anything else saturates. */
static double limit(double x, params *p)
{
    return (p->wraps != 0) ? (modulo_turn(x - p->low) + p->low) : clamp(x, p->low, p->high);
}

/* Weighted mean that stays within [low, high] whatever the rounding. */
static double mean(double low, double high, double weight_high)
{
    return clamp(low + (weight_high * (high - low)), low, high);
}

/* ---- Which samples are compared, and their ranks: sections 2 and 3 ---- */

/* A sample is compared and voted when it is flagged valid, a number and within the sensor's range. */
static bool comparable(const struct frame *f, int c, params *p)
{
    return (f->valid[c] != 0) && (p->low <= f->samples[c]) && (f->samples[c] <= p->high);
}

/* What an angle is taken near to: the last vote; in the first frame of all the first comparable sample. */
static double anchor(const struct frame *f, params *p, const struct signal *s)
{
    if (s->started) {
        return s->vote;
    }
    for (int c = 0; c < p->fitted; c++) {
        if (comparable(f, c, p)) {
            return f->samples[c];
        }
    }
    return 0.0;
}

/* A value within half a turn of the frame's base if the signal is an angle. */
static double near_base(double x, const struct frame *f, params *p)
{
    return (p->wraps != 0) ? (f->base + difference(x, f->base, p)) : x;
}

/* A reference near the frame's base; NaN when it is not finite. */
static double seen(double reference, const struct frame *f, params *p)
{
    return isfinite(reference) ? near_base(reference, f, p) : (double)NAN;
}

/* Swap places i < j of the order when they are out of order. */
static void exchange(struct frame *f, int i, int j)
{
    const int a = f->order[i];
    const int b = f->order[j];
    if (f->x[a] > f->x[b]) {
        f->order[i] = b;
        f->order[j] = a;
    }
}

/* Put the channels into ascending order of their samples: five exchanges for four, three for three. */
static void sort(struct frame *f)
{
    if (f->n == 4) {
        exchange(f, 0, 1);
        exchange(f, 2, 3);
        exchange(f, 0, 2);
        exchange(f, 1, 3);
        exchange(f, 1, 2);
    } else if (f->n >= 2) {
        exchange(f, 0, 1);
        if (f->n == 3) {
            exchange(f, 1, 2);
            exchange(f, 0, 1);
        }
    } else {
        /* nothing to sort */
    }
}

/* Section 2: gather the comparable samples of channels in use, rank them, find the two voting ranks. */
static void rank(struct frame *f, params *p, const struct signal *s)
{
    for (int c = 0; c < p->fitted; c++) {
        if (!s->latches.failed[c] && comparable(f, c, p)) {
            f->x[c] = near_base(f->samples[c], f, p);
            f->order[f->n] = c;
            f->n++;
            f->ranked |= 1U << c;
        }
    }
    sort(f);
    if (f->n > 0) {
        f->low = f->x[f->order[(f->n - 1) / 2]];
        f->high = f->x[f->order[f->n / 2]];
    }
}

/* RED 'References': of a dynamic pressure that is made from the speed over ground, the wind is the error. */
static double reference_threshold(double reference, params *p)
{
    if ((p->reference_airspeed_m_s > 0.0) && (reference > 0.0)) {
        const double of_wind = p->reference_airspeed_m_s * sqrt(2.0 * SEA_LEVEL_DENSITY * reference);
        return (p->reference_threshold < of_wind) ? p->reference_threshold : of_wind;
    }
    return p->reference_threshold;
}

/* ---- Which pattern they make: sections 2 and 3 ---- */

static bool is_singular(uint8_t pattern)
{
    return (pattern >= RIG_PATTERN_P2_2) && (pattern <= RIG_PATTERN_P1_1);
}

/* The pattern of n samples of which `count` neighbours in rank are apart, those in the middle as `middle` says. */
static uint8_t pattern_of(int n, int count, bool middle)
{
    if (n == 0) {
        return RIG_PATTERN_LOST;
    }
    if (count == 0) {
        return RIG_PATTERN_NORMAL;
    }
    if ((n == 4) && (count == 1) && middle) {
        return RIG_PATTERN_P2_2;
    }
    if (count < (n - 1)) {
        return RIG_PATTERN_ISOLATED;
    }
    if (n == 4) {
        return RIG_PATTERN_P1_1_1_1;
    }
    return (n == 3) ? RIG_PATTERN_P1_1_1 : RIG_PATTERN_P1_1;
}

/* Name the pattern and mark who agrees with nobody.  Neighbours decide: across a gap all pairs disagree. */
static uint8_t classify(struct frame *f, params *p)
{
    bool apart[RIG_CHANNELS + 1] = {true, true, true, true, true}; /* apart[i]: ranks i - 1 and i */
    int count = 0;
    for (int i = 1; i < f->n; i++) {
        apart[i] = !((f->x[f->order[i]] - f->x[f->order[i - 1]]) <= p->threshold);
        count += apart[i] ? 1 : 0;
    }
    for (int i = 0; (i < f->n) && (count > 0); i++) {
        f->alone[f->order[i]] = apart[i] && apart[i + 1];
    }
    return pattern_of(f->n, count, apart[2]);
}

/* The pattern, and for how many frames it has lasted. */
static void follow_pattern(uint8_t pattern, struct signal *s)
{
    s->pattern_frames = (pattern == s->pattern) ? (s->pattern_frames + 1) : 1;
    s->pattern = pattern;
}

/* ---- Trend: section 6 and table 1 ---- */

/* Shift this frame's bits into the trend bytes; begin again when the number of samples has changed. */
static void update_trend(struct frame *f, params *p, struct signal *s)
{
    if ((f->n == s->last_n) && (f->n > 0)) {
        const unsigned mask = (1U << p->trend_frames) - 1U;
        f->rise_high = difference(f->high, s->last_high, p);
        f->rise_low = difference(f->low, s->last_low, p);
        s->trend_high = ((s->trend_high << 1) | ((f->rise_high > 0.0) ? 1U : 0U)) & mask;
        s->trend_low = ((s->trend_low << 1) | ((f->rise_low > 0.0) ? 1U : 0U)) & mask;
        s->trend_seen++;
    } else {
        s->trend_high = 0U;
        s->trend_low = 0U;
        s->trend_seen = 0;
    }
    s->last_high = f->high;
    s->last_low = f->low;
    s->last_n = f->n;
}

/* Both ranks rose in every frame of full bytes: the larger is good.  Neither rose in any: the smaller is. */
static int by_trend(params *p, const struct signal *s)
{
    const unsigned rising = (1U << p->trend_frames) - 1U;
    if ((s->trend_seen < p->trend_frames) || (s->trend_high != s->trend_low)) {
        return NO_ANSWER;
    }
    if (s->trend_high == rising) {
        return LOW_SIDE;
    }
    return (s->trend_high == 0U) ? HIGH_SIDE : NO_ANSWER;
}

/* ---- The vote with a majority: sections 4 and 5 ---- */

/* Section 4, trend-weighted mean: the value whose change is nearer to the vote's last change weighs more. */
static double trend_weight(const struct frame *f, const struct signal *s)
{
    if (!((f->rise_high * f->rise_low) > 0.0)) {
        return 0.5;
    }
    const double off_high = fabs(f->rise_high - s->rise_vote);
    const double off_low = fabs(f->rise_low - s->rise_vote);
    const double total = off_high + off_low;
    return (total <= 0.0) ? 0.5 : (off_low / total);
}

/* Section 5: the middle value, the mean of two, and never a suspect where the other rank is none. */
static double median(const struct frame *f, double weight_high)
{
    if ((f->n % 2) == 1) {
        return f->high;
    }
    if (f->alone[f->order[f->n / 2]]) {
        return f->low;
    }
    if (f->alone[f->order[(f->n / 2) - 1]]) {
        return f->high;
    }
    return mean(f->low, f->high, weight_high);
}

/* ---- Patterns without a majority: sections 6 to 8, RED 'Patterns without a majority' ---- */

/* Channels among the ranks from `first` to before `end` whose in-line monitor says `flag`. */
static int saying(const struct frame *f, int first, int end, uint8_t flag)
{
    int count = 0;
    for (int i = first; i < end; i++) {
        count += (f->ilm[f->order[i]] == flag) ? 1 : 0;
    }
    return count;
}

/* Section 2: the in-line monitors answer when they follow the pairing. */
static int by_ilm(const struct frame *f)
{
    const int half = f->n / 2;
    if ((saying(f, 0, half, RIG_ILM_GOOD) == half) && (saying(f, half, f->n, RIG_ILM_BAD) == half)) {
        return HIGH_SIDE;
    }
    if ((saying(f, half, f->n, RIG_ILM_GOOD) == half) && (saying(f, 0, half, RIG_ILM_BAD) == half)) {
        return LOW_SIDE;
    }
    return NO_ANSWER;
}

/* Section 7: the triplex {high, low, reference}: who is not its middle, or too far from it. */
static int by_reference(const struct frame *f)
{
    if (isnan(f->reference)) {
        return NO_ANSWER;
    }
    if (f->reference >= f->high) {
        return LOW_SIDE;
    }
    if (f->reference <= f->low) {
        return HIGH_SIDE;
    }
    const int high = ((f->high - f->reference) > f->reference_threshold) ? HIGH_SIDE : 0;
    const int low = ((f->reference - f->low) > f->reference_threshold) ? LOW_SIDE : 0;
    return high + low;
}

/* What one resolver says of two halves: the sides to be failed, or NO_ANSWER. */
static int ask_sides(int64_t resolver, const struct frame *f, params *p, const struct signal *s)
{
    if (resolver == RIG_RESOLVER_ILM) {
        return by_ilm(f);
    }
    if (resolver == RIG_RESOLVER_TREND) {
        return by_trend(p, s);
    }
    if ((resolver == RIG_RESOLVER_REFERENCE) && s->reference_usable) {
        return by_reference(f);
    }
    return NO_ANSWER;
}

/* Mark the channels of the sides that an answer would fail. */
static void blame_sides(int sides, struct frame *f)
{
    const int half = f->n / 2;
    for (int i = 0; i < f->n; i++) {
        const int side = (i < half) ? LOW_SIDE : HIGH_SIDE;
        f->blamed[f->order[i]] = (sides == side) || (sides == (LOW_SIDE + HIGH_SIDE));
    }
}

/* Mark all ranked channels but the one or two that an answer keeps. */
static void blame_all_but(int one, int other, struct frame *f)
{
    for (int i = 0; i < f->n; i++) {
        const int c = f->order[i];
        f->blamed[c] = (c != one) && (c != other);
    }
}

/* 2:2 and 1:1, sections 2, 6 and 7: which half is right; whether a resolver could tell. */
static bool settle_halves(struct frame *f, params *p, const struct signal *s)
{
    const int half = f->n / 2;
    for (int place = 0; place < RESOLVERS; place++) {
        const int64_t name = p->resolvers[place];
        const int sides = ask_sides(name, f, p, s);
        if (sides != NO_ANSWER) {
            const int good = (sides == LOW_SIDE) ? half : 0;
            f->vote = (name == RIG_RESOLVER_REFERENCE)
                          ? clamp(f->reference, f->low, f->high)
                          : mean(f->x[f->order[good]], f->x[f->order[good + half - 1]], 0.5);
            f->resolver = (uint8_t)name;
            blame_sides(sides, f);
            return true;
        }
    }
    return false;
}

/* The one channel whose in-line monitor says good while all others say bad. */
static int only_good(const struct frame *f)
{
    int kept = NO_ANSWER;
    for (int i = 0; i < f->n; i++) {
        kept = (f->ilm[f->order[i]] == RIG_ILM_GOOD) ? f->order[i] : kept;
    }
    const int good = saying(f, 0, f->n, RIG_ILM_GOOD);
    const int bad = saying(f, 0, f->n, RIG_ILM_BAD);
    return ((good == 1) && (bad == (f->n - 1))) ? kept : NO_ANSWER;
}

/* The one channel within the threshold of the reference; no answer for none, several or no reference. */
static int only_near(const struct frame *f, params *p)
{
    int near = 0;
    int kept = NO_ANSWER;
    for (int i = 0; i < f->n; i++) {
        if (fabs(difference(f->x[f->order[i]], f->reference, p)) <= f->reference_threshold) {
            near++;
            kept = f->order[i];
        }
    }
    return (near == 1) ? kept : NO_ANSWER;
}

/* 1:1:1:1 and 1:1:1, section 8: at most one channel is right; whether monitors or reference could tell. */
static bool settle_apart(struct frame *f, params *p, const struct signal *s)
{
    for (int place = 0; place < RESOLVERS; place++) {
        const int64_t name = p->resolvers[place];
        int good = NO_ANSWER;
        if (name == RIG_RESOLVER_ILM) {
            good = only_good(f);
        } else if ((name == RIG_RESOLVER_REFERENCE) && s->reference_usable) {
            good = only_near(f, p);
        } else {
            /* no answer to these patterns */
        }
        if (good != NO_ANSWER) {
            f->vote = f->x[good];
            f->resolver = (uint8_t)name;
            blame_all_but(good, good, f);
            return true;
        }
    }
    return false;
}

/* Section 8, rules of likelihood if configured: of four the extremes fail, of three all but the middle. */
static bool settle_by_rank(struct frame *f, params *p, const struct signal *s)
{
    const uint8_t rule = (s->pattern == RIG_PATTERN_P1_1_1_1) ? RIG_RESOLVER_EXTREMES : RIG_RESOLVER_MIDDLE;
    for (int place = 0; place < RESOLVERS; place++) {
        if (p->resolvers[place] == rule) {
            f->vote = mean(f->low, f->high, 0.5);
            f->resolver = rule;
            blame_all_but(f->order[(f->n - 1) / 2], f->order[f->n / 2], f);
            return true;
        }
    }
    return false;
}

/* RED 'Nobody answers': the last vote, moved by the mean change of the voting ranks but in a pattern's first frame. */
static double hold(const struct frame *f, const struct signal *s)
{
    if (!s->started) {
        return mean(f->low, f->high, 0.5);
    }
    return (s->pattern_frames == 1) ? s->vote : (s->vote + (0.5 * (f->rise_high + f->rise_low)));
}

/* Ask the resolvers in their order, then the rules of rank; hold when nobody answers. */
static void settle(struct frame *f, params *p, const struct signal *s)
{
    bool answered;
    if ((s->pattern == RIG_PATTERN_P2_2) || (s->pattern == RIG_PATTERN_P1_1)) {
        answered = settle_halves(f, p, s);
    } else {
        answered = settle_apart(f, p, s) || settle_by_rank(f, p, s);
    }
    if (!answered) {
        f->vote = hold(f, s);
        f->resolver = RIG_RESOLVER_UNRESOLVED;
    }
}

/* ---- The last channel and this frame's vote ---- */

/* RED 'The last channel': its own monitor and its reference can dispute it; then reference or last vote are voted. */
static void check_last(struct frame *f, params *p, const struct signal *s)
{
    const int c = f->order[0];
    const double apart = fabs(difference(f->x[c], f->reference, p));
    const bool usable = s->reference_usable && !isnan(f->reference);
    const bool bad = f->ilm[c] == RIG_ILM_BAD;
    f->vote = f->x[c];
    if (bad || (usable && (apart > (REFERENCE_MARGIN * f->reference_threshold)))) {
        f->alone[c] = true;
        f->resolver = bad ? RIG_RESOLVER_ILM : RIG_RESOLVER_REFERENCE;
        if (usable) {
            f->vote = f->reference;
        } else if (s->started) {
            f->vote = s->vote;
        } else {
            /* the first frame of all: the sample */
        }
    }
}

/* Sections 5 to 8: this frame's vote and who decided; a lost signal holds its last vote. */
static void decide(struct frame *f, params *p, const struct signal *s)
{
    f->resolver = RIG_RESOLVER_NONE;
    if (f->n == 0) {
        f->vote = s->vote;
    } else if (is_singular(s->pattern)) {
        settle(f, p, s);
    } else if (f->n == 1) {
        check_last(f, p, s);
    } else {
        f->vote = median(f, (p->weighted != 0) ? trend_weight(f, s) : 0.5);
    }
}

/* ---- References: section 7 ---- */

/* A reference that left a vote with a majority for `persistence` frames is unusable until it agreed as long. */
static void monitor_reference(const struct frame *f, params *p, struct signal *s)
{
    if ((f->n < 2) || is_singular(s->pattern) || isnan(f->reference)) {
        return;
    }
    const bool agrees = fabs(difference(f->vote, f->reference, p)) <= f->reference_threshold;
    s->reference_run = (agrees != s->reference_usable) ? (s->reference_run + 1) : 0;
    if (s->reference_run >= p->persistence) {
        s->reference_usable = agrees;
        s->reference_run = 0;
    }
}

/* Whether a reference is off the vote by more than its margin and the monitor's threshold; NaN never is. */
static bool off_vote(double reference, double threshold, const struct frame *f, params *p)
{
    const double margin = REFERENCE_MARGIN * threshold;
    return fabs(difference(f->vote, reference, p)) > ((p->threshold > margin) ? p->threshold : margin);
}

/* RED 'Two references against all channels': all channels in use agree, both references speak against them. */
static bool contradicted(const struct frame *f, params *p, const struct signal *s)
{
    if ((f->n < 2) || (f->n != s->level) || (s->pattern != RIG_PATTERN_NORMAL)) {
        return false;
    }
    const double apart = fabs(difference(f->reference, f->second, p));
    return off_vote(f->reference, f->reference_threshold, f, p) && off_vote(f->second, p->second_threshold, f, p) &&
           (apart <= (f->reference_threshold + p->second_threshold));
}

/* The same, for `common_persistence` frames: report it and, by choice, fail every channel and trust the reference. */
static void watch_common(struct frame *f, params *p, struct signal *s)
{
    s->common_run = contradicted(f, p, s) ? (s->common_run + 1) : 0;
    s->common_mode = s->common_run >= p->common_persistence;
    if (s->common_mode && (p->common_fails != 0)) {
        for (int c = 0; c < p->fitted; c++) {
            s->latches.failed[c] = true;
        }
        s->reference_usable = true;
        s->reference_run = 0;
        f->resolver = RIG_RESOLVER_COMMON;
    }
}

/* ---- Counts, latches, readmission: sections 1 and 2 ---- */

/* Count how long each failed channel has agreed with the vote again, for a readmission by command. */
static void watch_failed(const struct frame *f, params *p, struct signal *s)
{
    if (s->level == p->fitted) {
        return;
    }
    for (int c = 0; c < p->fitted; c++) {
        const bool near = fabs(difference(f->samples[c], f->vote, p)) <= p->threshold;
        const bool agrees = s->latches.failed[c] && (f->valid[c] != 0) && near;
        s->latches.agreed[c] = agrees ? (s->latches.agreed[c] + 1) : 0;
    }
}

void monitor_readmit(struct latches *latches, unsigned commanded, int64_t fitted, int64_t readmit_frames)
{
    for (int c = 0; c < fitted; c++) {
        const bool wanted = ((commanded >> c) & 1U) != 0U;
        if (wanted && latches->failed[c] && (latches->agreed[c] >= readmit_frames)) {
            latches->failed[c] = false;
            latches->count[c] = 0;
            latches->agreed[c] = 0;
        }
    }
}

/* RED 'After a pattern without a majority': whether the counts of comparable samples wait in this frame. */
static bool counts_stand_still(const struct frame *f, params *p, struct signal *s)
{
    if (is_singular(s->pattern)) {
        s->singular_run++;
        return true;
    }
    if (s->singular_run > 0) {
        const bool long_run = s->singular_run > p->singular_persistence;
        const int64_t wait = long_run ? p->singular_persistence : s->singular_run;
        s->freeze = (wait > s->freeze) ? wait : s->freeze;
        s->singular_run = 0;
    }
    if (s->freeze == 0) {
        return false;
    }
    s->freeze--;
    return f->n != 1; /* what disputes a last channel needs no majority */
}

/* Section 2: frames in a row that each channel miscompared; a sample that is not comparable counts always. */
static void count_miscompares(const struct frame *f, params *p, struct signal *s)
{
    const bool still = counts_stand_still(f, p, s);
    int64_t *const count = s->latches.count;
    for (int c = 0; c < p->fitted; c++) {
        const bool ranked = ((f->ranked >> c) & 1U) != 0U;
        if (s->latches.failed[c] || (ranked && still)) {
            continue;
        }
        count[c] = (!ranked || f->alone[c]) ? (count[c] + 1) : 0;
    }
}

/* Sections 1 and 2: fail what has persisted, of single miscompares and of a settled pattern without a majority. */
static void latch(const struct frame *f, params *p, struct signal *s)
{
    const bool settled = s->pattern_frames >= p->singular_persistence;
    int64_t level = 0;
    for (int c = 0; c < p->fitted; c++) {
        if ((s->latches.count[c] >= p->persistence) || (settled && f->blamed[c])) {
            s->latches.failed[c] = true;
        }
        level += s->latches.failed[c] ? 0 : 1;
    }
    if (level != s->level) {
        s->fade_left = p->fade_frames + 1;
        s->level = level;
    }
}

/* ---- A box that dies: RED of that name ---- */

/* Whom this frame's evidence of one signal accuses; trend, extremes and middle are none. */
static unsigned accuse(const struct frame *f, params *p, const struct signal *s)
{
    const bool evidence = (f->resolver == RIG_RESOLVER_ILM) || (f->resolver == RIG_RESOLVER_REFERENCE);
    const bool singular = is_singular(s->pattern);
    unsigned bits = 0U;
    for (int c = 0; c < p->fitted; c++) {
        const bool ranked = ((f->ranked >> c) & 1U) != 0U;
        const bool against = singular ? (evidence && f->blamed[c]) : f->alone[c];
        if (!s->latches.failed[c] && (!ranked || against)) {
            bits |= 1U << c;
        }
    }
    return bits;
}

/* Count the frames in a row in which channel c is accused on enough signals; whether it is in use or accused. */
static bool watch_box(int c)
{
    int64_t against = 0;
    bool in_use = false;
    for (int i = 0; i < RIG_SIGNALS; i++) {
        against += ((accused[i] >> c) & 1U) != 0U ? 1 : 0;
        in_use = in_use || ((c < config.signal[i].fitted) && !signals[i].latches.failed[c]);
    }
    box_count[c] = (against >= config.box_signals) ? (box_count[c] + 1) : 0;
    return in_use || (against > 0);
}

/* Fail the condemned channels, bits, on one signal that has been voted: the fade begins in the next frame. */
static void fail_all(unsigned condemned, int i, struct rig_output *output)
{
    struct signal *const s = &signals[i];
    for (int c = 0; c < config.signal[i].fitted; c++) {
        if ((((condemned >> c) & 1U) != 0U) && !s->latches.failed[c]) {
            s->latches.failed[c] = true;
            s->level--;
            s->fade_left = config.signal[i].fade_frames;
            output->state[i][c] = RIG_STATE_FAILED;
            output->level[i] = (uint8_t)s->level;
            output->resolver[i] = RIG_RESOLVER_BOX;
        }
    }
}

/* Fail on all their signals the channels accused long enough on enough signals, unless they are the majority. */
static void fail_boxes(struct rig_output *output)
{
    unsigned condemned = 0U;
    int candidates = 0;
    int boxes = 0;
    for (int c = 0; c < RIG_CHANNELS; c++) {
        boxes += watch_box(c) ? 1 : 0;
        if (box_count[c] >= config.box_persistence) {
            condemned |= 1U << c;
            candidates++;
        }
    }
    if ((2 * candidates) <= boxes) {
        for (int i = 0; i < RIG_SIGNALS; i++) {
            fail_all(condemned, i, output);
        }
    }
}

/* Boxes are watched only in frames in which enough signals accuse anybody. */
static void watch_boxes(struct rig_output *output)
{
    int64_t accusing = 0;
    for (int i = 0; i < RIG_SIGNALS; i++) {
        accusing += (accused[i] != 0U) ? 1 : 0;
    }
    if ((config.box_signals > 0) && (accusing >= config.box_signals)) {
        fail_boxes(output);
    } else {
        memset(box_count, 0, sizeof box_count);
    }
}

/* ---- What goes out ---- */

/* The vote within the range and its fade after a change of level; after an overflow the last vote holds. */
static void publish(const struct frame *f, params *p, struct signal *s)
{
    const double raw = isfinite(f->vote) ? f->vote : s->vote;
    const int64_t left = s->fade_left;
    s->rise_vote = s->started ? difference(raw, s->vote, p) : 0.0;
    s->vote = limit(raw, p);
    if (left == p->fade_frames) { /* the first vote after the change */
        s->fade = difference(s->output, s->vote, p);
    }
    s->output = s->vote;
    if ((left > 0) && (left <= p->fade_frames)) {
        const double faded = s->vote + ((s->fade * (double)left) / ((double)p->fade_frames + 1.0));
        s->output = isfinite(faded) ? limit(faded, p) : s->vote;
    }
    s->fade_left = (left > 0) ? (left - 1) : 0;
    s->started = true;
}

/* Section 1: a channel is failed, suspect while it miscompares or is blamed, else ok. */
static uint8_t channel_state(const struct frame *f, int c, params *p, const struct signal *s)
{
    if (c >= p->fitted) {
        return RIG_STATE_ABSENT;
    }
    if (s->latches.failed[c]) {
        return RIG_STATE_FAILED;
    }
    return (f->alone[c] || f->blamed[c] || (s->latches.count[c] != 0)) ? RIG_STATE_SUSPECT : RIG_STATE_OK;
}

/* One signal's answer. */
static void report(const struct frame *f, int i, double reference, struct rig_output *output)
{
    const struct signal *const s = &signals[i];
    output->voted[i] = s->output;
    output->level[i] = (uint8_t)s->level;
    output->pattern[i] = s->pattern;
    output->resolver[i] = f->resolver;
    output->reference_usable[i] = (s->reference_usable && isfinite(reference)) ? 1 : 0;
    output->common_mode[i] = s->common_mode ? 1 : 0;
    output->trend_high[i] = (uint8_t)s->trend_high;
    output->trend_low[i] = (uint8_t)s->trend_low;
    for (int c = 0; c < RIG_CHANNELS; c++) {
        output->state[i][c] = channel_state(f, c, &config.signal[i], s);
    }
}

/* ---- One signal, one frame ---- */

/* What the frame shows of signal i. */
static struct frame view(const struct rig_input *input, int i)
{
    params *const p = &config.signal[i];
    struct frame f = {.samples = input->channels[i], .valid = input->valid[i], .ilm = input->ilm[i]};
    f.base = anchor(&f, p, &signals[i]);
    f.reference = seen(input->reference[i], &f, p);
    f.second = seen(input->second_reference[i], &f, p);
    f.reference_threshold = reference_threshold(f.reference, p);
    rank(&f, p, &signals[i]);
    return f;
}

/* Sections 2 to 8, in the order of the table in docs/redundancy.md. */
static void monitor_signal(const struct rig_input *input, int i, struct rig_output *output)
{
    params *const p = &config.signal[i];
    struct signal *const s = &signals[i];
    monitor_readmit(&s->latches, input->reset[i], p->fitted, p->readmit_frames);
    struct frame f = view(input, i);
    follow_pattern(classify(&f, p), s);
    update_trend(&f, p, s);
    decide(&f, p, s);
    monitor_reference(&f, p, s);
    watch_common(&f, p, s);
    watch_failed(&f, p, s);
    accused[i] = accuse(&f, p, s);
    count_miscompares(&f, p, s);
    latch(&f, p, s);
    publish(&f, p, s);
    report(&f, i, input->reference[i], output);
}

/* ---- The interface ---- */

/* Whether every number that bounds a loop or a shift is within its range, and every sensor's range is one. */
static bool usable(const struct rig_config *wanted)
{
    bool good = wanted->layout == RIG_UNIT_LAYOUT;
    for (int i = 0; i < RIG_SIGNALS; i++) {
        params *const p = &wanted->signal[i];
        good = good && (p->fitted >= 0) && (p->fitted <= RIG_CHANNELS) && (p->low <= p->high);
        good = good && (p->trend_frames >= 1) && (p->trend_frames <= 8);
    }
    for (int d = 0; d < RIG_DISCRETES; d++) {
        good = good && (wanted->discrete[d].fitted >= 0) && (wanted->discrete[d].fitted <= RIG_CHANNELS);
    }
    return good;
}

int rig_unit_open(const struct rig_config *wanted)
{
    if (!usable(wanted)) {
        return 1;
    }
    config = *wanted;
    memset(signals, 0, sizeof signals);
    memset(box_count, 0, sizeof box_count);
    stepped = 0U;
    for (int i = 0; i < RIG_SIGNALS; i++) {
        signals[i].reference_usable = true;
        signals[i].level = config.signal[i].fitted;
    }
    discretes_open(config.discrete);
    return 0;
}

int rig_unit_step(const struct rig_input *input, struct rig_output *output)
{
    for (int i = 0; i < RIG_SIGNALS; i++) {
        monitor_signal(input, i, output);
    }
    watch_boxes(output);
    discretes_step(input, output);
    stepped++;
    output->stepped = stepped;
    output->said = RIG_SAID_VOTED | RIG_SAID_STATE | RIG_SAID_PATTERN | RIG_SAID_TREND | RIG_SAID_DISCRETES;
    return 0;
}

void rig_unit_close(void)
{
    /* nothing to give back: open begins again */
}
