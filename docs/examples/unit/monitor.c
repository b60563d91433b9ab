/* The cross-channel monitor of the rig as a unit under test: the same decisions and the same bits as the rig's own.
 *
 * One pass a signal and frame: compare the samples, vote, count, latch.  monitor.h says what the comments refer to.
 */
#include <string.h>

#include "monitor.h"

#define REFERENCE_MARGIN 1.5 /* reference thresholds that it takes to dispute a last channel or a vote */

static struct rig_config config;
static struct signal signals[RIG_SIGNALS];
static unsigned accused[RIG_SIGNALS]; /* channels that the frame's evidence speaks against, bits */
static int64_t box_count[RIG_CHANNELS];
static uint64_t stepped;

/* ---- The last channel and this frame's vote ---- */

/* redundancy.md 'The last channel': its monitor or its reference disputes it; reference or last vote instead. */
static void check_last(struct frame *f, params *p, const struct signal *s)
{
    const int c = f->order[0];
    const double apart = fabs(difference(f->x[c], f->reference, p));
    const bool usable = s->reference_usable && !isnan(f->reference);
    const bool bad = f->ilm[c] == RIG_ILM_BAD;
    f->vote = f->x[c];
    if (bad || (usable && (apart > (REFERENCE_MARGIN * f->reference_threshold)))) {
        f->alone[c] = true;
        f->resolver = bad ? RIG_RESOLVER_ILM : RIG_RESOLVER_REFERENCE;
        if (usable) {
            f->vote = f->reference;
        } else if (s->started) {
            f->vote = s->vote;
        } else {
            /* the first frame of all: the sample */
        }
    }
}

/* Sections 5 to 8: this frame's vote and who decided; a lost signal holds its last vote. */
static void decide(struct frame *f, params *p, const struct signal *s)
{
    f->resolver = RIG_RESOLVER_NONE;
    if (f->n == 0) {
        f->vote = s->vote;
    } else if (is_singular(s->pattern)) {
        resolvers_settle(f, p, s);
    } else if (f->n == 1) {
        check_last(f, p, s);
    } else {
        f->vote = compare_median(f, p, s);
    }
}

/* ---- References: section 7 ---- */

/* A reference that left a vote with a majority for `persistence` frames is unusable until it agreed as long. */
static void monitor_reference(const struct frame *f, params *p, struct signal *s)
{
    if ((f->n < 2) || is_singular(s->pattern) || isnan(f->reference)) {
        return;
    }
    const bool agrees = fabs(difference(f->vote, f->reference, p)) <= f->reference_threshold;
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
    return fabs(difference(f->vote, reference, p)) > ((f->threshold > margin) ? f->threshold : margin);
}

/* redundancy.md 'Two references against all channels': all in use agree, both references contradict them. */
static bool contradicted(const struct frame *f, params *p, const struct signal *s)
{
    if ((f->n < 2) || (f->n != s->level) || (s->pattern != RIG_PATTERN_NORMAL)) {
        return false;
    }
    const double apart = fabs(difference(f->reference, f->second, p));
    return off_vote(f->reference, f->reference_threshold, f, p) && off_vote(f->second, p->second_threshold, f, p) &&
           (apart <= (f->reference_threshold + p->second_threshold));
}

/* The same, for `common_persistence` frames: report it and, by choice, fail every channel and trust the reference. */
static void watch_common(struct frame *f, params *p, struct signal *s)
{
    s->common_run = contradicted(f, p, s) ? (s->common_run + 1) : 0;
    s->common_mode = s->common_run >= p->common_persistence;
    if (s->common_mode && (p->common_fails != 0)) {
        for (int c = 0; c < p->fitted; c++) {
            s->latches.failed[c] = true;
        }
        s->reference_usable = true;
        s->reference_run = 0;
        f->resolver = RIG_RESOLVER_COMMON;
    }
}

/* ---- Counts, latches, readmission: sections 1 and 2 ---- */

/* Count how long each failed channel has agreed with the vote again, for a readmission by command. */
static void watch_failed(const struct frame *f, params *p, struct signal *s)
{
    const bool filtered = p->filter_gain > 0.0;
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
        const double off = difference(samples[c], vote, p) - s->lasting.bias[c];
        const bool near = (fabs(off) <= p->threshold) && !lasting_is_stale(c, &s->lasting);
        const bool agrees = s->latches.failed[c] && (f->valid[c] != 0) && near;
        s->latches.agreed[c] = agrees ? (s->latches.agreed[c] + 1) : 0;
    }
}

