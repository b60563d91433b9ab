/* The records between the rig and a unit under test.
 *
 * Written by `rig unit header`: do not edit; write it again when the records change.
 * Little-endian, IEEE 754, naturally aligned.
 *
 * A library exports three functions; 0 is success:
 *
 *     int rig_unit_open(const struct rig_config *config);
 *     int rig_unit_step(const struct rig_input *input, struct rig_output *output);
 *     void rig_unit_close(void);
 *
 * open after close starts a new session.  The rig calls step once per frame, with an output that is zero except for
 * its head.  step fills groups of the output, and names them in `output->said`.
 *
 * A unit of the role CONTROL_LAW has another function in the place of rig_unit_step:
 *
 *     int rig_unit_law(const struct rig_law_input *input, struct rig_output *output);
 */
#ifndef RIG_UNIT_H
#define RIG_UNIT_H

#include <stddef.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#define RIG_ASSERT(condition) static_assert(condition, #condition)
#else
#define RIG_ASSERT(condition) _Static_assert(condition, #condition)
#endif

#define RIG_UNIT_VERSION 5
#define RIG_UNIT_LAYOUT UINT64_C(0xa1a143b056d1cb82)
#define RIG_MAGIC_INPUT UINT32_C(0x49474952)
#define RIG_MAGIC_OUTPUT UINT32_C(0x4f474952)
#define RIG_CHANNELS 4
#define RIG_SIGNALS 16
#define RIG_DISCRETES 3

enum rig_kind {
    RIG_KIND_HELLO = 1,
    RIG_KIND_CONFIG = 2,
    RIG_KIND_FRAME = 3,
    RIG_KIND_END = 4,
    RIG_KIND_READY = 5,
    RIG_KIND_REFUSED = 6,
    RIG_KIND_REPLY = 7,
};

enum rig_role {
    RIG_ROLE_REDUNDANCY = 0,
    RIG_ROLE_FLIGHT_COMPUTER = 1,
    RIG_ROLE_CONTROL_LAW = 2,
};

enum rig_said {
    RIG_SAID_VOTED = 1,
    RIG_SAID_STATE = 2,
    RIG_SAID_PATTERN = 4,
    RIG_SAID_TREND = 8,
    RIG_SAID_DISCRETES = 16,
    RIG_SAID_SURFACE = 32,
};

enum rig_ilm {
    RIG_ILM_BAD = 0,
    RIG_ILM_GOOD = 1,
    RIG_ILM_ABSENT = 2,
};

enum rig_state {
    RIG_STATE_OK = 0,
    RIG_STATE_SUSPECT = 1,
    RIG_STATE_FAILED = 2,
    RIG_STATE_ABSENT = 3,
};

enum rig_pattern {
    RIG_PATTERN_NORMAL = 0,
    RIG_PATTERN_ISOLATED = 1,
    RIG_PATTERN_P2_2 = 2,
    RIG_PATTERN_P1_1_1_1 = 3,
    RIG_PATTERN_P1_1_1 = 4,
    RIG_PATTERN_P1_1 = 5,
    RIG_PATTERN_LOST = 6,
};

enum rig_decided_by {
    RIG_DECIDED_BY_NONE = 0,
    RIG_DECIDED_BY_ILM = 1,
    RIG_DECIDED_BY_TREND = 2,
    RIG_DECIDED_BY_REFERENCE = 3,
    RIG_DECIDED_BY_EXTREMES = 4,
    RIG_DECIDED_BY_MIDDLE = 5,
    RIG_DECIDED_BY_UNRESOLVED = 6,
    RIG_DECIDED_BY_BOX = 7,
    RIG_DECIDED_BY_COMMON = 8,
    RIG_DECIDED_BY_SLOW = 9,
    RIG_DECIDED_BY_LANE = 10,
    RIG_DECIDED_BY_GIVEN_UP = 11,
    RIG_DECIDED_BY_SLOW_MEANS = 12,
    RIG_DECIDED_BY_SLOW_SQUARES = 13,
    RIG_DECIDED_BY_SLOW_HALVES = 14,
};

enum rig_law {
    RIG_LAW_AUTOPILOT = 0,
    RIG_LAW_STICK = 1,
    RIG_LAW_BACKUP = 2,
    RIG_LAW_EXTERNAL = 3,
};

