/* A unit as an FMU: what fmi2.c and fmi3.c share.  fmu.c has the records and calls the unit's three functions. */
#ifndef FMU_H
#define FMU_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* What an FMI function returns. */
enum status { STATUS_OK = 0, STATUS_WARNING = 1, STATUS_DISCARD = 2, STATUS_ERROR = 3, STATUS_FATAL = 4 };

/* What the elements of a variable are. */
enum base { BASE_BYTE = 0, BASE_SIGNED = 1, BASE_UNSIGNED = 2, BASE_REAL = 3, BASE_SHORT = 4, BASE_WORD = 5 };

/* A variable: elements side by side in one of the records. */
struct variable {
    uint8_t *at;
    size_t count;
    enum base base;
};

/* Bytes of an element. */
size_t fmu_width(enum base base);

/* The variable of a value reference; false when there is none. */
bool fmu_find(uint32_t reference, struct variable *found);

/* Whether the description was written for the records of rig_unit.h. */
bool fmu_is_ours(const char *token);

/* Zero records, as at first; ends a session that has begun. */
void fmu_clear(void);

/* Begin with the parameters that have been set; the unit's own answer. */
int fmu_open(void);

/* The frame at `time_s` with the inputs that have been set; the unit's own answer. */
int fmu_step(double time_s);

/* Copy a text into a variable, or find it there; false when it is none. */
bool fmu_set_text(uint32_t reference, const char *text);
const char *fmu_text(uint32_t reference);

#endif
