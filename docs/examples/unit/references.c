/* References: their own monitor (section 7), the last channel, the pair that extremes left, two of them against all. */
#include "monitor.h"

int64_t references_in_dispute(const struct rig_config *config, const struct signal signals[RIG_SIGNALS])
{
    int64_t bits = 0;
    for (int i = 0; i < RIG_SIGNALS; i++) {
        const struct signal *const s = &signals[i];
        if (!s->reference_usable || (s->second_run >= config->signal[i].persistence)) {
            bits |= s->rules.tells;
        }
    }
    return bits;
}

/* Whether a reference may be asked, and is there. */
static bool usable(const struct frame *f, const struct signal *s)
{
    return s->reference_usable && !isnan(f->reference);
}

void references_check_last(struct frame *f, params *p, const struct signal *s)
{
    const int c = f->order[0];
    const double apart = fabs(difference(f->x[c], f->reference, p));
    const bool there = usable(f, s);
    const bool bad = f->ilm[c] == RIG_ILM_BAD;
    f->vote = f->x[c];
    if (bad || (there && (apart > (REFERENCE_MARGIN * f->reference_threshold)))) {
        f->alone[c] = true;
        f->decided_by = bad ? RIG_DECIDED_BY_ILM : RIG_DECIDED_BY_REFERENCE;
        if (there) {
            f->vote = f->reference;
        } else if (s->started) {
            f->vote = s->vote;
        } else {
            /* the first frame of all: the sample */
        }
    }
}

/* How far the reference is from the nearer of the two voting ranks. */
static double off_ranks(const struct frame *f, params *p)
{
    const double off_high = fabs(difference(f->high, f->reference, p));
    const double off_low = fabs(difference(f->low, f->reference, p));
    return (off_low < off_high) ? off_low : off_high;
}

/* Fail every channel. */
static void fail_all(params *p, struct signal *s)
{
    for (int c = 0; c < p->fitted; c++) {
        s->latches.failed[c] = true;
    }
}

void references_trust_pair(struct signal *s)
{
    s->after_extremes = false;
    s->cut_frames = 0;
}

void references_readmit(const bool failed[RIG_CHANNELS], struct signal *s)
{
    for (int c = 0; c < RIG_CHANNELS; c++) {
        if (failed[c] && !s->latches.failed[c]) {
            references_trust_pair(s);
        }
    }
}

/* Section 8, item 1: where all four were wrong, the comparison of the two that are left finds them wrong too. */
void references_cut_pair(struct frame *f, params *p, struct signal *s)
{
    if (!s->after_extremes) {
        return;
    }
    const bool agree = (f->n == 2) && (s->pattern == RIG_PATTERN_NORMAL) && usable(f, s);
    const double most = larger(REFERENCE_MARGIN * f->reference_threshold, f->threshold);
    s->cut_frames = (agree && (off_ranks(f, p) > most)) ? (s->cut_frames + 1) : 0;
    if (s->cut_frames >= p->persistence) {
        fail_all(p, s);
        f->decided_by = RIG_DECIDED_BY_REFERENCE;
    }
}

/* Not while a pair is left that is itself under suspicion, nor by channels that all stand still. */
void references_monitor(const struct frame *f, params *p, struct signal *s)
{
    if ((f->n < 2) || is_split(s->pattern) || isnan(f->reference) || s->after_extremes || s->slow_faults.standing) {
        return;
    }
    const bool agrees = off_ranks(f, p) <= f->reference_threshold;
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
    return fabs(difference(f->vote, reference, p)) > larger(margin, f->threshold);
}

/* decisions.md 'All channels are wrong': all in use agree, both references contradict them.  None begins
 * to while a signal is in dispute that both may know from one source. */
static bool contradicted(const struct frame *f, params *p, const struct signal *s)
{
    if ((f->n < 2) || (f->n != s->level) || (s->pattern != RIG_PATTERN_NORMAL)) {
        return false;
    }
    if ((s->in_dispute && (s->common_run == 0)) || s->latches.failed[f->order[0]]) { /* a pair that was just cut */
        return false;
    }
    const double apart = fabs(difference(f->reference, f->second, p));
    return off_vote(f->reference, f->reference_threshold, f, p) && off_vote(f->second, p->second_threshold, f, p) &&
           (apart <= (f->reference_threshold + p->second_threshold));
}

/* The signal is lost then, and its reference, which its own monitor may have set aside, usable. */
void references_watch_common(struct frame *f, params *p, struct signal *s)
{
    if (s->rules.tells != 0) {
        const bool far = (f->n >= 2) && off_vote(f->second, p->second_threshold, f, p);
        s->second_run = far ? (s->second_run + 1) : 0;
    }
    s->common_run = contradicted(f, p, s) ? (s->common_run + 1) : 0;
    s->common_mode = s->common_run >= p->common_persistence;
    if (s->common_mode && (p->common_fails != 0)) {
        fail_all(p, s);
        s->reference_usable = true;
        s->reference_run = 0;
        f->decided_by = RIG_DECIDED_BY_COMMON;
    }
}