enum rig_status {
    RIG_STATUS_READY = 0,
    RIG_STATUS_DEGRADED = 1,
    RIG_STATUS_FAILED = 2,
    RIG_STATUS_SELF_TEST = 3,
    RIG_STATUS_POWER_UP = 4,
};

enum rig_signal_index {
    RIG_SIGNAL_PITCH_RATE = 0,
    RIG_SIGNAL_ROLL_RATE = 1,
    RIG_SIGNAL_YAW_RATE = 2,
    RIG_SIGNAL_NORMAL_LOAD_FACTOR = 3,
    RIG_SIGNAL_LATERAL_LOAD_FACTOR = 4,
    RIG_SIGNAL_LONGITUDINAL_LOAD_FACTOR = 5,
    RIG_SIGNAL_ANGLE_OF_ATTACK = 6,
    RIG_SIGNAL_ANGLE_OF_SIDESLIP = 7,
    RIG_SIGNAL_STATIC_PRESSURE = 8,
    RIG_SIGNAL_DYNAMIC_PRESSURE = 9,
    RIG_SIGNAL_STICK_PITCH = 10,
    RIG_SIGNAL_STICK_ROLL = 11,
    RIG_SIGNAL_PEDAL = 12,
    RIG_SIGNAL_PITCH_ANGLE = 13,
    RIG_SIGNAL_ROLL_ANGLE = 14,
    RIG_SIGNAL_HEADING = 15,
};

enum rig_discrete_index {
    RIG_DISCRETE_WEIGHT_ON_WHEELS = 0,
    RIG_DISCRETE_GEAR_DOWN = 1,
    RIG_DISCRETE_AUTOPILOT_ENGAGED = 2,
};

enum rig_autopilot_command_index {
    RIG_AUTOPILOT_COMMAND_PITCH_ANGLE_RAD = 0,
    RIG_AUTOPILOT_COMMAND_ROLL_ANGLE_RAD = 1,
    RIG_AUTOPILOT_COMMAND_ALTITUDE_M = 2,
    RIG_AUTOPILOT_COMMAND_HEADING_RAD = 3,
    RIG_AUTOPILOT_COMMAND_AIRSPEED_M_S = 4,
};

enum rig_surface_index {
    RIG_SURFACE_ELEVATOR_RAD = 0,
    RIG_SURFACE_AILERON_RAD = 1,
    RIG_SURFACE_RUDDER_RAD = 2,
    RIG_SURFACE_THROTTLE = 3,
};

enum rig_inertial_index {
    RIG_INERTIAL_ROLL_RATE_RAD_S = 0,
    RIG_INERTIAL_PITCH_RATE_RAD_S = 1,
    RIG_INERTIAL_YAW_RATE_RAD_S = 2,
    RIG_INERTIAL_VELOCITY_NORTH_M_S = 3,
    RIG_INERTIAL_VELOCITY_EAST_M_S = 4,
    RIG_INERTIAL_VELOCITY_DOWN_M_S = 5,
    RIG_INERTIAL_SPECIFIC_FORCE_FORWARD_M_S2 = 6,
    RIG_INERTIAL_SPECIFIC_FORCE_RIGHT_M_S2 = 7,
    RIG_INERTIAL_SPECIFIC_FORCE_DOWN_M_S2 = 8,
};

/* HELLO and END */
struct rig_hello {
    uint32_t magic;
    uint16_t version;
    uint16_t kind;
    uint64_t layout;
    uint64_t session;
    int64_t frame;
    double time_s;
    uint32_t length;
    uint32_t crc;
};

RIG_ASSERT(sizeof(struct rig_hello) == 48);
RIG_ASSERT(offsetof(struct rig_hello, magic) == 0);
RIG_ASSERT(offsetof(struct rig_hello, version) == 4);
RIG_ASSERT(offsetof(struct rig_hello, kind) == 6);
RIG_ASSERT(offsetof(struct rig_hello, layout) == 8);
RIG_ASSERT(offsetof(struct rig_hello, session) == 16);
RIG_ASSERT(offsetof(struct rig_hello, frame) == 24);
RIG_ASSERT(offsetof(struct rig_hello, time_s) == 32);
RIG_ASSERT(offsetof(struct rig_hello, length) == 40);
RIG_ASSERT(offsetof(struct rig_hello, crc) == 44);

