/* What lasts, of a monitor that was built with version 1 of the records: CONFIG has none of it, so all of it is off. */
#include <string.h>

#include "monitor.h"

void lasting_open(const struct rig_config *config, int signal, struct lasting *l)
{
    (void)config;
    (void)signal;
    memset(l, 0, sizeof *l);
}

void lasting_readmit(const bool failed[RIG_CHANNELS], struct signal *s)
{
    (void)failed;
    (void)s;
}

void lasting_count(const struct frame *f, double reference, params *p, struct signal *s)
{
    (void)f;
    (void)reference;
    (void)p;
    (void)s;
}

bool lasting_is_stale(int c, const struct lasting *l)
{
    (void)c;
    (void)l;
    return false;
}

bool lasting_is_learned(const struct frame *f, const struct lasting *l)
{
    (void)f;
    (void)l;
    return true;
}

void lasting_watch(struct frame *f, params *p, struct signal *s)
{
    (void)f;
    (void)p;
    (void)s;
}

void lasting_learn(const struct frame *f, struct signal *s)
{
    (void)f;
    (void)s;
}

void lasting_begin_sums(struct lasting *l)
{
    (void)l;
}
