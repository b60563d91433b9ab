/* Rules that version 3 of the records tells of a signal, and what becomes of a split that no rule answers. */
#include "monitor.h"

bool rules_usable(const struct rig_config *config)
{
    bool good = true;
    for (int i = 0; i < RIG_SIGNALS; i++) {
        good = good && (config->rules[i].box >= 0) && (config->rules[i].box <= RIG_SIGNALS);
    }
    return good;
}

void rules_open(const struct rig_config *config, int signal, struct rules *r)
{
    const struct rig_rules_config *const told = &config->rules[signal];
    r->count_down = told->count_down;
    r->unresolved_frames = told->unresolved_frames;
    r->trend_small = told->trend_small;
    r->trend_tumbles = told->trend_tumbles != 0;
    r->asks_trend = (told->referred == 0) || (told->trend_beside_reference != 0);
    r->tells = told->tells;
    r->sources = told->sources;
    r->box = told->box;
}

/* decisions.md 'When a signal is lost': the signal is lost, so that its reference flies, or its degraded mode. */
bool rules_give_up(struct frame *f, params *p, struct signal *s)
{
    const int64_t most = s->rules.unresolved_frames;
    if ((most <= 0) || (s->split.unresolved < most)) {
        return false;
    }
    f->decided_by = RIG_DECIDED_BY_GIVEN_UP;
    for (int c = 0; c < p->fitted; c++) {
        s->latches.failed[c] = true;
    }
    return true;
}