/* READY and REFUSED, with the name of the unit or the reason of a refusal */
struct rig_ready {
    uint32_t magic;
    uint16_t version;
    uint16_t kind;
    uint64_t layout;
    uint64_t session;
    int64_t frame;
    double time_s;
    char text[192];
    uint32_t length;
    uint32_t crc;
};

RIG_ASSERT(sizeof(struct rig_ready) == 240);
RIG_ASSERT(offsetof(struct rig_ready, magic) == 0);
RIG_ASSERT(offsetof(struct rig_ready, version) == 4);
RIG_ASSERT(offsetof(struct rig_ready, kind) == 6);
RIG_ASSERT(offsetof(struct rig_ready, layout) == 8);
RIG_ASSERT(offsetof(struct rig_ready, session) == 16);
RIG_ASSERT(offsetof(struct rig_ready, frame) == 24);
RIG_ASSERT(offsetof(struct rig_ready, time_s) == 32);
RIG_ASSERT(offsetof(struct rig_ready, text) == 40);
RIG_ASSERT(offsetof(struct rig_ready, length) == 232);
RIG_ASSERT(offsetof(struct rig_ready, crc) == 236);

/* monitoring and voting of one signal; counts in frames */
struct rig_signal_config {
    double threshold;
    double threshold_triplex;
    double threshold_duplex;
    double reserved_0;
    double reserved_1;
    double filter_gain;
    double reference_threshold;
    double reference_airspeed_m_s;
    double second_threshold;
    int64_t common_persistence;
    double low;
    double high;
    int64_t persistence;
    int64_t split_persistence;
    int64_t trend_frames;
    int64_t readmit_frames;
    int64_t fade_frames;
    double deviation;
    double deviation_frames;
    int64_t fitted;
    int64_t tie_break[5];
    uint8_t common_fails;
    uint8_t wraps;
    uint8_t weighted;
    uint8_t pad_1[5];
};

RIG_ASSERT(sizeof(struct rig_signal_config) == 208);
RIG_ASSERT(offsetof(struct rig_signal_config, threshold) == 0);
RIG_ASSERT(offsetof(struct rig_signal_config, threshold_triplex) == 8);
RIG_ASSERT(offsetof(struct rig_signal_config, threshold_duplex) == 16);
RIG_ASSERT(offsetof(struct rig_signal_config, reserved_0) == 24);
RIG_ASSERT(offsetof(struct rig_signal_config, reserved_1) == 32);
RIG_ASSERT(offsetof(struct rig_signal_config, filter_gain) == 40);
RIG_ASSERT(offsetof(struct rig_signal_config, reference_threshold) == 48);
RIG_ASSERT(offsetof(struct rig_signal_config, reference_airspeed_m_s) == 56);
RIG_ASSERT(offsetof(struct rig_signal_config, second_threshold) == 64);
RIG_ASSERT(offsetof(struct rig_signal_config, common_persistence) == 72);
RIG_ASSERT(offsetof(struct rig_signal_config, low) == 80);
RIG_ASSERT(offsetof(struct rig_signal_config, high) == 88);
RIG_ASSERT(offsetof(struct rig_signal_config, persistence) == 96);
RIG_ASSERT(offsetof(struct rig_signal_config, split_persistence) == 104);
RIG_ASSERT(offsetof(struct rig_signal_config, trend_frames) == 112);
RIG_ASSERT(offsetof(struct rig_signal_config, readmit_frames) == 120);
RIG_ASSERT(offsetof(struct rig_signal_config, fade_frames) == 128);
RIG_ASSERT(offsetof(struct rig_signal_config, deviation) == 136);
RIG_ASSERT(offsetof(struct rig_signal_config, deviation_frames) == 144);
RIG_ASSERT(offsetof(struct rig_signal_config, fitted) == 152);
RIG_ASSERT(offsetof(struct rig_signal_config, tie_break) == 160);
RIG_ASSERT(offsetof(struct rig_signal_config, common_fails) == 200);
RIG_ASSERT(offsetof(struct rig_signal_config, wraps) == 201);
RIG_ASSERT(offsetof(struct rig_signal_config, weighted) == 202);
RIG_ASSERT(offsetof(struct rig_signal_config, pad_1) == 203);

