/* A unit as a co-simulation FMU by FMI 3.0: the functions of the standard over rig_unit_open, _step and _close.
 *
 * Built together with fmu.c and the unit into binaries/x86_64-linux/rig_unit.so; `rig unit header --fmu 3` writes the
 * modelDescription.xml beside it.  A frame is one fmi3DoStep: inputs before it, outputs after it.
 */
#include <stdio.h>
#include <string.h>

#include "fmu.h"

typedef void log_message(void *environment, int status, const char *category, const char *text);

static struct {
    bool alive, talks;
    log_message *log;
    void *environment;
} unit;

/* An error, with a line for the importer's log. */
static int fail(const char *function, int code)
{
    char text[80];
    snprintf(text, sizeof text, "%s returned %d", function, code);
    if (unit.talks && unit.log != NULL) {
        unit.log(unit.environment, STATUS_ERROR, "logStatusError", text);
    }
    return STATUS_ERROR;
}

/* ---- The life of the unit ---- */

const char *fmi3GetVersion(void)
{
    return "3.0";
}

int fmi3SetDebugLogging(void *instance, bool on, size_t count, const char *const categories[])
{
    (void)instance, (void)count, (void)categories;
    unit.talks = on;
    return STATUS_OK;
}

/* NULL: written for other records, there is one already, or it should do what it cannot. */
void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible, bool talks,
                                  bool events, bool early_return, const uint32_t intermediate[], size_t count,
                                  void *environment, log_message *log, void (*update)(void))
{
    (void)name, (void)resources, (void)visible, (void)early_return, (void)intermediate, (void)update;
    if (unit.alive || events || count != 0 || !fmu_is_ours(token)) {
        return NULL;
    }
    unit.alive = true;
    unit.talks = talks;
    unit.log = log;
    unit.environment = environment;
    fmu_clear();
    return &unit;
}

void fmi3FreeInstance(void *instance)
{
    if (instance != NULL) {
        fmu_clear();
        unit.alive = false;
    }
}

int fmi3EnterInitializationMode(void *instance, bool has_tolerance, double tolerance, double start, bool has_stop,
                                double stop)
{
    (void)instance, (void)has_tolerance, (void)tolerance, (void)start, (void)has_stop, (void)stop;
    return STATUS_OK;
}

int fmi3ExitInitializationMode(void *instance)
{
    (void)instance;
    const int code = fmu_open();
    return (code == 0) ? STATUS_OK : fail("rig_unit_open", code);
}

int fmi3Terminate(void *instance)
{
    (void)instance;
    return STATUS_OK;
}

int fmi3Reset(void *instance)
{
    (void)instance;
    fmu_clear();
    return STATUS_OK;
}

int fmi3DoStep(void *instance, double time_s, double step_s, bool no_return, bool *event, bool *end, bool *early,
               double *reached_s)
{
    (void)instance, (void)no_return;
    const int code = fmu_step(time_s);
    *event = *end = *early = false;
    *reached_s = (code == 0) ? (time_s + step_s) : time_s;
    return (code == 0) ? STATUS_OK : fail("rig_unit_step", code);
}

/* ---- Values: a variable is all elements of its array ---- */

enum direction { TO_UNIT, FROM_UNIT };

/* Copy between the variables and `values`, which has room for `room` elements of `bytes`. */
static int copy(const uint32_t references[], size_t count, void *values, size_t room, enum base base,
                enum direction direction)
{
    const size_t width = fmu_width(base);
    uint8_t *next = values;
    for (size_t i = 0; i < count; i++) {
        struct variable found;
        if (!fmu_find(references[i], &found) || found.base != base || found.count > room) {
            return fail("value reference", (int)references[i]);
        }
        const size_t bytes = found.count * width;
        memcpy((direction == TO_UNIT) ? found.at : next, (direction == TO_UNIT) ? next : found.at, bytes);
        room -= found.count;
        next += bytes;
    }
    return STATUS_OK;
}

#define VALUES(type, c_type, base)                                                                               \
    int fmi3Set##type(void *instance, const uint32_t references[], size_t count, const c_type values[], size_t n) \
    {                                                                                                            \
        (void)instance;                                                                                          \
        return copy(references, count, (void *)(uintptr_t)values, n, base, TO_UNIT);                             \
    }                                                                                                            \
    int fmi3Get##type(void *instance, const uint32_t references[], size_t count, c_type values[], size_t n)      \
    {                                                                                                            \
        (void)instance;                                                                                          \
        return copy(references, count, values, n, base, FROM_UNIT);                                              \
    }

