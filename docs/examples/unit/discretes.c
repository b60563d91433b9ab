/* The voter of the discretes: majority, the fail-safe value without one, isolation by persistence.
 *
 * Zhang (2023), section 4, item 1; docs/explanation/decisions.md, 'Discretes', whose numbered rules the comments name.
 */
#include <string.h>

#include "monitor.h"

static struct rig_discrete_config config[RIG_DISCRETES];
static struct latches latches[RIG_DISCRETES];

void discretes_open(const struct rig_discrete_config wanted[RIG_DISCRETES])
{
    memcpy(config, wanted, sizeof config);
    memset(latches, 0, sizeof latches);
}

/* Rule 2: a sample can be compared when it is valid and its in-line monitor does not say bad. */
static bool comparable(const struct rig_input *input, int d, int c)
{
    return (input->discrete_valid[d][c] != 0) && (input->discrete_ilm[d][c] != RIG_ILM_BAD);
}

/* Rule 3: the value of most channels in use; as many of the one as of the other, or none: the fail-safe value. */
static uint8_t majority(const struct rig_input *input, int d)
{
    int balance = 0;
    for (int c = 0; c < config[d].fitted; c++) {
        if (!latches[d].failed[c] && comparable(input, d, c)) {
            balance += (input->discrete_channels[d][c] != 0) ? 1 : -1;
        }
    }
    if (balance == 0) {
        return (uint8_t)config[d].fail_safe;
    }
    return (balance > 0) ? 1 : 0;
}

/* Rules 4 to 6: count and latch one fitted channel; its state. */
static uint8_t isolate(const struct rig_input *input, int d, int c, uint8_t voted)
{
    struct latches *const l = &latches[d];
    const bool same = (input->discrete_channels[d][c] != 0) == (voted != 0);
    const bool agrees = same && comparable(input, d, c);
    l->agreed[c] = (agrees && l->failed[c]) ? (l->agreed[c] + 1) : 0;
    l->count[c] = agrees ? 0.0 : (l->count[c] + 1.0);
    if (l->count[c] >= (double)config[d].persistence) {
        l->failed[c] = true;
    }
    if (l->failed[c]) {
        return RIG_STATE_FAILED;
    }
    return agrees ? RIG_STATE_OK : RIG_STATE_SUSPECT;
}

void discretes_step(const struct rig_input *input, struct rig_output *output)
{
    for (int d = 0; d < RIG_DISCRETES; d++) {
        persistence_readmit(&latches[d], input->discrete_reset[d], config[d].fitted, config[d].readmit_frames); /* rule 1 */
        const uint8_t voted = majority(input, d);
        uint8_t level = 0;
        for (int c = 0; c < RIG_CHANNELS; c++) {
            const bool fitted = c < config[d].fitted;
            const uint8_t state = fitted ? isolate(input, d, c, voted) : (uint8_t)RIG_STATE_ABSENT;
            output->discrete_state[d][c] = state;
            if ((state == RIG_STATE_OK) || (state == RIG_STATE_SUSPECT)) {
                level++;
            }
        }
        output->discrete_voted[d] = voted;
        output->discrete_level[d] = level;
    }
}