/* monitoring and voting of one discrete; counts in frames */
struct rig_discrete_config {
    int64_t fitted;
    int64_t fail_safe;
    int64_t persistence;
    int64_t readmit_frames;
};

RIG_ASSERT(sizeof(struct rig_discrete_config) == 32);
RIG_ASSERT(offsetof(struct rig_discrete_config, fitted) == 0);
RIG_ASSERT(offsetof(struct rig_discrete_config, fail_safe) == 8);
RIG_ASSERT(offsetof(struct rig_discrete_config, persistence) == 16);
RIG_ASSERT(offsetof(struct rig_discrete_config, readmit_frames) == 24);

/* slow-fault rules of a signal: limits and durations; 0 switches a rule off */
struct rig_slow_faults_config {
    double reserved_2;
    double reserved_3;
    double slow_allowance;
    double slow_limit;
    int64_t stale_frames;
};

RIG_ASSERT(sizeof(struct rig_slow_faults_config) == 40);
RIG_ASSERT(offsetof(struct rig_slow_faults_config, reserved_2) == 0);
RIG_ASSERT(offsetof(struct rig_slow_faults_config, reserved_3) == 8);
RIG_ASSERT(offsetof(struct rig_slow_faults_config, slow_allowance) == 16);
RIG_ASSERT(offsetof(struct rig_slow_faults_config, slow_limit) == 24);
RIG_ASSERT(offsetof(struct rig_slow_faults_config, stale_frames) == 32);

/* rules of splits and counts, and relations of a signal to others */
struct rig_rules_config {
    double count_down;
    int64_t unresolved_frames;
    double trend_small;
    int64_t tells;
    int64_t sources;
    int64_t box;
    uint8_t trend_tumbles;
    uint8_t trend_beside_reference;
    uint8_t referred;
    uint8_t pad_1[5];
};

RIG_ASSERT(sizeof(struct rig_rules_config) == 56);
RIG_ASSERT(offsetof(struct rig_rules_config, count_down) == 0);
RIG_ASSERT(offsetof(struct rig_rules_config, unresolved_frames) == 8);
RIG_ASSERT(offsetof(struct rig_rules_config, trend_small) == 16);
RIG_ASSERT(offsetof(struct rig_rules_config, tells) == 24);
RIG_ASSERT(offsetof(struct rig_rules_config, sources) == 32);
RIG_ASSERT(offsetof(struct rig_rules_config, box) == 40);
RIG_ASSERT(offsetof(struct rig_rules_config, trend_tumbles) == 48);
RIG_ASSERT(offsetof(struct rig_rules_config, trend_beside_reference) == 49);
RIG_ASSERT(offsetof(struct rig_rules_config, referred) == 50);
RIG_ASSERT(offsetof(struct rig_rules_config, pad_1) == 51);

/* slow-fault tests of a signal; all 0: none */
struct rig_slow_tests_config {
    double slow_means;
    double slow_squares;
    double slow_halves;
    double slow_bias;
    double slow_scale;
    double slow_noise;
    double slow_skew;
    double slow_reference;
    double slow_reference_frames;
};

RIG_ASSERT(sizeof(struct rig_slow_tests_config) == 72);
RIG_ASSERT(offsetof(struct rig_slow_tests_config, slow_means) == 0);
RIG_ASSERT(offsetof(struct rig_slow_tests_config, slow_squares) == 8);
RIG_ASSERT(offsetof(struct rig_slow_tests_config, slow_halves) == 16);
RIG_ASSERT(offsetof(struct rig_slow_tests_config, slow_bias) == 24);
RIG_ASSERT(offsetof(struct rig_slow_tests_config, slow_scale) == 32);
RIG_ASSERT(offsetof(struct rig_slow_tests_config, slow_noise) == 40);
RIG_ASSERT(offsetof(struct rig_slow_tests_config, slow_skew) == 48);
RIG_ASSERT(offsetof(struct rig_slow_tests_config, slow_reference) == 56);
RIG_ASSERT(offsetof(struct rig_slow_tests_config, slow_reference_frames) == 64);

