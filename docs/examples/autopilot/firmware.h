/* Betaflight's simulator build as a process: its start, its frames, its settings, its end. */
#ifndef FIRMWARE_H
#define FIRMWARE_H

#include <stdbool.h>
#include <stdint.h>

struct state_packet { /* to port 9003; body axes forward, right, down except where noted */
    double time_s, rate[3];  /* rad/s */
    double acceleration[3];  /* m/s2, the negative of specific force forward, left, up */
    double quaternion[4];    /* w, x, y, z of the body axes in north-east-down */
    double velocity[3], position[3], pressure;
};

struct stick_packet { /* to port 9004; channels in us, 1000 to 2000 */
    double time_s;
    uint16_t channel[16];
};

struct servo_packet { /* from port 9001, in us: motor, then servos */
    uint16_t motors;
    float pwm[16];
};

enum { STICK_ROLL, STICK_PITCH, STICK_THROTTLE, STICK_YAW, SWITCH_ARM, SWITCH_ANGLE };
enum { PWM_MOTOR = 0, PWM_AILERON = 2, PWM_RUDDER = 4, PWM_ELEVATOR = 5 };

/* Start the firmware at `rate_hz` with settings from files, whose names are separated by colons.  Each function returns
 * false after it has printed the reason. */
bool firmware_start(double rate_hz, const char *settings);

/* From here on a firmware that does not answer is waited for: the rig ends the wait. */
void firmware_fly(void);

/* Run one frame; time_s of both packets is set here.  The answer is left as it was when the firmware sends none. */
bool firmware_frame(struct state_packet *state, struct stick_packet *sticks, struct servo_packet *answer,
                    bool *answered);

/* End the firmware and remove its folder. */
void firmware_stop(void);

/* Print one line that begins with the name of the unit. */
void report(const char *format, ...) __attribute__((format(printf, 1, 2)));

/* The packets of an aircraft that stands on the ground, its switches off. */
void neutral(struct state_packet *state, struct stick_packet *sticks);

/* ---- Between firmware.c and settings.c ---- */

/* The folder of the firmware, and the TCP port of its command line. */
const char *firmware_folder(void);
int firmware_tcp_port(void);

/* Start the process in its folder and run it until it waits for its first frame. */
bool firmware_begin(double rate_hz);

/* End the process, but keep its folder. */
void firmware_end(void);

/* Run frames until the process has ended by itself, as it was asked to; whether it has. */
bool firmware_await_end(void);

/* Write the settings into eeprom.bin of the folder: start the firmware for it, or take them from the last session. */
bool write_settings(double rate_hz, const char *names);

#endif
