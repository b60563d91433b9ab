/* Slow-fault tests, of a monitor that was built with a version of the records before the fifth: all of them are off. */
#include <string.h>

#include "monitor.h"

void tests_open(const struct rig_config *config, int signal, struct slow_tests *t)
{
    (void)config;
    (void)signal;
    memset(t, 0, sizeof *t);
}

void tests_readmit(const bool failed[RIG_CHANNELS], struct signal *s)
{
    (void)failed;
    (void)s;
}

bool tests_run(const struct slow_tests *t)
{
    (void)t;
    return false;
}

double tests_middle(const struct frame *f, struct slow_tests *t)
{
    (void)f;
    (void)t;
    return 0.0;
}

bool tests_is_cut(double m, params *p, const struct slow_tests *t)
{
    (void)m;
    (void)p;
    (void)t;
    return false;
}

unsigned tests_watch(const struct frame *f, params *p, struct signal *s)
{
    (void)f;
    (void)p;
    (void)s;
    return 0U;
}
