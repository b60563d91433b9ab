/* Two channels that are wrong alike, or one of the last two: halves of the channels against the reference.
 *
 * docs/explanation/decisions.md 'Slow-fault tests'.  D is the difference of two halves: of four channels there are three ways to
 * halve them, of two there is one.  Beside the median a healthy reference moves against D if the first half is wrong, with D if
 * the second is: the slope of one on the other over a second decides.  A constant error of the reference is in its bias.
 */
#include "monitor.h"

#define ALONE 0.35         /* of the largest mean square: what those of other ways are below, if one way is meant */
#define DECIDING 10        /* frames in a row */
#define REFERENCE_FROM 300 /* frames that are learned of a reference before it is asked */
#define LEAST_SLOPE 0.1
#define NO_WAY (-1)

void halves_begin(int n, struct slow_tests *t)
{
    const double noise = ((n == 2) ? 2.0 : 1.0) * t->halves.noise;
    t->halves.run = 0;
    t->halves.share = 0.0;
    t->halves.shaken = 0.0;
    for (int w = 0; w < WAYS; w++) {
        t->halves.mean[w] = 0.0;
        t->halves.product[w] = 0.0;
        t->halves.energy[w] = noise;
        t->halves.whole[w] = noise;
        t->halves.square[w] = noise;
    }
}

static int no_half(struct slow_tests *t)
{
    t->halves.share = 0.0;
    return NO_WAY;
}

void halves_learn_reference(double most, struct slow_tests *t)
{
    if (isfinite(t->reference_off)) {
        const double share = 1.0 / smaller((double)t->reference_learned + 1.0, TESTS_LEARNING);
        const double bias = t->reference_bias + (share * clamp(t->reference_off, -most, most));
        t->reference_bias = clamp(bias, -most, most);
        t->reference_vote += share * (t->vote_off - t->reference_vote);
        t->reference_rate += share * (t->rate - t->reference_rate);
        t->reference_learned++;
    }
}

double halves_known_noise(int n, const struct slow_tests *t)
{
    if ((n != RIG_CHANNELS) && (t->halves.noise <= 0.0)) {
        const double sheet = t->set->slow_noise * TESTS_LEAST;
        return sheet * sheet;
    }
    return larger(t->halves.noise, t->set->slow_noise * t->set->slow_noise);
}

/* The largest error of a healthy reference without its bias, at a motion unlike that of its bias.  One that remembers the vote follows
 * when a change of level moves it: its bias is known no better than that. */
static double reference_error(const struct slow_tests *t)
{
    const double moved = fabs(t->vote_off - t->reference_vote);
    const double motion = larger(t->motion, fabs(t->rate - t->reference_rate));
    return (t->set->slow_reference + (t->set->slow_reference_frames * motion)) + moved;
}

/* Write D of each way; how many there are.  The first half has the channel with the smallest number. */
static int write_apart(int n, double apart[WAYS], const struct slow_tests *t)
{
    const double *const value = t->value;
    if (n == 2) {
        const int a = t->order[0];
        const int b = t->order[1];
        apart[0] = (a < b) ? (value[a] - value[b]) : (value[b] - value[a]);
        return 1;
    }
    apart[0] = 0.5 * ((value[0] - value[2]) + (value[1] - value[3]));
    apart[1] = 0.5 * ((value[0] - value[1]) + (value[2] - value[3]));
    apart[2] = 0.5 * ((value[0] - value[1]) + (value[3] - value[2]));
    return WAYS;
}

/* What D counts up to: against the reference, in its mean, and its square in the two mean squares. */
struct steps {
    double most;
    double mean;
    double square;
};

/* Move the means of one way. */
static void move_way(int w, double apart, struct steps steps, double allowed, struct slow_tests *t)
{
    struct halves *const h = &t->halves;
    const double gain = h->of_frames;
    const double limited = clamp(apart, -steps.most, steps.most);
    const double d = copysign(larger(fabs(limited) - allowed, 0.0), limited);
    h->whole[w] += (smaller(limited * limited, steps.square) - h->whole[w]) * gain;
    h->mean[w] += (clamp(d, -steps.mean, steps.mean) - h->mean[w]) * (1.0 / TESTS_SLOW);
    h->energy[w] += (smaller(d * d, steps.square) - h->energy[w]) * gain;
    h->square[w] += ((d * d) - h->square[w]) * gain;
    if (isfinite(t->reference_off)) {
        h->product[w] += ((clamp(t->reference_off, -steps.most, steps.most) * d) - h->product[w]) * (1.0 / TESTS_SLOW);
    }
}

