/* A unit as a co-simulation FMU by FMI 2.0: the functions of the standard over rig_unit_open, _step and _close.
 *
 * Built together with fmu.c and the unit into binaries/linux64/rig_unit.so; `rig unit header --fmu 2` writes the
 * modelDescription.xml beside it.  A frame is one fmi2DoStep: inputs before it, outputs after it.
 */
#include <stdio.h>
#include <string.h>

#include "fmu.h"

/* Of kind when fmi2GetBooleanStatus is asked whether the unit wants to end. */
#define TERMINATED 3

struct callbacks {
    void (*log)(void *environment, const char *instance, int status, const char *category, const char *text, ...);
    void *(*allocate)(size_t count, size_t bytes);
    void (*release)(void *memory);
    void (*step_finished)(void *environment, int status);
    void *environment;
};

static struct {
    bool alive, talks;
    struct callbacks callbacks;
} unit;

/* An error, with a line for the importer's log. */
static int fail(const char *function, int code)
{
    char text[80];
    snprintf(text, sizeof text, "%s returned %d", function, code);
    if (unit.talks && unit.callbacks.log != NULL) {
        unit.callbacks.log(unit.callbacks.environment, "unit", STATUS_ERROR, "logStatusError", text);
    }
    return STATUS_ERROR;
}

/* ---- The life of the unit ---- */

const char *fmi2GetTypesPlatform(void)
{
    return "default";
}

const char *fmi2GetVersion(void)
{
    return "2.0";
}

int fmi2SetDebugLogging(void *instance, int on, size_t count, const char *const categories[])
{
    (void)instance, (void)count, (void)categories;
    unit.talks = on != 0;
    return STATUS_OK;
}

/* NULL: not a co-simulation, written for other records, or there is one already. */
void *fmi2Instantiate(const char *name, int kind, const char *guid, const char *resources,
                      const struct callbacks *callbacks, int visible, int talks)
{
    (void)name, (void)resources, (void)visible;
    if (kind != 1 || unit.alive || callbacks == NULL || !fmu_is_ours(guid)) {
        return NULL;
    }
    unit.alive = true;
    unit.talks = talks != 0;
    unit.callbacks = *callbacks;
    fmu_clear();
    return &unit;
}

void fmi2FreeInstance(void *instance)
{
    if (instance != NULL) {
        fmu_clear();
        unit.alive = false;
    }
}

int fmi2SetupExperiment(void *instance, int has_tolerance, double tolerance, double start, int has_stop, double stop)
{
    (void)instance, (void)has_tolerance, (void)tolerance, (void)start, (void)has_stop, (void)stop;
    return STATUS_OK;
}

int fmi2EnterInitializationMode(void *instance)
{
    (void)instance;
    return STATUS_OK;
}

int fmi2ExitInitializationMode(void *instance)
{
    (void)instance;
    const int code = fmu_open();
    return (code == 0) ? STATUS_OK : fail("rig_unit_open", code);
}

int fmi2Terminate(void *instance)
{
    (void)instance;
    return STATUS_OK;
}

int fmi2Reset(void *instance)
{
    (void)instance;
    fmu_clear();
    return STATUS_OK;
}

int fmi2DoStep(void *instance, double time_s, double step_s, int no_return)
{
    (void)instance, (void)step_s, (void)no_return;
    const int code = fmu_step(time_s);
    return (code == 0) ? STATUS_OK : fail("rig_unit_step", code);
}

int fmi2GetBooleanStatus(void *instance, int kind, int *value)
{
    (void)instance;
    *value = 0;
    return (kind == TERMINATED) ? STATUS_OK : STATUS_DISCARD;
}

/* ---- Values: every variable is one element, a text is one too ---- */

static bool find_one(unsigned reference, struct variable *found, bool real)
{
    return fmu_find(reference, found) && found->count == 1 && (found->base == BASE_REAL) == real;
}

int fmi2SetReal(void *instance, const unsigned references[], size_t count, const double values[])
{
    (void)instance;
    for (size_t i = 0; i < count; i++) {
        struct variable to;
        if (!find_one(references[i], &to, true)) {
            return fail("fmi2SetReal: reference", (int)references[i]);
        }
        *(double *)(void *)to.at = values[i];
    }
    return STATUS_OK;
}

int fmi2GetReal(void *instance, const unsigned references[], size_t count, double values[])
{
    (void)instance;
    for (size_t i = 0; i < count; i++) {
        struct variable from;
        if (!find_one(references[i], &from, true)) {
            return fail("fmi2GetReal: reference", (int)references[i]);
        }
        values[i] = *(const double *)(const void *)from.at;
    }
    return STATUS_OK;
}

int fmi2SetInteger(void *instance, const unsigned references[], size_t count, const int values[])
{
    (void)instance;
    for (size_t i = 0; i < count; i++) {
        struct variable to;
        if (!find_one(references[i], &to, false)) {
            return fail("fmi2SetInteger: reference", (int)references[i]);
        }
        const int64_t value = values[i];
        memcpy(to.at, &value, fmu_width(to.base)); /* little-endian */
    }
    return STATUS_OK;
}

int fmi2GetInteger(void *instance, const unsigned references[], size_t count, int values[])
{
    (void)instance;
    for (size_t i = 0; i < count; i++) {
        struct variable from;
        if (!find_one(references[i], &from, false)) {
            return fail("fmi2GetInteger: reference", (int)references[i]);
        }
        uint64_t value = 0;
        memcpy(&value, from.at, fmu_width(from.base)); /* little-endian */
        values[i] = (int)(from.base == BASE_WORD ? (int32_t)value : (int32_t)(value & 0x7fffffff));
    }
    return STATUS_OK;
}

int fmi2SetString(void *instance, const unsigned references[], size_t count, const char *const values[])
{
    (void)instance;
    for (size_t i = 0; i < count; i++) {
        if (!fmu_set_text(references[i], values[i])) {
            return fail("fmi2SetString: reference", (int)references[i]);
        }
    }
    return STATUS_OK;
}

int fmi2GetString(void *instance, const unsigned references[], size_t count, const char *values[])
{
    (void)instance;
    for (size_t i = 0; i < count; i++) {
        values[i] = fmu_text(references[i]);
        if (values[i] == NULL) {
            return fail("fmi2GetString: reference", (int)references[i]);
        }
    }
    return STATUS_OK;
}

/* ---- What the description says that the unit cannot do: importers look for the functions all the same ---- */

#define CANNOT(function)              \
    int function(void *instance)      \
    {                                 \
        (void)instance;               \
        return fail(#function, -1);   \
    }

CANNOT(fmi2GetBoolean)
CANNOT(fmi2SetBoolean)
CANNOT(fmi2GetFMUstate)
CANNOT(fmi2SetFMUstate)
CANNOT(fmi2FreeFMUstate)
CANNOT(fmi2SerializedFMUstateSize)
CANNOT(fmi2SerializeFMUstate)
CANNOT(fmi2DeSerializeFMUstate)
CANNOT(fmi2GetDirectionalDerivative)
CANNOT(fmi2SetRealInputDerivatives)
CANNOT(fmi2GetRealOutputDerivatives)
CANNOT(fmi2CancelStep)
CANNOT(fmi2GetStatus)
CANNOT(fmi2GetRealStatus)
CANNOT(fmi2GetIntegerStatus)
CANNOT(fmi2GetStringStatus)
