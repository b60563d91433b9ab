/* Which of the last two channels is the noisy one: the one whose second differences are rougher than its noise.
 *
 * docs/explanation/decisions.md 'Slow-fault tests'.  Noise and fast oscillation of a channel are in its own second differences.  The
 * motion of the aircraft is in both, and it is smooth: it is hardly there.  The product of the second differences of D, first
 * channel less second, and of their middle is half of what the first is rougher by than the second.  No reference is needed.
 */
#include "monitor.h"

#define KEPT 10000.0 /* frames of the memory of the roughest motion */
#define WHITE 6.0    /* variance of a second difference of white noise of variance 1 */
#define PRODUCT 0.6  /* six standard deviations of a mean of products, over that variance, */
#define OWN 0.85     /* and of a mean of squares */
#define MIDDLE 0.3   /* variance of the median of four channels */
#define LIMITED 5.0  /* of the least limit: the 15 second differences of a burst of 13 frames reach 0.7 of it */
#define SURE 2.0     /* of the roughest motion: a product beyond is no motion that one of two channels misses */

void noise_begin(struct noise *s)
{
    s->turns = 0;
    s->turned = 0;
    s->shared = 0.0;
    s->rough = 0.0;
    s->rougher = 0.0;
}

/* Which of two channels is noisy, by the means of this frame. */
static unsigned noisy(double usual, double least, double common, const struct slow_tests *t)
{
    const struct noise *const s = &t->second;
    const double by = fabs(s->rougher);
    const double own = (0.5 * s->rough) + by;
    const double other = (0.5 * s->rough) - by;
    const double product = PRODUCT * t->set->slow_halves;
    const double limit = larger(larger(least, other), product * sqrt((s->rough * common) + (usual * usual)));
    if ((s->turned < TESTS_MEANS_FROM) || (t->learned < TESTS_SQUARES_FROM) || (by <= limit)) {
        return 0U;
    }
    const double sheet = t->set->slow_noise * TESTS_LEAST;
    if (own <= (larger(usual, WHITE * (sheet * sheet)) * (1.0 + (OWN * t->set->slow_halves)))) {
        return 0U;
    }
    const int a = t->order[0];
    const int b = t->order[1];
    return 1U << (((a < b) == (s->rougher > 0.0)) ? a : b);
}

unsigned noise_isolate(int n, struct slow_tests *t)
{
    struct noise *const s = &t->second;
    if (t->learned == 0) {
        return 0U;
    }
    const double turn = s->change - s->last_change;
    const double moved = (n == 2) ? (t->halves.apart - s->last_apart) : 0.0;
    const double apart = moved - s->last_moved;
    s->last_change = s->change;
    s->last_apart = t->halves.apart;
    s->last_moved = moved;
    s->turns++;
    if (s->turns <= 3) { /* a second difference needs three frames, and the way out of a split is none */
        return 0U;
    }
    s->turned++;
    const double usual = WHITE * halves_known_noise(n, t);
    s->shared += (((turn * turn) - ((0.25 * apart) * apart)) - s->shared) * (1.0 / TESTS_SLOW);
    const double common = larger(s->shared - (MIDDLE * usual), 0.0);
    s->roughest = larger(s->roughest * (1.0 - (1.0 / KEPT)), common);
    if (n > 2) {
        return 0U;
    }
    const double least = larger((PRODUCT * t->set->slow_halves) * usual, SURE * s->roughest);
    const double step = LIMITED * least;
    s->rough += (smaller(apart * apart, 2.0 * step) - s->rough) * (1.0 / TESTS_SLOW);
    s->rougher += (clamp(apart * turn, -step, step) - s->rougher) * (1.0 / TESTS_SLOW);
    return noisy(usual, least, common, t);
}