/* configuration of a flight */
struct rig_config {
    uint32_t magic;
    uint16_t version;
    uint16_t kind;
    uint64_t layout;
    uint64_t session;
    int64_t frame;
    double time_s;
    double rate_hz;
    int64_t role;
    int64_t box_signals;
    int64_t box_persistence;
    double trim_surface[4];
    double surface_low[4];
    double surface_high[4];
    struct rig_signal_config signal[16];
    struct rig_discrete_config discrete[3];
    char aircraft[64];
    char flight_point[64];
    struct rig_slow_faults_config slow_faults[16];
    struct rig_rules_config rules[16];
    struct rig_slow_tests_config slow_tests[16];
    uint32_t length;
    uint32_t crc;
};

RIG_ASSERT(sizeof(struct rig_config) == 6416);
RIG_ASSERT(offsetof(struct rig_config, magic) == 0);
RIG_ASSERT(offsetof(struct rig_config, version) == 4);
RIG_ASSERT(offsetof(struct rig_config, kind) == 6);
RIG_ASSERT(offsetof(struct rig_config, layout) == 8);
RIG_ASSERT(offsetof(struct rig_config, session) == 16);
RIG_ASSERT(offsetof(struct rig_config, frame) == 24);
RIG_ASSERT(offsetof(struct rig_config, time_s) == 32);
RIG_ASSERT(offsetof(struct rig_config, rate_hz) == 40);
RIG_ASSERT(offsetof(struct rig_config, role) == 48);
RIG_ASSERT(offsetof(struct rig_config, box_signals) == 56);
RIG_ASSERT(offsetof(struct rig_config, box_persistence) == 64);
RIG_ASSERT(offsetof(struct rig_config, trim_surface) == 72);
RIG_ASSERT(offsetof(struct rig_config, surface_low) == 104);
RIG_ASSERT(offsetof(struct rig_config, surface_high) == 136);
RIG_ASSERT(offsetof(struct rig_config, signal) == 168);
RIG_ASSERT(offsetof(struct rig_config, discrete) == 3496);
RIG_ASSERT(offsetof(struct rig_config, aircraft) == 3592);
RIG_ASSERT(offsetof(struct rig_config, flight_point) == 3656);
RIG_ASSERT(offsetof(struct rig_config, slow_faults) == 3720);
RIG_ASSERT(offsetof(struct rig_config, rules) == 4360);
RIG_ASSERT(offsetof(struct rig_config, slow_tests) == 5256);
RIG_ASSERT(offsetof(struct rig_config, length) == 6408);
RIG_ASSERT(offsetof(struct rig_config, crc) == 6412);

/* a part of config, if one message must fit into an Ethernet frame */
struct rig_config_part {
    uint32_t magic;
    uint16_t version;
    uint16_t kind;
    uint64_t layout;
    uint64_t session;
    int64_t frame;
    double time_s;
    uint32_t part;
    uint32_t parts;
    uint8_t bytes[1024];
    uint32_t length;
    uint32_t crc;
};

RIG_ASSERT(sizeof(struct rig_config_part) == 1080);
RIG_ASSERT(offsetof(struct rig_config_part, magic) == 0);
RIG_ASSERT(offsetof(struct rig_config_part, version) == 4);
RIG_ASSERT(offsetof(struct rig_config_part, kind) == 6);
RIG_ASSERT(offsetof(struct rig_config_part, layout) == 8);
RIG_ASSERT(offsetof(struct rig_config_part, session) == 16);
RIG_ASSERT(offsetof(struct rig_config_part, frame) == 24);
RIG_ASSERT(offsetof(struct rig_config_part, time_s) == 32);
RIG_ASSERT(offsetof(struct rig_config_part, part) == 40);
RIG_ASSERT(offsetof(struct rig_config_part, parts) == 44);
RIG_ASSERT(offsetof(struct rig_config_part, bytes) == 48);
RIG_ASSERT(offsetof(struct rig_config_part, length) == 1072);
RIG_ASSERT(offsetof(struct rig_config_part, crc) == 1076);

