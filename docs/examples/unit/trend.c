/* The trend of the two voting ranks: section 6 and table 1, figure 7. */
#include "monitor.h"

/* What the last `frames` changes of the two ranks show; nothing of fewer, or where one rank is frozen and the other
 * moves: a frozen one does not fall. */
static enum verdict verdict_of(const struct trend *t, int64_t frames)
{
    const unsigned rising = (1U << frames) - 1U;
    const unsigned high = t->high & rising;
    const unsigned low = t->low & rising;
    if ((t->seen < frames) || ((t->still_high >= frames) != (t->still_low >= frames))) {
        return TREND_UNKNOWN;
    }
    if ((high == 0U) && (low == rising)) {
        return TREND_BOTH_FALSE;
    }
    if (high != low) {
        return TREND_UNKNOWN;
    }
    if (high == rising) {
        return TREND_LARGER_TRUE;
    }
    return (high == 0U) ? TREND_SMALLER_TRUE : TREND_UNKNOWN;
}

/* Shift the changes of this frame in; bytes that tumble begin again every trend_frames changes. */
static void shift(const struct frame *f, params *p, bool tumbles, struct trend *t)
{
    const unsigned mask = (1U << p->trend_frames) - 1U;
    if (tumbles && ((t->seen % p->trend_frames) == 0)) {
        t->high = 0U;
        t->low = 0U;
    }
    t->high = ((t->high << 1) | ((f->rise_high > 0.0) ? 1U : 0U)) & mask;
    t->low = ((t->low << 1) | ((f->rise_low > 0.0) ? 1U : 0U)) & mask;
    t->seen++;
    t->still_high = (f->rise_high == 0.0) ? (t->still_high + 1) : 0;
    t->still_low = (f->rise_low == 0.0) ? (t->still_low + 1) : 0;
    if (tumbles && ((t->seen % p->trend_frames) == 0)) {
        t->says = verdict_of(t, p->trend_frames);
    }
}

/* The bytes begin again when the number of samples has changed. */
void trend_update(struct frame *f, params *p, struct signal *s)
{
    struct trend *const t = &s->trend;
    if ((f->n == s->last_n) && (f->n > 0)) {
        f->rise_high = difference(f->high, t->last_high, p);
        f->rise_low = difference(f->low, t->last_low, p);
        shift(f, p, s->rules.trend_tumbles, t);
    } else {
        *t = (struct trend){.says = TREND_UNKNOWN};
    }
    t->last_high = f->high;
    t->last_low = f->low;
}

/* Over trend_frames, or of small changes over one; of bytes that tumble the last whole ones. */
enum verdict trend_says(const struct frame *f, params *p, const struct signal *s)
{
    if (s->rules.trend_tumbles) {
        return s->trend.says;
    }
    const double small = s->rules.trend_small;
    const bool one = (fabs(f->rise_high) <= small) && (fabs(f->rise_low) <= small);
    return verdict_of(&s->trend, one ? 1 : p->trend_frames);
}

/* Both weigh the same unless they moved the same way. */
double trend_weight(double rise_high, double rise_low, double rise_vote)
{
    if (!((rise_high * rise_low) > 0.0)) {
        return 0.5;
    }
    const double off_high = fabs(rise_high - rise_vote);
    const double off_low = fabs(rise_low - rise_vote);
    const double total = off_high + off_low;
    return (total <= 0.0) ? 0.5 : (off_low / total);
}
