/* Persistence: miscompare counters, answers that last, latched failures, readmission by command.
 *
 * Sections 1 and 2; docs/explanation/decisions.md, 'Counts freeze' and 'Giving up'.
 */
#include "monitor.h"

/* ---- Readmission ---- */

void persistence_watch_failed(const struct frame *f, params *p, struct signal *s)
{
    const bool filtered = p->filter_gain > 0.0;
    if (!s->started && (f->n == 0)) { /* no vote until there was a sample */
        return;
    }
    const double *const samples = filtered ? s->smooth : f->samples;
    double vote = f->vote;
    if (filtered) {
        s->smooth_vote = compare_follow(s->smooth_vote, isfinite(vote) ? vote : s->vote, f, p);
        vote = s->smooth_vote;
    }
    if (s->level == p->fitted) {
        return;
    }
    for (int c = 0; c < p->fitted; c++) {
        const double off = difference(samples[c], vote, p);
        const bool there = compare_is_comparable(f, c, p) && !slow_is_stale(c, &s->slow_faults) && !has(f->ranked, c);
        const bool agrees = s->latches.failed[c] && there && (fabs(off) <= p->threshold);
        s->latches.agreed[c] = agrees ? (s->latches.agreed[c] + 1) : 0;
    }
}

void persistence_readmit(struct latches *latches, unsigned commanded, int64_t fitted, int64_t readmit_frames)
{
    for (int c = 0; c < fitted; c++) {
        const bool wanted = has(commanded, c);
        if (wanted && latches->failed[c] && (latches->agreed[c] >= readmit_frames)) {
            latches->failed[c] = false;
            latches->count[c] = 0.0;
            latches->agreed[c] = 0;
        }
    }
}

/* ---- Counts ---- */

/* Whether the counts of comparable samples wait in this frame. */
static bool counts_stand_still(const struct frame *f, params *p, struct signal *s)
{
    if (is_split(s->pattern)) {
        s->split_run++;
        return true;
    }
    if (s->split_run > 0) {
        const bool long_run = s->split_run > p->split_persistence;
        const int64_t wait = long_run ? p->split_persistence : s->split_run;
        s->freeze = (wait > s->freeze) ? wait : s->freeze;
        s->split_run = 0;
    }
    if (s->freeze == 0) {
        return false;
    }
    s->freeze--;
    return f->n != 1; /* what disputes a last channel needs no majority */
}

/* A count after an agreeing frame. */
static double counted_down(double count, const struct rules *r)
{
    const double left = count - r->count_down;
    return ((r->count_down > 0.0) && (left > 0.0)) ? left : 0.0;
}

/* Whether a sample itself is off the vote by more than it may be; asked behind a filter alone. */
static bool is_off(int c, const struct frame *f, params *p)
{
    const double off = difference(f->x[c], f->vote, p);
    return (p->filter_gain <= 0.0) || (f->n <= 1) || (fabs(off) > f->threshold);
}

void persistence_count(const struct frame *f, params *p, struct signal *s)
{
    const bool still = counts_stand_still(f, p, s);
    double *const count = s->latches.count;
    for (int c = 0; c < p->fitted; c++) {
        const bool ranked = has(f->ranked, c);
        if (s->latches.failed[c] || (ranked && still)) {
            continue;
        }
        if (!ranked || (f->alone[c] && is_off(c, f, p))) {
            count[c] += 1.0;
        } else {
            count[c] = f->alone[c] ? larger(0.0, count[c] - 1.0) : counted_down(count[c], &s->rules);
        }
    }
}

/* ---- Latches ---- */

/* How long a new answer to a pattern has stood: the byte of a trend speaks for all frames that it covers and in which
 * no other rule answered. */
static int64_t begun(const struct frame *f, params *p, const struct signal *s)
{
    int64_t covered = p->trend_frames - 1;
    if (f->decided_by != RIG_DECIDED_BY_TREND) {
        return 1;
    }
    covered = ((s->pattern_frames - 1) < covered) ? (s->pattern_frames - 1) : covered;
    covered = (s->split.silent < covered) ? s->split.silent : covered;
    return 1 + covered;
}

/* Whether an answer may be acted on: the pattern has lasted for split_persistence frames, and the same rule has
 * blamed the same channels for half of that.  Counts the frames without an answer, which one that does not stand, or a
 * frame without all samples, leaves as they are. */
static bool has_stood(const struct frame *f, params *p, struct signal *s)
{
    struct split *const split = &s->split;
    if (!is_split(s->pattern)) {
        split->stood = 0;
        split->silent = 0;
        split->unresolved = split->whole ? 0 : split->unresolved;
        return false;
    }
    if (f->together) {
        return false;
    }
    unsigned blames = 0U;
    for (int c = 0; c < p->fitted; c++) {
        blames |= f->blamed[c] ? (1U << c) : 0U;
    }
    const bool same = (f->decided_by == split->rule) && (blames == split->blames) && (s->pattern_frames > 1);
    split->stood = same ? (split->stood + 1) : begun(f, p, s);
    split->rule = f->decided_by;
    split->blames = blames;
    const bool stands = (2 * split->stood) >= p->split_persistence;
    if (f->decided_by == RIG_DECIDED_BY_UNRESOLVED) {
        split->silent++;
        split->unresolved++;
    } else {
        split->silent = 0;
        split->unresolved = stands ? 0 : split->unresolved;
    }
    return (s->pattern_frames >= p->split_persistence) && stands;
}

/* Fail what has persisted. */
static void latch(bool settled, const struct frame *f, params *p, struct signal *s)
{
    int64_t level = 0;
    for (int c = 0; c < p->fitted; c++) {
        if ((s->latches.count[c] >= (double)p->persistence) || (settled && f->blamed[c])) {
            s->latches.failed[c] = true;
        }
        level += s->latches.failed[c] ? 0 : 1;
    }
    if (level != s->level) {
        s->fade_left = p->fade_frames + 1;
        s->level = level;
    }
}

/* Where extremes have settled 1:1:1:1, the two that are left stay under suspicion: section 8, item 1. */
void persistence_settle(struct frame *f, params *p, struct signal *s)
{
    const int64_t level = s->level;
    const bool settled = has_stood(f, p, s);
    const bool given_up = rules_give_up(f, p, s);
    latch(settled, f, p, s);
    if (s->level != level) {
        s->after_extremes = settled && (f->decided_by == RIG_DECIDED_BY_EXTREMES) && (s->level == 2);
    }
    if ((f->slow_by != RIG_DECIDED_BY_NONE) && !given_up) {
        f->decided_by = f->slow_by;
    }
}