/* one frame to the unit: SI units, angles in rad, load factors in g, sticks -1 to 1 */
struct rig_input {
    uint32_t magic;
    uint16_t version;
    uint16_t kind;
    uint64_t layout;
    uint64_t session;
    int64_t frame;
    double time_s;
    double reference[16];
    double second_reference[16];
    double autopilot_command[5];
    double channels[16][4];
    double inertial[9];
    uint8_t valid[16][4];
    uint8_t ilm[16][4];
    uint8_t discrete_channels[3][4];
    uint8_t discrete_valid[3][4];
    uint8_t discrete_ilm[3][4];
    uint8_t reset[16];
    uint8_t discrete_reset[3];
    uint8_t pad_1[1];
    uint16_t age_us[16][4];
    uint32_t length;
    uint32_t crc;
};

RIG_ASSERT(sizeof(struct rig_input) == 1240);
RIG_ASSERT(offsetof(struct rig_input, magic) == 0);
RIG_ASSERT(offsetof(struct rig_input, version) == 4);
RIG_ASSERT(offsetof(struct rig_input, kind) == 6);
RIG_ASSERT(offsetof(struct rig_input, layout) == 8);
RIG_ASSERT(offsetof(struct rig_input, session) == 16);
RIG_ASSERT(offsetof(struct rig_input, frame) == 24);
RIG_ASSERT(offsetof(struct rig_input, time_s) == 32);
RIG_ASSERT(offsetof(struct rig_input, reference) == 40);
RIG_ASSERT(offsetof(struct rig_input, second_reference) == 168);
RIG_ASSERT(offsetof(struct rig_input, autopilot_command) == 296);
RIG_ASSERT(offsetof(struct rig_input, channels) == 336);
RIG_ASSERT(offsetof(struct rig_input, inertial) == 848);
RIG_ASSERT(offsetof(struct rig_input, valid) == 920);
RIG_ASSERT(offsetof(struct rig_input, ilm) == 984);
RIG_ASSERT(offsetof(struct rig_input, discrete_channels) == 1048);
RIG_ASSERT(offsetof(struct rig_input, discrete_valid) == 1060);
RIG_ASSERT(offsetof(struct rig_input, discrete_ilm) == 1072);
RIG_ASSERT(offsetof(struct rig_input, reset) == 1084);
RIG_ASSERT(offsetof(struct rig_input, discrete_reset) == 1100);
RIG_ASSERT(offsetof(struct rig_input, pad_1) == 1103);
RIG_ASSERT(offsetof(struct rig_input, age_us) == 1104);
RIG_ASSERT(offsetof(struct rig_input, length) == 1232);
RIG_ASSERT(offsetof(struct rig_input, crc) == 1236);

/* one frame to a unit of the role CONTROL_LAW: what the rig has voted */
struct rig_law_input {
    uint32_t magic;
    uint16_t version;
    uint16_t kind;
    uint64_t layout;
    uint64_t session;
    int64_t frame;
    double time_s;
    double autopilot_command[5];
    double inertial[9];
    double voted[16];
    double reference[16];
    uint8_t level[16];
    uint8_t reference_usable[16];
    uint8_t discrete_voted[3];
    uint8_t discrete_level[3];
    uint8_t pad_1[2];
    uint32_t length;
    uint32_t crc;
};

RIG_ASSERT(sizeof(struct rig_law_input) == 456);
RIG_ASSERT(offsetof(struct rig_law_input, magic) == 0);
RIG_ASSERT(offsetof(struct rig_law_input, version) == 4);
RIG_ASSERT(offsetof(struct rig_law_input, kind) == 6);
RIG_ASSERT(offsetof(struct rig_law_input, layout) == 8);
RIG_ASSERT(offsetof(struct rig_law_input, session) == 16);
RIG_ASSERT(offsetof(struct rig_law_input, frame) == 24);
RIG_ASSERT(offsetof(struct rig_law_input, time_s) == 32);
RIG_ASSERT(offsetof(struct rig_law_input, autopilot_command) == 40);
RIG_ASSERT(offsetof(struct rig_law_input, inertial) == 80);
RIG_ASSERT(offsetof(struct rig_law_input, voted) == 152);
RIG_ASSERT(offsetof(struct rig_law_input, reference) == 280);
RIG_ASSERT(offsetof(struct rig_law_input, level) == 408);
RIG_ASSERT(offsetof(struct rig_law_input, reference_usable) == 424);
RIG_ASSERT(offsetof(struct rig_law_input, discrete_voted) == 440);
RIG_ASSERT(offsetof(struct rig_law_input, discrete_level) == 443);
RIG_ASSERT(offsetof(struct rig_law_input, pad_1) == 446);
RIG_ASSERT(offsetof(struct rig_law_input, length) == 448);
RIG_ASSERT(offsetof(struct rig_law_input, crc) == 452);