void monitor_readmit(struct latches *latches, unsigned commanded, int64_t fitted, int64_t readmit_frames)
{
    for (int c = 0; c < fitted; c++) {
        const bool wanted = ((commanded >> c) & 1U) != 0U;
        if (wanted && latches->failed[c] && (latches->agreed[c] >= readmit_frames)) {
            latches->failed[c] = false;
            latches->count[c] = 0;
            latches->agreed[c] = 0;
        }
    }
}

/* redundancy.md 'After a pattern without a majority': whether the counts of comparable samples wait in this frame. */
static bool counts_stand_still(const struct frame *f, params *p, struct signal *s)
{
    if (is_singular(s->pattern)) {
        s->singular_run++;
        return true;
    }
    if (s->singular_run > 0) {
        const bool long_run = s->singular_run > p->singular_persistence;
        const int64_t wait = long_run ? p->singular_persistence : s->singular_run;
        s->freeze = (wait > s->freeze) ? wait : s->freeze;
        s->singular_run = 0;
    }
    if (s->freeze == 0) {
        return false;
    }
    s->freeze--;
    return f->n != 1; /* what disputes a last channel needs no majority */
}

/* Section 2: frames in a row that each channel miscompared; a sample that is not comparable counts always. */
static void count_miscompares(const struct frame *f, params *p, struct signal *s)
{
    const bool still = counts_stand_still(f, p, s);
    int64_t *const count = s->latches.count;
    for (int c = 0; c < p->fitted; c++) {
        const bool ranked = ((f->ranked >> c) & 1U) != 0U;
        if (s->latches.failed[c] || (ranked && still)) {
            continue;
        }
        count[c] = (!ranked || f->alone[c]) ? (count[c] + 1) : 0;
    }
}

/* Sections 1 and 2: fail what has persisted, of single miscompares and of a settled pattern without a majority. */
static void latch(const struct frame *f, params *p, struct signal *s)
{
    const bool settled = s->pattern_frames >= p->singular_persistence;
    int64_t level = 0;
    for (int c = 0; c < p->fitted; c++) {
        if ((s->latches.count[c] >= p->persistence) || (settled && f->blamed[c])) {
            s->latches.failed[c] = true;
        }
        level += s->latches.failed[c] ? 0 : 1;
    }
    if (level != s->level) {
        s->fade_left = p->fade_frames + 1;
        s->level = level;
    }
}

/* ---- A box that dies: redundancy.md of that name ---- */

/* Whom this frame's evidence of one signal accuses; trend, extremes and middle are none. */
static unsigned accuse(const struct frame *f, params *p, const struct signal *s)
{
    const bool evidence = (f->resolver == RIG_RESOLVER_ILM) || (f->resolver == RIG_RESOLVER_REFERENCE);
    const bool singular = is_singular(s->pattern);
    unsigned bits = 0U;
    for (int c = 0; c < p->fitted; c++) {
        const bool ranked = ((f->ranked >> c) & 1U) != 0U;
        const bool against = singular ? (evidence && f->blamed[c]) : f->alone[c];
        if (!s->latches.failed[c] && (!ranked || against)) {
            bits |= 1U << c;
        }
    }
    return bits;
}

/* Count the frames in a row in which channel c is accused on enough signals; whether it is in use or accused. */
static bool watch_box(int c)
{
    int64_t against = 0;
    bool in_use = false;
    for (int i = 0; i < RIG_SIGNALS; i++) {
        against += ((accused[i] >> c) & 1U) != 0U ? 1 : 0;
        in_use = in_use || ((c < config.signal[i].fitted) && !signals[i].latches.failed[c]);
    }
    box_count[c] = (against >= config.box_signals) ? (box_count[c] + 1) : 0;
    return in_use || (against > 0);
}

/* Fail the condemned channels, bits, on one signal that has been voted: the fade begins in the next frame. */
static void fail_all(unsigned condemned, int i, struct rig_output *output)
{
    struct signal *const s = &signals[i];
    for (int c = 0; c < config.signal[i].fitted; c++) {
        if ((((condemned >> c) & 1U) != 0U) && !s->latches.failed[c]) {
            s->latches.failed[c] = true;
            s->level--;
            s->fade_left = config.signal[i].fade_frames;
            lasting_begin_sums(&s->lasting);
            output->state[i][c] = RIG_STATE_FAILED;
            output->level[i] = (uint8_t)s->level;
            output->resolver[i] = RIG_RESOLVER_BOX;
        }
    }
}

