/* Slow-fault tests: three means of each channel's residual, against limits that follow from its noise.
 *
 * docs/explanation/decisions.md of that name.  A residual is a sample, less what is learned of its channel (its bias), less the
 * median of all channels without theirs.  A fast and a slow mean find offsets, drifts and frozen samples, a mean of squares finds
 * noise and oscillation; an error of fewer frames than BURST moves none to its limit.  Nothing here moves a vote: slow_halves.c
 * has two channels that are wrong alike, or two that are left, and slow_noise.c the noisy one of two that are left.
 */
#include <string.h>

#include "monitor.h"

#define FAST 16.0       /* frames of the fast mean, */
#define SQUARE 128.0    /* and of that of squares */
#define CUT 8.0         /* slow_noise, four standard deviations of the data sheet */
#define SIGMAS 6.0      /* standard deviations of a mean that its limit is away */
#define REMEMBERED 20.0 /* frames that the largest steps of the means with a long memory need to reach a limit */
#define WHOLE 2.0       /* of the largest square that counts: what one of a whole residual may be */
#define FOLLOWS 0.25    /* of the common noise: what a residual lacks of its channel's, because the median follows it */
#define STILL 14 /* frames that a sample has repeated of a channel that stands still */
#define CALM 0.5        /* of a limit */

typedef const struct rig_slow_tests_config settings;

void tests_open(const struct rig_config *config, int signal, struct slow_tests *t)
{
    memset(t, 0, sizeof *t);
    t->set = &config->slow_tests[signal];
}

/* Begin to learn the signal again: no bias, no noise, no limits. */
static void forget(struct slow_tests *t)
{
    t->learned = 0;
    t->known = 0.0;
    t->level = 0;
    t->limits_until = 0.0;
    t->reference_learned = 0;
    t->noise = 0.0;
    t->reference_bias = 0.0;
    t->vote_off = 0.0;
    t->reference_vote = 0.0;
    t->rate = 0.0;
    t->usual_rate = 0.0;
    t->reference_rate = 0.0;
    t->motion = 0.0;
    t->halves.noise = 0.0;
    t->second.roughest = 0.0;
    memset(t->bias, 0, sizeof t->bias);
    memset(t->share, 0, sizeof t->share);
}

void tests_readmit(const bool failed[RIG_CHANNELS], struct signal *s)
{
    for (int c = 0; c < RIG_CHANNELS; c++) {
        if (failed[c] && !s->latches.failed[c]) {
            forget(&s->slow_tests);
        }
    }
}

/* ---- What a frame is measured by ---- */

bool tests_run(const struct slow_tests *t)
{
    return t->set->slow_means > 0.0;
}

double tests_middle(const struct frame *f, struct slow_tests *t)
{
    for (int i = 0; i < f->n; i++) {
        const int c = f->order[i];
        t->value[c] = f->x[c] - t->bias[c];
        t->order[i] = c;
    }
    const double a = t->value[t->order[0]];
    const double b = t->value[t->order[f->n - 1]];
    double low = smaller(a, b);
    double high = larger(a, b);
    if (f->n == RIG_CHANNELS) {
        const double c = t->value[t->order[1]];
        const double d = t->value[t->order[2]];
        const double one = larger(low, smaller(c, d));
        const double other = smaller(high, larger(c, d));
        low = smaller(one, other);
        high = larger(one, other);
    } else if (f->n == 3) {
        low = larger(low, smaller(high, t->value[t->order[1]]));
        high = low;
    } else {
        /* of two the mean, of one itself */
    }
    return mean(low, high, 0.5);
}

bool tests_is_cut(double m, params *p, const struct slow_tests *t)
{
    const double margin = ((2.0 * t->set->slow_bias) + (t->set->slow_scale * fabs(m))) + (CUT * t->set->slow_noise);
    return (p->wraps == 0) && ((m > (p->high - margin)) || (m < (p->low + margin)));
}

