/* Cross-channel comparison: which samples count, how they are ranked, which pattern they make, and their median. */
#include <string.h>

#include "monitor.h"

#define SEA_LEVEL_DENSITY 1.225 /* kg/m3; International Standard Atmosphere */

/* ---- Which samples are compared, and their ranks: sections 2 and 3 ---- */

bool compare_is_comparable(const struct frame *f, int c, params *p)
{
    return (f->valid[c] != 0) && (p->low <= f->samples[c]) && (f->samples[c] <= p->high);
}

/* How far the comparable samples of an angle are apart as seen from base, rad; 0 for other signals. */
static double seen_across(double base, const struct frame *f, params *p)
{
    double low = 0.0;
    double high = 0.0;
    for (int c = 0; c < p->fitted; c++) {
        if ((p->wraps != 0) && compare_is_comparable(f, c, p)) {
            const double off = difference(f->samples[c], base, p);
            low = smaller(low, off);
            high = larger(high, off);
        }
    }
    return high - low;
}

/* What an angle is taken near to: the last vote; at first the first comparable sample, unless another sees all of them closer
 * together: where they are around the circle, no two that agree are cut apart. */
static double anchor(const struct frame *f, params *p, const struct signal *s)
{
    if (s->started) {
        return s->vote;
    }
    double base = 0.0;
    double least = (double)INFINITY;
    for (int c = 0; c < p->fitted; c++) {
        if (compare_is_comparable(f, c, p)) {
            const double across = seen_across(f->samples[c], f, p);
            if (isinf(least) || (across < (least - p->threshold))) {
                base = f->samples[c];
                least = across;
            }
        }
    }
    return base;
}

/* A value within half a turn of the frame's base if the signal is an angle. */
static double near_base(double x, const struct frame *f, params *p)
{
    return (p->wraps != 0) ? (f->base + difference(x, f->base, p)) : x;
}

/* A reference as the sensors could read it, an angle near the frame's base: sensors at their stop do not contradict what
 * is beyond it.  NaN when it is not finite. */
static double seen(double reference, const struct frame *f, params *p)
{
    if (!isfinite(reference)) {
        return (double)NAN;
    }
    return (p->wraps != 0) ? near_base(reference, f, p) : clamp(reference, p->low, p->high);
}

/* Swap places i < j of the order when they are out of order. */
static void exchange(const double *x, int *order, int i, int j)
{
    const int a = order[i];
    const int b = order[j];
    if (x[a] > x[b]) {
        order[i] = b;
        order[j] = a;
    }
}

/* Five exchanges for four, three for three. */
void compare_sort(const double *x, int *order, int n)
{
    if (n == 4) {
        exchange(x, order, 0, 1);
        exchange(x, order, 2, 3);
        exchange(x, order, 0, 2);
        exchange(x, order, 1, 3);
        exchange(x, order, 1, 2);
    } else if (n >= 2) {
        exchange(x, order, 0, 1);
        if (n == 3) {
            exchange(x, order, 1, 2);
            exchange(x, order, 0, 1);
        }
    } else {
        /* nothing to sort */
    }
}

/* Put n channels into ascending order of y; equals stay as they were. */
static void sort_again(const double *y, int *order, int n)
{
    for (int end = n - 1; end > 0; end--) {
        for (int i = 0; i < end; i++) {
            exchange(y, order, i, i + 1);
        }
    }
}

/* Section 2: gather the comparable samples of channels in use that do not repeat for too long, rank them, find the two
 * voting ranks. */
static void rank(struct frame *f, params *p, struct signal *s)
{
    int in_use = 0;
    for (int c = 0; c < p->fitted; c++) {
        in_use += s->latches.failed[c] ? 0 : 1;
        if (!s->latches.failed[c] && !slow_is_stale(c, &s->slow_faults) && compare_is_comparable(f, c, p)) {
            f->x[c] = near_base(f->samples[c], f, p);
            f->order[f->n] = c;
            f->n++;
            f->ranked |= 1U << c;
        }
    }
    s->split.whole = f->n == in_use;
    compare_sort(f->x, f->order, f->n);
    if (f->n > 0) {
        f->low = f->x[f->order[(f->n - 1) / 2]];
        f->high = f->x[f->order[f->n / 2]];
    }
}

double compare_follow(double last, double x, const struct frame *f, params *p)
{
    if (isnan(last)) {
        return x;
    }
    const double limit = p->threshold / ((double)p->persistence - 0.5);
    double step = p->filter_gain * difference(x, last, p);
    if (isfinite(step) && fabs(step) > limit) {
        step = copysign(limit, step);
    }
    const double y = near_base(last + step, f, p);
    return isfinite(y) ? y : x;
}