/* Fail on all their signals the channels accused long enough on enough signals, unless they are the majority. */
static void fail_boxes(struct rig_output *output)
{
    unsigned condemned = 0U;
    int candidates = 0;
    int boxes = 0;
    for (int c = 0; c < RIG_CHANNELS; c++) {
        boxes += watch_box(c) ? 1 : 0;
        if (box_count[c] >= config.box_persistence) {
            condemned |= 1U << c;
            candidates++;
        }
    }
    if ((2 * candidates) <= boxes) {
        for (int i = 0; i < RIG_SIGNALS; i++) {
            fail_all(condemned, i, output);
        }
    }
}

/* Boxes are watched only in frames in which enough signals accuse anybody. */
static void watch_boxes(struct rig_output *output)
{
    int64_t accusing = 0;
    for (int i = 0; i < RIG_SIGNALS; i++) {
        accusing += (accused[i] != 0U) ? 1 : 0;
    }
    if ((config.box_signals > 0) && (accusing >= config.box_signals)) {
        fail_boxes(output);
    } else {
        memset(box_count, 0, sizeof box_count);
    }
}

/* ---- What goes out ---- */

/* A vote within the sensor's range: an angle goes round the circle, anything else saturates. */
static double limit(double x, params *p)
{
    return (p->wraps != 0) ? (modulo_turn(x - p->low) + p->low) : clamp(x, p->low, p->high);
}

/* The vote within the range and its fade after a change of level; after an overflow the last vote holds. */
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
    s->started = true;
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
    return (f->alone[c] || f->blamed[c] || (s->latches.count[c] != 0)) ? RIG_STATE_SUSPECT : RIG_STATE_OK;
}

/* One signal's answer. */
static void report(const struct frame *f, int i, double reference, struct rig_output *output)
{
    const struct signal *const s = &signals[i];
    output->voted[i] = s->output;
    output->level[i] = (uint8_t)s->level;
    output->pattern[i] = s->pattern;
    output->resolver[i] = f->resolver;
    output->reference_usable[i] = (s->reference_usable && isfinite(reference)) ? 1 : 0;
    output->common_mode[i] = s->common_mode ? 1 : 0;
    output->trend_high[i] = (uint8_t)s->trend_high;
    output->trend_low[i] = (uint8_t)s->trend_low;
    for (int c = 0; c < RIG_CHANNELS; c++) {
        output->state[i][c] = channel_state(f, c, &config.signal[i], s);
    }
}

/* ---- One signal, one frame ---- */

/* Sections 2 to 8, in the order of the table in docs/redundancy.md. */
static void monitor_signal(const struct rig_input *input, int i, struct rig_output *output)
{
    params *const p = &config.signal[i];
    struct signal *const s = &signals[i];
    const struct latches before = s->latches;
    monitor_readmit(&s->latches, input->reset[i], p->fitted, p->readmit_frames);
    lasting_readmit(before.failed, s);
    struct frame f = compare_samples(input, i, p, s);
    compare_pattern(&f, s);
    compare_trend(&f, p, s);
    decide(&f, p, s);
    monitor_reference(&f, p, s);
    watch_common(&f, p, s);
    watch_failed(&f, p, s);
    accused[i] = accuse(&f, p, s);
    count_miscompares(&f, p, s);
    const int64_t level = s->level;
    lasting_watch(&f, p, s);
    latch(&f, p, s);
    if (s->level == level) {
        lasting_learn(&f, s);
    } else {
        lasting_begin_sums(&s->lasting);
    }
    publish(&f, p, s);
    report(&f, i, input->reference[i], output);
}

/* ---- The interface ---- */

/* Whether every number that bounds a loop or a shift is within its range, and every sensor's range is one. */
static bool usable(const struct rig_config *wanted)
{
    bool good = wanted->layout == RIG_UNIT_LAYOUT;
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
    memset(box_count, 0, sizeof box_count);
    stepped = 0U;
    for (int i = 0; i < RIG_SIGNALS; i++) {
        for (int c = 0; c < RIG_CHANNELS; c++) {
            signals[i].smooth[c] = (double)NAN;
        }
        lasting_open(&config, i, &signals[i].lasting);
        signals[i].smooth_reference = (double)NAN;
        signals[i].smooth_vote = (double)NAN;
        signals[i].reference_usable = true;
        signals[i].level = config.signal[i].fitted;
    }
    discretes_open(config.discrete);
    return 0;
}

int rig_unit_step(const struct rig_input *input, struct rig_output *output)
{
    for (int i = 0; i < RIG_SIGNALS; i++) {
        monitor_signal(input, i, output);
    }
    watch_boxes(output);
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