VALUES(Float64, double, BASE_REAL)
VALUES(UInt8, uint8_t, BASE_BYTE)
VALUES(Int64, int64_t, BASE_SIGNED)
VALUES(UInt64, uint64_t, BASE_UNSIGNED)
VALUES(UInt16, uint16_t, BASE_SHORT)
VALUES(UInt32, uint32_t, BASE_WORD)

int fmi3SetString(void *instance, const uint32_t references[], size_t count, const char *const values[], size_t n)
{
    (void)instance;
    for (size_t i = 0; i < count && i < n; i++) {
        if (!fmu_set_text(references[i], values[i])) {
            return fail("fmi3SetString: reference", (int)references[i]);
        }
    }
    return STATUS_OK;
}

int fmi3GetString(void *instance, const uint32_t references[], size_t count, const char *values[], size_t n)
{
    (void)instance;
    for (size_t i = 0; i < count && i < n; i++) {
        values[i] = fmu_text(references[i]);
        if (values[i] == NULL) {
            return fail("fmi3GetString: reference", (int)references[i]);
        }
    }
    return STATUS_OK;
}

/* ---- What the description says that the unit cannot do: importers look for the functions all the same ---- */

#define CANNOT(function)            \
    int function(void *instance)    \
    {                               \
        (void)instance;             \
        return fail(#function, -1); \
    }
#define CANNOT_INSTANTIATE(function) \
    void *function(const char *name) \
    {                                \
        (void)name;                  \
        return NULL;                 \
    }

CANNOT_INSTANTIATE(fmi3InstantiateModelExchange)
CANNOT_INSTANTIATE(fmi3InstantiateScheduledExecution)
CANNOT(fmi3ActivateModelPartition)
CANNOT(fmi3CompletedIntegratorStep)
CANNOT(fmi3DeserializeFMUState)
CANNOT(fmi3EnterConfigurationMode)
CANNOT(fmi3EnterContinuousTimeMode)
CANNOT(fmi3EnterEventMode)
CANNOT(fmi3EnterStepMode)
CANNOT(fmi3EvaluateDiscreteStates)
CANNOT(fmi3ExitConfigurationMode)
CANNOT(fmi3FreeFMUState)
CANNOT(fmi3GetAdjointDerivative)
CANNOT(fmi3GetBinary)
CANNOT(fmi3GetBoolean)
CANNOT(fmi3GetClock)
CANNOT(fmi3GetContinuousStateDerivatives)
CANNOT(fmi3GetContinuousStates)
CANNOT(fmi3GetDirectionalDerivative)
CANNOT(fmi3GetEventIndicators)
CANNOT(fmi3GetFMUState)
CANNOT(fmi3GetFloat32)
CANNOT(fmi3GetInt16)
CANNOT(fmi3GetInt32)
CANNOT(fmi3GetInt8)
CANNOT(fmi3GetIntervalDecimal)
CANNOT(fmi3GetIntervalFraction)
CANNOT(fmi3GetNominalsOfContinuousStates)
CANNOT(fmi3GetNumberOfContinuousStates)
CANNOT(fmi3GetNumberOfEventIndicators)
CANNOT(fmi3GetNumberOfVariableDependencies)
CANNOT(fmi3GetOutputDerivatives)
CANNOT(fmi3GetShiftDecimal)
CANNOT(fmi3GetShiftFraction)
CANNOT(fmi3GetVariableDependencies)
CANNOT(fmi3SerializeFMUState)
CANNOT(fmi3SerializedFMUStateSize)
CANNOT(fmi3SetBinary)
CANNOT(fmi3SetBoolean)
CANNOT(fmi3SetClock)
CANNOT(fmi3SetContinuousStates)
CANNOT(fmi3SetFMUState)
CANNOT(fmi3SetFloat32)
CANNOT(fmi3SetInt16)
CANNOT(fmi3SetInt32)
CANNOT(fmi3SetInt8)
CANNOT(fmi3SetIntervalDecimal)
CANNOT(fmi3SetIntervalFraction)
CANNOT(fmi3SetShiftDecimal)
CANNOT(fmi3SetShiftFraction)
CANNOT(fmi3SetTime)
CANNOT(fmi3UpdateDiscreteStates)