/* Where a low-pass begins: at the smoothed vote, at first between the two ranks; NaN where there is neither. */
static double begins_at(const struct frame *f, const struct signal *s)
{
    if (isfinite(s->smooth_vote) || (f->n == 0)) {
        return s->smooth_vote;
    }
    return mean(f->low, f->high, 0.5);
}

/* What is compared: samples and reference, or where there is a filter what it makes of them. */
static void look(struct frame *f, params *p, struct signal *s)
{
    memcpy(f->y, f->x, sizeof f->y);
    memcpy(f->by, f->order, sizeof f->by);
    f->seen_reference = f->reference;
    if (p->filter_gain > 0.0) {
        const double start = begins_at(f, s);
        for (int c = 0; c < p->fitted; c++) {
            const bool there = compare_is_comparable(f, c, p) && !slow_is_stale(c, &s->slow_faults);
            const double last = isnan(s->smooth[c]) ? start : s->smooth[c];
            s->smooth[c] = there ? compare_follow(last, near_base(f->samples[c], f, p), f, p) : (double)NAN;
        }
        const double last = isnan(s->smooth_reference) ? start : s->smooth_reference;
        s->smooth_reference = compare_follow(last, f->reference, f, p);
        f->seen_reference = s->smooth_reference;
        memcpy(f->y, s->smooth, sizeof f->y);
        sort_again(f->y, f->by, f->n);
    }
}

/* Within what two of n samples agree. */
static double threshold(int n, params *p)
{
    if (n == RIG_CHANNELS) {
        return p->threshold;
    }
    return (n == 3) ? p->threshold_triplex : p->threshold_duplex;
}

/* decisions.md 'References': of a dynamic pressure that is made from the speed over ground, the wind is the error. */
static double reference_threshold(double reference, params *p)
{
    if ((p->reference_airspeed_m_s > 0.0) && (reference > 0.0)) {
        const double of_wind = p->reference_airspeed_m_s * sqrt(2.0 * SEA_LEVEL_DENSITY * reference);
        return (p->reference_threshold < of_wind) ? p->reference_threshold : of_wind;
    }
    return p->reference_threshold;
}

struct frame compare_samples(const struct rig_input *input, int signal, params *p, struct signal *s)
{
    struct frame f = {.samples = input->channels[signal], .valid = input->valid[signal], .ilm = input->ilm[signal]};
    f.base = anchor(&f, p, s);
    f.reference = seen(input->reference[signal], &f, p);
    f.second = seen(input->second_reference[signal], &f, p);
    f.reference_threshold = reference_threshold(f.reference, p);
    slow_count(&f, input->reference[signal], p, s);
    rank(&f, p, s);
    look(&f, p, s);
    f.threshold = threshold(f.n, p);
    return f;
}

/* ---- Which pattern they make: sections 2 and 3 ---- */

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

/* Neighbours in rank decide: across a gap all pairs disagree. */
static uint8_t classify(struct frame *f)
{
    bool apart[RIG_CHANNELS + 1] = {true, true, true, true, true}; /* apart[i]: ranks i - 1 and i */
    int count = 0;
    for (int i = 1; i < f->n; i++) {
        apart[i] = !((f->y[f->by[i]] - f->y[f->by[i - 1]]) <= f->threshold);
        count += apart[i] ? 1 : 0;
    }
    for (int i = 0; (i < f->n) && (count > 0); i++) {
        f->alone[f->by[i]] = apart[i] && apart[i + 1];
    }
    return pattern_of(f->n, count, apart[2]);
}

/* Whether a split that the filter still shows has closed: its samples in the middle agree again. */
static bool come_together(const struct frame *f, params *p)
{
    const double low = f->x[f->by[(f->n - 1) / 2]];
    if (f->n == 3) {
        const double below = fabs(difference(f->x[f->by[0]], low, p));
        const double above = fabs(difference(f->x[f->by[2]], low, p));
        return (below <= f->threshold) || (above <= f->threshold);
    }
    return fabs(difference(f->x[f->by[f->n / 2]], low, p)) <= f->threshold;
}

void compare_pattern(struct frame *f, params *p, struct signal *s)
{
    const uint8_t pattern = classify(f);
    f->together = is_split(pattern) && (p->filter_gain > 0.0) && come_together(f, p);
    if (pattern != s->pattern) {
        s->pattern_frames = 1;
    } else if (!f->together) {
        s->pattern_frames++;
    } else {
        /* it does not go on */
    }
    s->pattern = pattern;
}

/* ---- The vote with a majority: sections 4 and 5 ---- */

/* Section 5: the middle value, the mean of two, and never a suspect where the other rank is none. */
double compare_median(const struct frame *f, params *p, const struct signal *s)
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
    return mean(f->low, f->high, (p->weighted != 0) ? trend_weight(f->rise_high, f->rise_low, s->rise_vote) : 0.5);
}
