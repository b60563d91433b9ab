/* What the clock library tells the program that steps the firmware: messages on a socket pair (SOCK_SEQPACKET).
 *
 * Environment of the firmware:
 *
 *     LD_PRELOAD         liblockstep.so
 *     LOCKSTEP_FD        the library's end of the socket pair
 *     LOCKSTEP_FRAME_NS  length of a frame
 *     LOCKSTEP_BOOT_NS   time of the firmware before the first frame
 *     LOCKSTEP_INPUTS    UDP ports, such as "9003 9004": one datagram on each of them makes a frame
 *     LOCKSTEP_OUTPUT    "9001=40123": datagrams to port 9001 go to port 40123; all others are dropped
 */
#ifndef LOCKSTEP_H
#define LOCKSTEP_H

#include <stdint.h>

enum lockstep_kind {
    LOCKSTEP_PORT = 1, /* a socket of the firmware has another port: wanted, given */
    LOCKSTEP_GATE = 2, /* the main thread waits for the next frame; it has finished `frames` of them */
};

struct lockstep_message {
    uint32_t kind;
    uint16_t wanted, given;
    uint64_t frames;
};

#endif