int halves_suspect(int n, double allowed, struct slow_tests *t)
{
    struct halves *const h = &t->halves;
    if ((n == 3) || (t->learned == 0)) {
        return no_half(t);
    }
    const bool four = n == RIG_CHANNELS;
    const double healthy = (four ? 1.0 : 2.0) * larger(halves_known_noise(n, t), h->shaken);
    const double sigma = sqrt(healthy);
    const double mean_limit = h->limit * sigma;
    struct steps steps;
    steps.mean = mean_limit * (1.0 / tests_reached(TESTS_SLOW, TESTS_BURST));
    steps.square = healthy * (1.0 + (h->square_limit * (1.0 / tests_reached(TESTS_SLOW, TESTS_BURST))));
    steps.most = larger(steps.mean, 2.8 * reference_error(t));
    double apart[WAYS] = {0.0};
    double first = 0.0;
    double second = 0.0;
    double least = (double)INFINITY;
    int way = 0;
    const int ways = write_apart(n, apart, t);
    h->apart = apart[0];
    for (int w = 0; w < ways; w++) {
        move_way(w, apart[w], steps, (four ? 1.5 : 2.0) * allowed, t);
        least = smaller(least, h->whole[w]);
        if (h->square[w] > first) {
            second = first;
            first = h->square[w];
            way = w;
        } else {
            second = larger(second, h->square[w]);
        }
    }
    if (four) {
        h->shaken = least;
        h->noise += (least - h->noise) * t->of_learned;
    }
    if (t->learned < TESTS_MEANS_FROM) {
        return no_half(t);
    }
    h->share = larger(fabs(h->mean[way]) / mean_limit, (h->energy[way] - healthy) / (healthy * h->square_limit));
    return ((n == 2) || (second < (ALONE * first))) ? way : NO_WAY;
}

/* Which half the slope is against in this frame: -1 the first, 1 the second, 0 none. */
static int against(int way, bool usable, const struct slow_tests *t)
{
    const struct halves *const h = &t->halves;
    if ((way == NO_WAY) || !(h->share > 1.0) || !usable || !(t->set->slow_reference > 0.0)) {
        return 0;
    }
    if ((t->reference_learned <= REFERENCE_FROM) || !isfinite(t->reference_off)) {
        return 0;
    }
    const double near = reference_error(t);
    const double size = sqrt(h->square[way]);
    const double slope = h->product[way] / h->square[way];
    const double steep = fabs(slope);
    if (!(steep > LEAST_SLOPE) || !((size * (steep + 0.5)) >= near) || !(((steep - 0.5) * size) <= near)) {
        return 0;
    }
    return (slope > 0.0) ? 1 : -1;
}

/* The first half of a way, bits. */
static unsigned first_half(int way, int n, const struct slow_tests *t)
{
    if (n == 2) {
        return 1U << ((t->order[0] < t->order[1]) ? t->order[0] : t->order[1]);
    }
    return 1U | (2U << way);
}

unsigned halves_isolate(int way, int n, bool usable, struct slow_tests *t)
{
    const int side = against(way, usable, t);
    const bool goes_on = ((side > 0) && (t->halves.run > 0)) || ((side < 0) && (t->halves.run < 0));
    t->halves.run = goes_on ? (t->halves.run + side) : side;
    if ((t->halves.run < DECIDING) && (t->halves.run > -DECIDING)) {
        return 0U;
    }
    const unsigned first = first_half(way, n, t);
    unsigned whole = 0U;
    for (int i = 0; i < n; i++) {
        whole |= 1U << t->order[i];
    }
    t->by = RIG_DECIDED_BY_SLOW_HALVES;
    return (side < 0) ? first : (whole & ~first);
}
