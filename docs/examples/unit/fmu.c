/* The records of a unit in an FMU, and where its variables are in them.
 *
 * A value reference says where a variable is, see `rig unit header --fmu`: from the lowest bit 14 bits first byte,
 * 10 bits elements, 2 bits type, 2 bits record, 1 bit more of the type.  The unit is one for the whole process, as its three functions are.
 */
#include "fmu.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "rig_unit.h"

#pragma weak rig_unit_step /* a unit has one of them, or both: the other is NULL */
#pragma weak rig_unit_law

static struct rig_config config;
static struct rig_input input;
static struct rig_law_input law_input; /* of the role CONTROL_LAW */
static struct rig_output output;
static uint64_t stepped;
static bool opened;

static const struct {
    void *at;
    size_t bytes;
} records[] = {{&config, sizeof config}, {&input, sizeof input}, {&output, sizeof output}, {&law_input, sizeof law_input}};

size_t fmu_width(enum base base)
{
    static const size_t widths[] = {1, 8, 8, 8, 2, 4, 0, 0}; /* by enum base; the last two are none */
    return widths[base & 7];
}

bool fmu_find(uint32_t reference, struct variable *found)
{
    const size_t first = reference & 0x3fffU, record = (reference >> 26) & 3U;
    const size_t count = (reference >> 14) & 0x3ffU;
    found->base = (enum base)(((reference >> 24) & 3U) | ((reference >> 26) & 4U));
    found->count = count;
    if (record >= sizeof records / sizeof records[0] || count == 0 || fmu_width(found->base) == 0) {
        return false;
    }
    found->at = (uint8_t *)records[record].at + first;
    return first + (count * fmu_width(found->base)) <= records[record].bytes;
}

bool fmu_is_ours(const char *token)
{
    char ours[32];
    snprintf(ours, sizeof ours, "rig-unit-%016" PRIx64, (uint64_t)RIG_UNIT_LAYOUT);
    return token != NULL && strcmp(token, ours) == 0;
}

void fmu_clear(void)
{
    if (opened) {
        opened = false;
        rig_unit_close();
    }
    memset(&config, 0, sizeof config);
    memset(&input, 0, sizeof input);
    memset(&law_input, 0, sizeof law_input);
    memset(&output, 0, sizeof output);
    stepped = 0;
}

static bool is_law(void)
{
    return config.role == RIG_ROLE_CONTROL_LAW;
}

int fmu_open(void)
{
    config.magic = RIG_MAGIC_INPUT;
    config.version = RIG_UNIT_VERSION;
    config.kind = RIG_KIND_CONFIG;
    config.layout = RIG_UNIT_LAYOUT;
    config.length = offsetof(struct rig_config, length);
    const bool can = is_law() ? rig_unit_law != NULL : rig_unit_step != NULL;
    const int code = can ? rig_unit_open(&config) : -1;
    opened = code == 0;
    return code;
}

static void begin_frame(double time_s)
{
    input.magic = RIG_MAGIC_INPUT;
    input.version = RIG_UNIT_VERSION;
    input.kind = RIG_KIND_FRAME;
    input.layout = RIG_UNIT_LAYOUT;
    input.frame = (int64_t)floor((time_s * config.rate_hz) + 0.5);
    input.time_s = time_s;
    input.length = offsetof(struct rig_input, length);
    memcpy(&law_input, &input, offsetof(struct rig_input, time_s) + sizeof input.time_s); /* the same head */
    law_input.length = offsetof(struct rig_law_input, length);
    memset(&output, 0, sizeof output);
    output.magic = RIG_MAGIC_OUTPUT;
    output.version = RIG_UNIT_VERSION;
    output.kind = RIG_KIND_REPLY;
    output.layout = RIG_UNIT_LAYOUT;
    output.frame = input.frame;
    output.time_s = time_s;
    output.length = offsetof(struct rig_output, length);
}

int fmu_step(double time_s)
{
    begin_frame(time_s);
    int code = -1;
    if (opened) {
        code = is_law() ? rig_unit_law(&law_input, &output) : rig_unit_step(&input, &output);
    }
    if (code == 0) {
        output.stepped = ++stepped;
    }
    return code;
}

bool fmu_set_text(uint32_t reference, const char *text)
{
    struct variable to;
    if (!fmu_find(reference, &to) || to.base != BASE_BYTE || text == NULL || strlen(text) >= to.count) {
        return false;
    }
    memset(to.at, 0, to.count);
    memcpy(to.at, text, strlen(text));
    return true;
}

const char *fmu_text(uint32_t reference)
{
    struct variable from;
    return (fmu_find(reference, &from) && from.base == BASE_BYTE) ? (const char *)from.at : NULL;
}