/* one frame from the unit */
struct rig_output {
    uint32_t magic;
    uint16_t version;
    uint16_t kind;
    uint64_t layout;
    uint64_t session;
    int64_t frame;
    double time_s;
    uint64_t stepped;
    double voted[16];
    double surface[4];
    uint8_t state[16][4];
    uint8_t level[16];
    uint8_t pattern[16];
    uint8_t decided_by[16];
    uint8_t reference_usable[16];
    uint8_t common_mode[16];
    uint8_t trend_high[16];
    uint8_t trend_low[16];
    uint8_t discrete_voted[3];
    uint8_t discrete_state[3][4];
    uint8_t discrete_level[3];
    uint8_t law;
    uint8_t said;
    uint32_t fault_word;
    uint16_t status;
    uint8_t output_discretes[8];
    uint8_t pad_1[6];
    uint32_t length;
    uint32_t crc;
};

RIG_ASSERT(sizeof(struct rig_output) == 432);
RIG_ASSERT(offsetof(struct rig_output, magic) == 0);
RIG_ASSERT(offsetof(struct rig_output, version) == 4);
RIG_ASSERT(offsetof(struct rig_output, kind) == 6);
RIG_ASSERT(offsetof(struct rig_output, layout) == 8);
RIG_ASSERT(offsetof(struct rig_output, session) == 16);
RIG_ASSERT(offsetof(struct rig_output, frame) == 24);
RIG_ASSERT(offsetof(struct rig_output, time_s) == 32);
RIG_ASSERT(offsetof(struct rig_output, stepped) == 40);
RIG_ASSERT(offsetof(struct rig_output, voted) == 48);
RIG_ASSERT(offsetof(struct rig_output, surface) == 176);
RIG_ASSERT(offsetof(struct rig_output, state) == 208);
RIG_ASSERT(offsetof(struct rig_output, level) == 272);
RIG_ASSERT(offsetof(struct rig_output, pattern) == 288);
RIG_ASSERT(offsetof(struct rig_output, decided_by) == 304);
RIG_ASSERT(offsetof(struct rig_output, reference_usable) == 320);
RIG_ASSERT(offsetof(struct rig_output, common_mode) == 336);
RIG_ASSERT(offsetof(struct rig_output, trend_high) == 352);
RIG_ASSERT(offsetof(struct rig_output, trend_low) == 368);
RIG_ASSERT(offsetof(struct rig_output, discrete_voted) == 384);
RIG_ASSERT(offsetof(struct rig_output, discrete_state) == 387);
RIG_ASSERT(offsetof(struct rig_output, discrete_level) == 399);
RIG_ASSERT(offsetof(struct rig_output, law) == 402);
RIG_ASSERT(offsetof(struct rig_output, said) == 403);
RIG_ASSERT(offsetof(struct rig_output, fault_word) == 404);
RIG_ASSERT(offsetof(struct rig_output, status) == 408);
RIG_ASSERT(offsetof(struct rig_output, output_discretes) == 410);
RIG_ASSERT(offsetof(struct rig_output, pad_1) == 418);
RIG_ASSERT(offsetof(struct rig_output, length) == 424);
RIG_ASSERT(offsetof(struct rig_output, crc) == 428);

/* The records for which a library was built: the rig reads this before it calls a function. */
#if defined(__GNUC__)
extern __attribute__((weak, visibility("default"))) const uint64_t rig_unit_layout;
const uint64_t rig_unit_layout = RIG_UNIT_LAYOUT;
#endif

int rig_unit_open(const struct rig_config *config);
int rig_unit_step(const struct rig_input *input, struct rig_output *output);
int rig_unit_law(const struct rig_law_input *input, struct rig_output *output);
void rig_unit_close(void);

#ifdef __cplusplus
}
#endif
#endif