/* Move the mean of what the biases move the vote, off the middle without them. */
static void follow_vote(double m, const struct frame *f, params *p, struct slow_tests *t)
{
    const double voted = mean(f->x[f->order[(f->n - 1) / 2]], f->x[f->order[f->n / 2]], 0.5);
    const double off = clamp(difference(voted, m, p), -f->threshold, f->threshold);
    t->vote_off += (off - t->vote_off) * (1.0 / TESTS_SLOW);
}

/* Another number of channels has another middle: all means begin again, biases stay. */
static void begin_again(int n, struct slow_tests *t)
{
    t->level = n;
    t->shaken = 0.0;
    for (int c = 0; c < RIG_CHANNELS; c++) {
        t->fast[c] = 0.0;
        t->slow[c] = 0.0;
        t->share[c] = 0.0;
        t->square[c] = t->noise;
        t->whole[c] = t->noise;
    }
    halves_begin(n, t);
    noise_begin(&t->second);
}

/* The limits for what is known of the biases: white noise of variance 1 leaves 1 / (2 T) in a mean over T frames, 1 / W at most in
 * a bias of frames whose weights are W in all, and twice as much in those of squares.  Again when a tenth more is known. */
static void renew_limits(settings *set, struct slow_tests *t)
{
    const double known = smaller(larger(t->known, 1.0), 2.0 * TESTS_LEARNING);
    t->fast_limit = (set->slow_means * SIGMAS) * sqrt((0.5 / FAST) + (1.0 / known));
    t->slow_limit = (set->slow_means * SIGMAS) * sqrt((0.5 / TESTS_SLOW) + (1.0 / known));
    t->square_limit = (set->slow_squares * SIGMAS) * sqrt((1.0 / SQUARE) + (2.0 / known));
    t->fast_step = t->fast_limit / tests_reached(FAST, TESTS_BURST);
    t->slow_step = t->slow_limit / tests_reached(TESTS_SLOW, REMEMBERED);
    t->square_step = 1.0 + (t->square_limit / tests_reached(SQUARE, REMEMBERED));
    t->of_fast = 1.0 / t->fast_limit;
    t->of_slow = 1.0 / t->slow_limit;
    t->of_square = 1.0 / t->square_limit;
    t->halves.limit = t->slow_limit * (set->slow_halves / set->slow_means);
    t->halves.square_limit = (1.2 * t->square_limit) * (set->slow_halves / set->slow_squares);
    t->limits_until = (known < (2.0 * TESTS_LEARNING)) ? (1.1 * known) : (double)INFINITY;
}

double tests_reached(double frames, double burst)
{
    return 1.0 - exp(-burst / frames);
}

/* Set the shares of a frame in means over what is learned, while this is less than their frames. */
static void renew_gains(struct slow_tests *t)
{
    const double learned = (double)t->learned;
    t->of_learned = 1.0 / smaller(learned, TESTS_LEARNING);
    t->of_squares = 1.0 / smaller(learned, SQUARE);
    t->halves.of_frames = 1.0 / smaller(learned, TESTS_SLOW);
}

/* What a residual may be by motion alone: other scales since the bias was learned, other times of sampling.  A change to
 * a middle that is not that of a majority, and the first one after another number of channels, are none of the aircraft.  That over
 * frames without tests is their mean. */
static double allowance(double m, double moved, double sigma, int n, params *p, struct slow_tests *t)
{
    const double change = difference(m, t->last_middle, p) / ((double)t->away + 1.0);
    t->last_middle = m;
    t->second.change = change;
    if (t->second.turns > 0) {
        t->rate += (change - t->rate) * (1.0 / FAST);
        t->motion = larger(fabs(t->rate), t->motion * (1.0 - (1.0 / TESTS_SLOW)));
        if (n > 2) {
            t->motion = larger(t->motion, fabs(change) - (3.0 * sigma));
        }
    }
    if (t->away > 0) { /* a second difference is of three frames in a row */
        t->second.turns = 0;
        t->away = 0;
    }
    const double skewed = larger(t->motion, fabs(t->rate - t->usual_rate));
    return ((2.0 * t->set->slow_scale) * fabs(moved)) + (t->set->slow_skew * skewed);
}

