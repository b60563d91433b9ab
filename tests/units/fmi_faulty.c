/* first_valid as an FMU (-DFMI=2 or 3) whose step after half a second goes wrong in the way that FAULT names. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#if FMI == 2
#define fmi2DoStep step_well
#define fmi2GetBooleanStatus status_well
#include "fmi2.c"
#undef fmi2DoStep
#undef fmi2GetBooleanStatus
#else
#define fmi3DoStep step_well
#include "fmi3.c"
#undef fmi3DoStep
#endif

static int fault(double time_s)
{
    static const char *const names[] = {"ok", "warning", "discard", "error", "fatal"};
    const char *name = getenv("FAULT");
    if (name == NULL || fabs(time_s - 0.5) > 0.001) {
        return STATUS_OK;
    }
    if (strcmp(name, "end") == 0) {
        return -1;
    }
    for (int i = 0; i < 5; i++) {
        if (strcmp(name, names[i]) == 0) {
            return i;
        }
    }
    return STATUS_OK;
}

#if FMI == 2
static int wants_to_end;

int fmi2DoStep(void *instance, double time_s, double step_s, int no_return)
{
    const int status = fault(time_s);
    wants_to_end = status == -1;
    return wants_to_end ? STATUS_DISCARD : status > STATUS_WARNING ? status : step_well(instance, time_s, step_s, no_return);
}

int fmi2GetBooleanStatus(void *instance, int kind, int *value)
{
    const int status = status_well(instance, kind, value);
    *value = wants_to_end;
    return status;
}
#else
int fmi3DoStep(void *instance, double time_s, double step_s, bool no_return, bool *event, bool *end, bool *early,
               double *reached_s)
{
    const int status = fault(time_s);
    if (status > STATUS_WARNING) {
        return status;
    }
    const int well = step_well(instance, time_s, step_s, no_return, event, end, early, reached_s);
    *end = status == -1;
    return well;
}
#endif
