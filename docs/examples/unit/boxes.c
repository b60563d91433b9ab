/* LRU failure: a channel accused on several signals of a box at once is failed on all signals of that box.
 *
 * docs/explanation/decisions.md, 'LRU failure'.
 */
#include <string.h>

#include "monitor.h"

#define MORE_THAN_HALF (-1)

static int64_t needed[RIG_SIGNALS + 1]; /* by box: signals that must accuse a channel in the same frame; 0: never */
static int64_t least;                   /* of them, but zeros; 0 where all are */
static int64_t count[RIG_SIGNALS + 1][RIG_CHANNELS]; /* frames in a row in which they did */

/* Signals of a box of `size` that must accuse a channel: one signal has its own comparison. */
static int64_t needed_of(int64_t size, int64_t asked)
{
    if (size < 2) {
        return 0;
    }
    if (asked == MORE_THAN_HALF) {
        return (size / 2) + 1;
    }
    return (asked < size) ? asked : size;
}

void boxes_open(const struct rig_config *config, const struct signal signals[RIG_SIGNALS])
{
    int64_t sizes[RIG_SIGNALS + 1] = {0};
    memset(count, 0, sizeof count);
    for (int i = 0; i < RIG_SIGNALS; i++) {
        sizes[signals[i].rules.box]++;
    }
    needed[0] = 0;
    least = 0;
    for (int b = 1; b <= RIG_SIGNALS; b++) {
        needed[b] = needed_of(sizes[b], config->box_signals);
        if ((needed[b] > 0) && ((least == 0) || (needed[b] < least))) {
            least = needed[b];
        }
    }
}

unsigned boxes_accuse(const struct frame *f, params *p, const struct signal *s)
{
    const bool evidence = (f->decided_by == RIG_DECIDED_BY_ILM) || (f->decided_by == RIG_DECIDED_BY_REFERENCE);
    const bool in_split = is_split(s->pattern);
    unsigned bits = 0U;
    for (int c = 0; c < p->fitted; c++) {
        const bool against = in_split ? (evidence && f->blamed[c]) : f->alone[c];
        if (!s->latches.failed[c] && (!has(f->ranked, c) || against)) {
            bits |= 1U << c;
        }
    }
    return bits;
}

/* Count the frames in which channel c is accused on enough signals of box b; whether it is in use or accused there. */
static bool watch_unit(int b, int c, const struct rig_config *config, const struct signal signals[RIG_SIGNALS])
{
    int64_t against = 0;
    bool in_use = false;
    for (int i = 0; i < RIG_SIGNALS; i++) {
        if (signals[i].rules.box == b) {
            against += has(signals[i].accused, c) ? 1 : 0;
            in_use = in_use || ((c < config->signal[i].fitted) && !signals[i].latches.failed[c]);
        }
    }
    count[b][c] = (against >= needed[b]) ? (count[b][c] + 1) : 0;
    return in_use || (against > 0);
}

/* Fail the condemned channels, bits, on one signal that has been voted: the fade begins in the next frame. */
static void fail_all(unsigned condemned, int i, params *p, struct signal *s, struct rig_output *output)
{
    for (int c = 0; c < p->fitted; c++) {
        if (has(condemned, c) && !s->latches.failed[c]) {
            s->latches.failed[c] = true;
            s->level--;
            s->fade_left = p->fade_frames;
            references_trust_pair(s);
            slow_begin_sums(&s->slow_faults);
            output->state[i][c] = RIG_STATE_FAILED;
            output->level[i] = (uint8_t)s->level;
            output->decided_by[i] = RIG_DECIDED_BY_BOX;
        }
    }
}

/* Fail the units of box b that are accused long enough, unless they are the majority of those there. */
static void fail_box(int b, const struct rig_config *config, struct signal signals[RIG_SIGNALS],
                     struct rig_output *output)
{
    unsigned condemned = 0U;
    int candidates = 0;
    int units = 0;
    for (int c = 0; c < RIG_CHANNELS; c++) {
        units += watch_unit(b, c, config, signals) ? 1 : 0;
        if (count[b][c] >= config->box_persistence) {
            condemned |= 1U << c;
            candidates++;
        }
    }
    if ((2 * candidates) <= units) {
        for (int i = 0; i < RIG_SIGNALS; i++) {
            if (signals[i].rules.box == b) {
                fail_all(condemned, i, &config->signal[i], &signals[i], output);
            }
        }
    }
}

/* Boxes are watched only in frames in which enough signals accuse anybody. */
void boxes_watch(const struct rig_config *config, struct signal signals[RIG_SIGNALS], struct rig_output *output)
{
    int64_t accusing = 0;
    for (int i = 0; i < RIG_SIGNALS; i++) {
        accusing += (signals[i].accused != 0U) ? 1 : 0;
    }
    if ((least == 0) || (accusing < least)) {
        memset(count, 0, sizeof count);
        return;
    }
    for (int b = 1; b <= RIG_SIGNALS; b++) {
        if (needed[b] > 0) {
            fail_box(b, config, signals, output);
        }
    }
}