/* ---- Three means of each channel ---- */

/* The largest of a channel's three means as a share of its limit. */
static double share_of(int c, double per_variance, const struct slow_tests *t)
{
    double share = 0.0;
    if (t->learned >= TESTS_MEANS_FROM) {
        share = larger(fabs(t->fast[c]) * t->of_fast, fabs(t->slow[c]) * t->of_slow);
    }
    if (t->learned >= TESTS_SQUARES_FROM) {
        share = larger(share, ((t->square[c] * per_variance) - 1.0) * t->of_square);
    }
    return share;
}

/* Move the means and the common noise, which is the second lowest (of two: the lowest); the channel with the largest share. */
static int move_means(double m, double allowed, double sigma, double healthy, int n, struct slow_tests *t)
{
    const double one = 1.0 / sigma;
    const double most = t->square_step * healthy;
    const double most_whole = ((WHOLE * t->square_step) * sigma) * sigma;
    const double gain = t->of_squares;
    double lowest = (double)INFINITY;
    double second = (double)INFINITY;
    int worst = t->order[0];
    for (int i = 0; i < n; i++) {
        const int c = t->order[i];
        const double residual = t->value[c] - m;
        const double r = copysign(larger(fabs(residual) - allowed, 0.0), residual);
        const double z = r * one;
        t->whole[c] += gain * (smaller(residual * residual, most_whole) - t->whole[c]);
        t->fast[c] += (clamp(z, -t->fast_step, t->fast_step) - t->fast[c]) * (1.0 / FAST);
        t->slow[c] += (clamp(z, -t->slow_step, t->slow_step) - t->slow[c]) * (1.0 / TESTS_SLOW);
        t->square[c] += gain * (smaller(r * r, most) - t->square[c]);
        second = smaller(second, larger(lowest, t->whole[c]));
        lowest = smaller(lowest, t->whole[c]);
        t->share[c] = share_of(c, 1.0 / healthy, t);
        worst = (t->share[c] > t->share[worst]) ? c : worst;
    }
    t->shaken = (n > 2) ? second : lowest;
    t->noise += (t->shaken - t->noise) * t->of_learned;
    return worst;
}

/* Whether two others of four channels stand still, and channel c does not: where these two are close, the median is often between
 * them, and does not show the mean of the others. */
static bool is_beside_still(int c, int n, const struct slow_faults *l)
{
    int still = 0;
    for (int i = 0; i < n; i++) {
        still += (l->repeats[i] >= STILL) ? 1 : 0;
    }
    return (n == RIG_CHANNELS) && (still == 2) && (l->repeats[c] < STILL);
}

/* The channel whose share is above 1, a bit, if more than half of the channels, or two of four, are below half of it. */
static unsigned isolate_one(int worst, int n, struct slow_tests *t)
{
    int calm = 0;
    if (t->share[worst] <= 1.0) {
        return 0U;
    }
    for (int i = 0; i < n; i++) {
        calm += (t->share[t->order[i]] < (CALM * t->share[worst])) ? 1 : 0;
    }
    const double fast = fabs(t->fast[worst]) * t->of_fast;
    const double slow = fabs(t->slow[worst]) * t->of_slow;
    if (((2 * calm) <= n) && !((n == RIG_CHANNELS) && (calm == 2))) {
        return 0U;
    }
    t->by = (larger(fast, slow) >= t->share[worst]) ? RIG_DECIDED_BY_SLOW_MEANS : RIG_DECIDED_BY_SLOW_SQUARES;
    return 1U << worst;
}

/* ---- What is learned ---- */

/* Move the biases towards the residuals, within their bound, and that of the reference; in frames of no suspicion.  Each is the
 * mean of the first frames, then it follows.  A residual counts up to `step`: a burst before the tests begin is not learned.
 * Biases are weighted means: what times of sampling add in motion is no bias, and such a frame counts less.
 * usable: the reference is */
