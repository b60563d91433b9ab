/* Splits: 2:2, 1:1, 1:1:1:1 and 1:1:1, each settled by the tie-break rules of its signal.
 *
 * Sections 6 to 8; docs/explanation/decisions.md, 'Splits'.  Who stands on which side is told by
 * what is compared, `by` and the reference beside `y`; the vote is made of the samples.
 */
#include "monitor.h"

#define TIE_BREAKS 5    /* places in the configured order */
#define NO_ANSWER (-1) /* of a rule that cannot tell */
#define LOW_SIDE 1     /* of two halves: that of the smaller samples, */
#define HIGH_SIDE 2    /* and that of the larger */

/* Channels among the ranks from `first` to before `end` whose in-line monitor says `flag`. */
static int saying(const struct frame *f, int first, int end, uint8_t flag)
{
    int count = 0;
    for (int i = first; i < end; i++) {
        count += (f->ilm[f->by[i]] == flag) ? 1 : 0;
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
    const double reference = f->seen_reference;
    const double above = f->y[f->by[f->n / 2]];
    const double below = f->y[f->by[(f->n - 1) / 2]];
    if (isnan(reference)) {
        return NO_ANSWER;
    }
    if (reference >= above) {
        return LOW_SIDE;
    }
    if (reference <= below) {
        return HIGH_SIDE;
    }
    const int high = ((above - reference) > f->reference_threshold) ? HIGH_SIDE : 0;
    const int low = ((reference - below) > f->reference_threshold) ? LOW_SIDE : 0;
    return high + low;
}

/* Section 6: what the trend blames; both halves only of the pair that extremes have left (section 8). */
static int by_trend(const struct frame *f, params *p, const struct signal *s)
{
    const enum verdict says = s->rules.asks_trend ? trend_says(f, p, s) : TREND_UNKNOWN;
    if (says == TREND_BOTH_FALSE) {
        return s->after_extremes ? (LOW_SIDE + HIGH_SIDE) : NO_ANSWER;
    }
    if (says == TREND_LARGER_TRUE) {
        return LOW_SIDE;
    }
    return (says == TREND_SMALLER_TRUE) ? HIGH_SIDE : NO_ANSWER;
}

/* What one rule says of two halves: the sides to be failed, or NO_ANSWER. */
static int ask_sides(int64_t decided_by, const struct frame *f, params *p, const struct signal *s)
{
    if (decided_by == RIG_DECIDED_BY_ILM) {
        return by_ilm(f);
    }
    if (decided_by == RIG_DECIDED_BY_TREND) {
        return by_trend(f, p, s);
    }
    if ((decided_by == RIG_DECIDED_BY_REFERENCE) && s->reference_usable) {
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
        f->blamed[f->by[i]] = (sides == side) || (sides == (LOW_SIDE + HIGH_SIDE));
    }
}

/* Mark all ranked channels but the one or two that an answer keeps. */
static void blame_all_but(int one, int other, struct frame *f)
{
    for (int i = 0; i < f->n; i++) {
        const int c = f->by[i];
        f->blamed[c] = (c != one) && (c != other);
    }
}

/* The plain mean of two values, whose ranks say a <= b but behind a filter. */
static double halfway(double a, double b)
{
    return (a > b) ? mean(b, a, 0.5) : mean(a, b, 0.5);
}

/* The middle of the triplex of the samples at the two voting ranks and the reference. */
static double triplex(const struct frame *f)
{
    const double low = f->x[f->by[(f->n - 1) / 2]];
    const double high = f->x[f->by[f->n / 2]];
    return (low > high) ? clamp(f->reference, high, low) : clamp(f->reference, low, high);
}

/* a + share (b - a), never outside of the two. */
static double between(double a, double b, double share)
{
    return (a > b) ? mean(b, a, 1.0 - share) : mean(a, b, share);
}

/* The vote when `sides` are blamed: the good half's mean, by its changes where weighted (section 4).  Of two samples of
 * which the trend tells the good one, the weighted vote is near that whose change fits. */
static double vote_of_sides(int64_t name, int sides, const struct frame *f, params *p, const struct signal *s)
{
    const int half = f->n / 2;
    const bool trend = name == RIG_DECIDED_BY_TREND;
    if (trend && (sides == (LOW_SIDE + HIGH_SIDE))) {
        return halfway(f->x[f->by[half - 1]], f->x[f->by[half]]);
    }
    if ((p->weighted != 0) && trend && (f->n == 2)) {
        const double share = trend_weight(f->rise_high, f->rise_low, s->rise_vote);
        return mean(f->low, f->high, share); /* the ranks whose changes these are */
    }
    const int good = (sides == LOW_SIDE) ? half : 0;
    const int a = f->by[good];
    const int b = f->by[good + half - 1];
    double share = 0.5;
    if ((p->weighted != 0) && (half == 2)) {
        const double rise_a = difference(f->x[a], s->before[a], p);
        const double rise_b = difference(f->x[b], s->before[b], p);
        share = trend_weight(rise_b, rise_a, s->rise_vote);
    }
    return between(f->x[a], f->x[b], share);
}

/* 2:2 and 1:1, sections 2, 6 and 7: which half is right; whether a rule could tell. */
static bool settle_halves(struct frame *f, params *p, const struct signal *s)
{
    for (int place = 0; place < TIE_BREAKS; place++) {
        const int64_t name = p->tie_break[place];
        const int sides = ask_sides(name, f, p, s);
        if (sides != NO_ANSWER) {
            f->vote = (name == RIG_DECIDED_BY_REFERENCE) ? triplex(f) : vote_of_sides(name, sides, f, p, s);
            f->decided_by = (uint8_t)name;
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
        kept = (f->ilm[f->by[i]] == RIG_ILM_GOOD) ? f->by[i] : kept;
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
        if (fabs(difference(f->y[f->by[i]], f->seen_reference, p)) <= f->reference_threshold) {
            near++;
            kept = f->by[i];
        }
    }
    return (near == 1) ? kept : NO_ANSWER;
}

/* 1:1:1:1 and 1:1:1, section 8: at most one channel is right; whether monitors or reference could tell. */
static bool settle_apart(struct frame *f, params *p, const struct signal *s)
{
    for (int place = 0; place < TIE_BREAKS; place++) {
        const int64_t name = p->tie_break[place];
        int good = NO_ANSWER;
        if (name == RIG_DECIDED_BY_ILM) {
            good = only_good(f);
        } else if ((name == RIG_DECIDED_BY_REFERENCE) && s->reference_usable) {
            good = only_near(f, p);
        } else {
            /* no answer to these patterns */
        }
        if (good != NO_ANSWER) {
            f->vote = f->x[good];
            f->decided_by = (uint8_t)name;
            blame_all_but(good, good, f);
            return true;
        }
    }
    return false;
}

/* Section 8, rules of likelihood if configured: of four the extremes fail, of three all but the middle. */
static bool settle_by_rank(struct frame *f, params *p, const struct signal *s)
{
    const uint8_t rule = (s->pattern == RIG_PATTERN_P1_1_1_1) ? RIG_DECIDED_BY_EXTREMES : RIG_DECIDED_BY_MIDDLE;
    for (int place = 0; place < TIE_BREAKS; place++) {
        if (p->tie_break[place] == rule) {
            const int low = f->by[(f->n - 1) / 2];
            const int high = f->by[f->n / 2];
            f->vote = halfway(f->x[low], f->x[high]);
            f->decided_by = rule;
            blame_all_but(low, high, f);
            return true;
        }
    }
    return false;
}

/* Find the neighbours in rank between which the last vote lies, and the upper one's share in it. */
static void share_out(const struct frame *f, struct signal *s)
{
    struct split *const split = &s->split;
    int place = 0;
    while ((place < (f->n - 2)) && (f->x[f->order[place + 1]] < s->vote)) {
        place++;
    }
    split->held_low = f->order[place];
    split->held_high = f->order[place + 1];
    const double low = f->x[split->held_low];
    const double gap = f->x[split->held_high] - low;
    split->held_share = clamp((gap > 0.0) ? ((s->vote - low) / gap) : 0.5, 0.0, 1.0);
}

/* decisions.md 'The vote while no rule decides': a fixed mean of the channels between which the last vote was.  One that jumps away
 * has no share in it, and two that drift apart have half each, as have the two ranks where that vote was of one side. */
static double hold(const struct frame *f, struct signal *s)
{
    struct split *const split = &s->split;
    if (!s->started) {
        return mean(f->low, f->high, 0.5);
    }
    const double gap = f->x[split->held_high] - f->x[split->held_low];
    if ((split->held_of != f->ranked) || (fabs(gap - split->held_gap) > f->threshold)) {
        split->held_of = f->ranked;
        split->held_low = f->order[(f->n - 1) / 2];
        split->held_high = f->order[f->n / 2];
        split->held_share = 0.5;
        if (split->basis) {
            share_out(f, s);
        }
    }
    split->held_gap = f->x[split->held_high] - f->x[split->held_low];
    return between(f->x[split->held_low], f->x[split->held_high], split->held_share);
}

/* Whether the next frame that no rule decides may begin with this frame's vote; shares that have ended are forgotten. */
void tie_break_keep_basis(const struct frame *f, struct signal *s)
{
    struct split *const split = &s->split;
    const bool majority = split->whole && !is_split(s->pattern);
    split->held_of = majority ? 0U : split->held_of;
    split->basis = majority || (f->decided_by == RIG_DECIDED_BY_UNRESOLVED);
}

/* Ask the tie-break rules in their order, then the rules of rank; hold when no rule settles it. */
void tie_break_settle(struct frame *f, params *p, struct signal *s)
{
    bool answered;
    if ((s->pattern == RIG_PATTERN_P2_2) || (s->pattern == RIG_PATTERN_P1_1)) {
        answered = settle_halves(f, p, s);
    } else {
        answered = settle_apart(f, p, s) || settle_by_rank(f, p, s);
    }
    if (!answered) {
        f->vote = hold(f, s);
        f->decided_by = RIG_DECIDED_BY_UNRESOLVED;
    }
}
