/* Slow faults: small deviations summed over seconds, samples that repeat.
 *
 * docs/explanation/decisions.md of that name.  The residual of a channel is its sample less the middle of those in use.  Nothing
 * here moves a vote: it changes who is compared, and who is failed.
 */
#include <string.h>

#include "monitor.h"

#define NO_CHANNEL (-1)
#define CALM 0.5 /* of the limit: what most must be below, or the sums cannot tell who is right */

void slow_open(const struct rig_config *config, int signal, struct slow_faults *l)
{
    memset(l, 0, sizeof *l);
    l->set = &config->slow_faults[signal];
    l->last_reference = (double)NAN;
    for (int c = 0; c < RIG_CHANNELS; c++) {
        l->last_sample[c] = (double)NAN;
    }
}

/* ---- Stale samples ---- */

/* Channels in use with a comparable sample, and those of them whose sample is another than its last one. */
struct movement {
    int in_use;
    int moving;
    bool reference; /* what moves beside the only one in use */
};

static struct movement movement(const struct frame *f, double reference, params *p, const struct signal *s)
{
    const struct slow_faults *const l = &s->slow_faults;
    struct movement m = {0, 0, false};
    for (int c = 0; c < p->fitted; c++) {
        if (!s->latches.failed[c] && compare_is_comparable(f, c, p)) {
            m.in_use++;
            m.moving += (f->samples[c] != l->last_sample[c]) ? 1 : 0;
        }
    }
    m.reference = isfinite(reference) && (reference != l->last_reference);
    return m;
}

/* Whether a repeat of channel c counts.  Nothing is told by a sample at the end of the range, nor where most repeat
 * alike: sensors at their stop, or at rest with a coarse quantum, are in order, unless a reference contradicts them.
 * `ends`: the count begins again instead. */
static bool repeat_counts(const struct frame *f, int c, const struct movement *m, params *p, const struct signal *s,
                          bool *ends)
{
    const double x = f->samples[c];
    const double off = fabs(difference(x, f->reference, p));
    const bool told = s->reference_usable && (off > (REFERENCE_MARGIN * f->reference_threshold));
    const int others = m->in_use - (s->latches.failed[c] ? 0 : 1);
    *ends = !told && (p->wraps == 0) && ((x <= p->low) || (x >= p->high));
    const bool most = (others == 0) ? m->reference : ((2 * m->moving) >= others);
    return told || (!*ends && most);
}

void slow_count(const struct frame *f, double reference, params *p, struct signal *s)
{
    struct slow_faults *const l = &s->slow_faults;
    const bool told = l->set->stale_frames > 0;
    if (!told && !tests_run(&s->slow_tests)) {
        return;
    }
    const struct movement m = movement(f, reference, p, s);
    l->last_reference = reference;
    l->stale = 0U;
    l->standing = told && (m.moving == 0);
    for (int c = 0; c < p->fitted; c++) {
        if (compare_is_comparable(f, c, p)) {
            bool ends = f->samples[c] != l->last_sample[c];
            if (!ends && repeat_counts(f, c, &m, p, s, &ends)) {
                l->repeats[c]++;
            }
            l->repeats[c] = ends ? 0 : l->repeats[c];
            l->last_sample[c] = f->samples[c];
            l->stale |= (told && (l->repeats[c] >= l->set->stale_frames)) ? (1U << c) : 0U;
        }
    }
}

bool slow_is_stale(int c, const struct slow_faults *l)
{
    return has(l->stale, c);
}

/* ---- Sums of small deviations ---- */

/* With slow-fault tests the median without biases; else the median, or of an even number the usable reference between the two in
 * the middle, else the mean of those. */
static double middle(const struct frame *f, struct signal *s)
{
    if (tests_run(&s->slow_tests)) {
        return tests_middle(f, &s->slow_tests);
    }
    if (((f->n % 2) == 0) && s->reference_usable && !isnan(f->reference)) {
        return clamp(f->reference, f->low, f->high);
    }
    return mean(f->low, f->high, 0.5);
}

/* The next sum: what exceeds the allowance, `most` of it; what is no number begins it again. */
static double sum(double last, double excess, double most)
{
    const double step = (most < excess) ? most : excess;
    const double next = last + step;
    return (isfinite(step) && (next > 0.0)) ? next : 0.0;
}

/* Sum both ways of each channel; the channel with the largest sum above the limit, while most are calm. */
static int watch(const struct frame *f, params *p, struct signal *s)
{
    struct slow_faults *const l = &s->slow_faults;
    const double limit = l->set->slow_limit;
    if ((limit <= 0.0) || (f->n < 3) || is_split(s->pattern)) {
        return NO_CHANNEL;
    }
    const double m = middle(f, s);
    if (tests_is_cut(m, p, &s->slow_tests)) {
        return NO_CHANNEL;
    }
    const double most = limit / ((double)p->persistence - 0.5);
    double largest = limit;
    int worst = NO_CHANNEL;
    int calm = 0;
    for (int i = 0; i < f->n; i++) {
        const int c = f->order[i];
        const double residual = (f->x[c] - s->slow_tests.bias[c]) - m;
        l->above[c] = sum(l->above[c], residual - l->set->slow_allowance, most);
        l->below[c] = sum(l->below[c], -residual - l->set->slow_allowance, most);
        const double reached = (l->below[c] > l->above[c]) ? l->below[c] : l->above[c];
        calm += (reached < (CALM * limit)) ? 1 : 0;
        if (reached > largest) {
            worst = c;
            largest = reached;
        }
    }
    return ((2 * calm) > f->n) ? worst : NO_CHANNEL;
}

void slow_watch(struct frame *f, params *p, struct signal *s)
{
    if (f->decided_by == RIG_DECIDED_BY_COMMON) {
        return;
    }
    const int slow = watch(f, p, s);
    const unsigned tested = tests_watch(f, p, s);
    if (slow != NO_CHANNEL) {
        s->latches.failed[slow] = true;
        f->slow_by = RIG_DECIDED_BY_SLOW;
    }
    for (int c = 0; (c < p->fitted) && (tested != 0U); c++) {
        s->latches.failed[c] = s->latches.failed[c] || has(tested, c);
        f->slow_by = s->slow_tests.by;
    }
}

void slow_begin_sums(struct slow_faults *l)
{
    memset(l->above, 0, sizeof l->above);
    memset(l->below, 0, sizeof l->below);
}
