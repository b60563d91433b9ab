/* Slow faults, of a monitor that was built with version 1 of the records: CONFIG has none of it, so all of it is off. */
#include <string.h>

#include "monitor.h"

void slow_open(const struct rig_config *config, int signal, struct slow_faults *l)
{
    (void)config;
    (void)signal;
    memset(l, 0, sizeof *l);
}

void slow_count(const struct frame *f, double reference, params *p, struct signal *s)
{
    (void)f;
    (void)reference;
    (void)p;
    (void)s;
}

bool slow_is_stale(int c, const struct slow_faults *l)
{
    (void)c;
    (void)l;
    return false;
}

void slow_watch(struct frame *f, params *p, struct signal *s)
{
    (void)f;
    (void)p;
    (void)s;
}

void slow_begin_sums(struct slow_faults *l)
{
    (void)l;
}