static void learn(double m, double moved, double step, bool usable, const struct frame *f, struct slow_tests *t)
{
    const double most = (t->learned > 0) ? step : (double)INFINITY;
    const double noise = larger(t->noise, t->set->slow_noise * t->set->slow_noise);
    const double skewed = t->set->slow_skew * t->rate;
    const double weight = noise / (noise + (skewed * skewed));
    t->known += weight;
    const double gain = (t->known > TESTS_LEARNING) ? (weight * (1.0 / TESTS_LEARNING)) : (weight / t->known);
    t->usual_middle += gain * moved;
    t->usual_rate += gain * (t->rate - t->usual_rate);
    const double furthest = t->set->slow_bias + ((1.6 * t->set->slow_scale) * fabs(t->usual_middle));
    for (int i = 0; i < f->n; i++) {
        const int c = t->order[i];
        t->bias[c] = clamp(t->bias[c] + (gain * clamp(t->value[c] - m, -most, most)), -furthest, furthest);
    }
    t->learned++;
    if (t->learned <= (int64_t)TESTS_LEARNING) {
        renew_gains(t);
    }
    if (usable) {
        halves_learn_reference(f->reference_threshold, t);
    }
}

/* ---- A frame ---- */

/* Whether one of the samples in the middle miscompares: two channels are off to the same side, by different amounts. */
static bool off_majority(const struct frame *f)
{
    return f->alone[f->order[(f->n - 1) / 2]] || f->alone[f->order[f->n / 2]];
}

unsigned tests_watch(const struct frame *f, params *p, struct signal *s)
{
    struct slow_tests *const t = &s->slow_tests;
    t->by = RIG_DECIDED_BY_NONE;
    if (!tests_run(t)) {
        return 0U;
    }
    const bool stops = (f->n < 2) || !s->split.whole;
    const double m = stops ? (double)NAN : tests_middle(f, t);
    if (!isfinite(m) || tests_is_cut(m, p, t)) { /* not finite, too: differences near the largest number */
        t->away++; /* the next change of the middle is that of several frames */
        return 0U;
    }
    if (t->learned == 0) {
        t->usual_middle = m;
        t->last_middle = m;
    }
    follow_vote(m, f, p, t);
    if (t->level != f->n) {
        begin_again(f->n, t);
    }
    if (t->known >= t->limits_until) {
        renew_limits(t->set, t);
    }
    const bool split = is_split(s->pattern);
    if ((f->n > 2) && (split || off_majority(f))) { /* such a middle moves as no aircraft does */
        t->second.turns = 0;
    }
    const double variance = larger(larger(t->noise, t->shaken), t->set->slow_noise * t->set->slow_noise);
    const double sigma = sqrt(variance);
    const double sheet = t->set->slow_noise * TESTS_LEAST;
    const double healthy = larger(variance, (sheet * sheet) - (FOLLOWS * variance)); /* the data sheet's where all are quieter */
    const double moved = difference(m, t->usual_middle, p);
    const double allowed = allowance(m, moved, sigma, f->n, p, t);
    const int worst = (t->learned > 0) ? move_means(m, allowed, sigma, healthy, f->n, t) : 0;
    t->reference_off = difference(f->reference - t->reference_bias, m, p);
    const int way = halves_suspect(f->n, allowed, t);
    unsigned bits = halves_isolate(way, f->n, s->reference_usable, t);
    const unsigned noisy = noise_isolate(f->n, t);
    if ((bits == 0U) && (noisy != 0U)) {
        bits = noisy;
        t->by = RIG_DECIDED_BY_SLOW_SQUARES;
    }
    const bool suspected = (way >= 0) && ((t->halves.share * t->set->slow_halves) > CALM);
    const bool beside = is_beside_still(worst, f->n, &s->slow_faults);
    if ((bits == 0U) && (f->n > 2) && !split && !suspected && !beside) {
        bits = isolate_one(worst, f->n, t);
    }
    if ((bits == 0U) && (s->pattern == RIG_PATTERN_NORMAL) && (larger(t->share[worst], t->halves.share) < CALM)) {
        learn(m, moved, (t->fast_step * sigma) + allowed, s->reference_usable, f, t);
    }
    return bits;
}
