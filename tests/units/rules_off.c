/* Rules that version 3 of the records tells, of a monitor that was built with an older one: CONFIG has none of them. */
#include <string.h>

#include "monitor.h"

bool rules_usable(const struct rig_config *config)
{
    (void)config;
    return true;
}

void rules_open(const struct rig_config *config, int signal, struct rules *r)
{
    (void)config;
    (void)signal;
    memset(r, 0, sizeof *r);
    r->trend_small = -1.0;
    r->asks_trend = true;
    r->box = 1;
}

bool rules_give_up(struct frame *f, params *p, struct signal *s)
{
    (void)f;
    (void)p;
    (void)s;
    return false;
}
