/* The cross-channel monitor: what its two files share. */
#ifndef MONITOR_H
#define MONITOR_H

#include <stdbool.h>

#include "rig_unit.h"

/* What persists of the channels of one signal or discrete. */
struct latches {
    bool failed[RIG_CHANNELS];    /* latched: only a reset command clears it */
    int64_t count[RIG_CHANNELS];  /* miscomparing frames in a row */
    int64_t agreed[RIG_CHANNELS]; /* frames in a row that a failed channel agreed with the vote */
};

/* Clear the failures of the commanded channels, bits, that have agreed with the vote for readmit_frames. */
void monitor_readmit(struct latches *latches, unsigned commanded, int64_t fitted, int64_t readmit_frames);

/* Begin with every discrete channel in use. */
void discretes_open(const struct rig_discrete_config config[RIG_DISCRETES]);

/* Vote and monitor the discretes of one frame. */
void discretes_step(const struct rig_input *input, struct rig_output *output);

#endif
