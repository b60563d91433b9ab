/* The cross-channel monitor of the rig as a unit under test: the same decisions and the same bits as the rig's own.
 *
 * One pass a signal and frame: compare the samples, vote, count, latch.  monitor.h says what the comments refer to.
 */
#include <string.h>

#include "monitor.h"

static struct rig_config config;
static struct signal signals[RIG_SIGNALS];
static uint64_t stepped;

/* Sections 5 to 8: this frame's vote and who decided; a lost signal holds its last vote. */
static void decide(struct frame *f, params *p, struct signal *s)
{
    f->decided_by = RIG_DECIDED_BY_NONE;
    if (f->n == 0) {
        f->vote = s->vote;
    } else if (is_split(s->pattern)) {
        tie_break_settle(f, p, s);
    } else if (f->n == 1) {
        references_check_last(f, p, s);
    } else {
        f->vote = compare_median(f, p, s);
    }
}

/* ---- What goes out ---- */

/* A vote within the sensor's range: an angle goes round the circle, anything else saturates. */
static double limit(double x, params *p)
{
    return (p->wraps != 0) ? (modulo_turn(x - p->low) + p->low) : clamp(x, p->low, p->high);
}

/* The vote within the range and its fade after a change of level; after an overflow the last vote holds.  Until the first frame with
 * a sample there is none to hold, and what is stored, 0, is taken for none. */
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
    s->started = s->started || (f->n > 0);
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
    return (f->alone[c] || f->blamed[c] || (s->latches.count[c] > 0.0)) ? RIG_STATE_SUSPECT : RIG_STATE_OK;
}

/* One signal's answer. */
static void report(const struct frame *f, int i, double reference, struct rig_output *output)
{
    const struct signal *const s = &signals[i];
    output->voted[i] = s->output;
    output->level[i] = (uint8_t)s->level;
    output->pattern[i] = s->pattern;
    output->decided_by[i] = f->decided_by;
    output->reference_usable[i] = (s->reference_usable && isfinite(reference)) ? 1 : 0;
    output->common_mode[i] = s->common_mode ? 1 : 0;
    output->trend_high[i] = (uint8_t)s->trend.high;
    output->trend_low[i] = (uint8_t)s->trend.low;
    for (int c = 0; c < RIG_CHANNELS; c++) {
        output->state[i][c] = channel_state(f, c, &config.signal[i], s);
    }
}

/* ---- One signal, one frame ---- */

/* Keep what the next frame compares its samples with. */
static void remember(const struct frame *f, params *p, struct signal *s)
{
    s->last_n = f->n;
    for (int c = 0; c < p->fitted; c++) {
        const bool there = compare_is_comparable(f, c, p) && !slow_is_stale(c, &s->slow_faults);
        s->before[c] = there ? f->samples[c] : (double)NAN;
    }
}

/* Sections 2 to 8, in the order of the table in docs/explanation/decisions.md. */
static void monitor_signal(const struct rig_input *input, int i, struct rig_output *output)
{
    params *const p = &config.signal[i];
    struct signal *const s = &signals[i];
    const struct latches before = s->latches;
    persistence_readmit(&s->latches, input->reset[i], p->fitted, p->readmit_frames);
    tests_readmit(before.failed, s);
    references_readmit(before.failed, s);
    struct frame f = compare_samples(input, i, p, s);
    compare_pattern(&f, p, s);
    trend_update(&f, p, s);
    decide(&f, p, s);
    tie_break_keep_basis(&f, s);
    references_cut_pair(&f, p, s);
    references_monitor(&f, p, s);
    references_watch_common(&f, p, s);
    persistence_watch_failed(&f, p, s);
    s->accused = boxes_accuse(&f, p, s);
    persistence_count(&f, p, s);
    const int64_t level = s->level;
    slow_watch(&f, p, s);
    persistence_settle(&f, p, s);
    if (s->level != level) {
        slow_begin_sums(&s->slow_faults);
    }
    publish(&f, p, s);
    remember(&f, p, s);
    report(&f, i, input->reference[i], output);
}

/* ---- The interface ---- */

/* Whether every number that bounds a loop or a shift is within its range, and every sensor's range is one. */
static bool usable(const struct rig_config *wanted)
{
    bool good = (wanted->layout == RIG_UNIT_LAYOUT) && rules_usable(wanted);
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
    stepped = 0U;
    for (int i = 0; i < RIG_SIGNALS; i++) {
        for (int c = 0; c < RIG_CHANNELS; c++) {
            signals[i].smooth[c] = (double)NAN;
            signals[i].before[c] = (double)NAN;
        }
        rules_open(&config, i, &signals[i].rules);
        slow_open(&config, i, &signals[i].slow_faults);
        tests_open(&config, i, &signals[i].slow_tests);
        signals[i].smooth_reference = (double)NAN;
        signals[i].smooth_vote = (double)NAN;
        signals[i].reference_usable = true;
        signals[i].level = config.signal[i].fitted;
    }
    boxes_open(&config, signals);
    discretes_open(config.discrete);
    return 0;
}

int rig_unit_step(const struct rig_input *input, struct rig_output *output)
{
    const int64_t in_dispute = references_in_dispute(&config, signals);
    for (int i = 0; i < RIG_SIGNALS; i++) {
        signals[i].in_dispute = (in_dispute & signals[i].rules.sources) != 0;
        monitor_signal(input, i, output);
    }
    boxes_watch(&config, signals, output);
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
