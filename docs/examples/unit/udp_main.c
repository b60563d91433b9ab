/* Makes a process of any unit: its functions behind a UDP socket.  CONFIG names the role, and so rig_unit_step or rig_unit_law.
 *
 *     ./monitor_udp --rig ADDRESS:PORT            says READY to the rig, which waits there; ends when the rig is gone
 *     ./monitor_udp --listen PORT                 waits for a HELLO and answers its sender
 *     ./monitor_udp --listen ADDRESS:PORT         the same at one address of this machine
 *
 * One message in, at most one out; no thread, no time limit: the rig alone steps the unit.  HELLO and CONFIG may come
 * again, as datagrams are lost: they are answered again and change nothing.  SIGHUP restarts it, as a power cut would.
 */
#define _POSIX_C_SOURCE 200809L
#include <arpa/inet.h>
#include <errno.h>
#include <netinet/in.h>
#include <inttypes.h>
#include <sched.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>

#include "rig_unit.h"

#pragma weak rig_unit_step /* a unit has one of them, or both: the other is NULL */
#pragma weak rig_unit_law

#ifndef UNIT_NAME
#define UNIT_NAME "unit"
#endif
#define PART_BYTES 1024
#define SILENCE_S 3 /* after which another rig may have the unit */
#define PARTS ((sizeof(struct rig_config) + PART_BYTES - 1) / PART_BYTES)

union message {
    struct rig_hello head; /* what every message begins with; END is no more than that */
    struct rig_config_part part;
    struct rig_input input;
    struct rig_law_input law_input;
    uint8_t bytes[2048]; /* more than any has, so that one that is too long is noticed */
};

static int fd;
static int looks;              /* for a message before it sleeps: to be woken takes longer than a frame of the rig */
static bool connected;         /* to one rig, by --rig */
static struct sockaddr_in rig; /* whom to answer: of the session */
static uint64_t session;       /* 0: none */
static time_t heard_at;        /* when it last sent a message of it */
static volatile sig_atomic_t restart;
static uint8_t config[PARTS * PART_BYTES];
static bool here[PARTS]; /* the parts of CONFIG that have come */
static bool opened;
static bool law; /* its role is the control law */
static bool gone; /* the rig that we are connected to */

static void answer(const struct sockaddr_in *whom, const void *record, size_t size)
{
    const struct sockaddr *to = connected ? NULL : (const struct sockaddr *)whom;
    if (sendto(fd, record, size, 0, to, connected ? 0 : sizeof *whom) < 0 && connected && errno == ECONNREFUSED) {
        gone = true; /* any other loss is the rig's to notice */
    }
}

static void say(const struct sockaddr_in *whom, uint16_t kind, uint64_t of, const char *text, int64_t frame)
{
    struct rig_ready ready = {.magic = RIG_MAGIC_OUTPUT, .version = RIG_UNIT_VERSION, .kind = kind};
    ready.layout = RIG_UNIT_LAYOUT;
    ready.session = of;
    ready.frame = frame;
    ready.length = offsetof(struct rig_ready, length);
    snprintf(ready.text, sizeof ready.text, "%s", text);
    answer(whom, &ready, sizeof ready);
}

static void begin_session(uint64_t number)
{
    if (opened) {
        rig_unit_close();
    }
    opened = false;
    memset(here, 0, sizeof here);
    session = number;
}

/* Keep one part; with the last of them open the unit.  A part that comes again finds it open. */
static void configure(const struct rig_config_part *part)
{
    struct rig_config whole;
    if (part->parts != PARTS || part->part >= PARTS) {
        return;
    }
    if (opened) {
        say(&rig, RIG_KIND_READY, session, UNIT_NAME, 0);
        return;
    }
    memcpy(config + part->part * PART_BYTES, part->bytes, PART_BYTES);
    here[part->part] = true;
    for (size_t i = 0; i < PARTS; i++) {
        if (!here[i]) {
            return;
        }
    }
    memcpy(&whole, config, sizeof whole);
    begin_session(session);
    law = whole.role == RIG_ROLE_CONTROL_LAW;
    if (law ? rig_unit_law == NULL : rig_unit_step == NULL) {
        say(&rig, RIG_KIND_REFUSED, session, law ? UNIT_NAME " is no control law" : UNIT_NAME " is a control law", 0);
        return;
    }
    opened = rig_unit_open(&whole) == 0;
    if (opened) {
        say(&rig, RIG_KIND_READY, session, UNIT_NAME, 0);
    } else {
        say(&rig, RIG_KIND_REFUSED, session, UNIT_NAME " cannot fly with this CONFIG", 0);
    }
}

static void step(const union message *m)
{
    const struct rig_input *input = &m->input; /* the head is the same in both records */
    struct rig_output output = {.magic = RIG_MAGIC_OUTPUT, .version = RIG_UNIT_VERSION, .kind = RIG_KIND_REPLY};
    output.layout = RIG_UNIT_LAYOUT;
    output.session = session;
    output.frame = input->frame;
    output.time_s = input->time_s;
    output.length = offsetof(struct rig_output, length);
    if (!opened) {
        return;
    }
    if ((law ? rig_unit_law(&m->law_input, &output) : rig_unit_step(input, &output)) == 0) {
        answer(&rig, &output, sizeof output);
    } else {
        say(&rig, RIG_KIND_REFUSED, session, UNIT_NAME " cannot step", input->frame);
    }
}

/* CRC-32 of IEEE 802.3, four bits at a time. */
static uint32_t crc32_of(const uint8_t *bytes, size_t count)
{
    static const uint32_t table[16] = {0x00000000, 0x1db71064, 0x3b6e20c8, 0x26d930ac, 0x76dc4190, 0x6b6b51f4,
                                       0x4db26158, 0x5005713c, 0xedb88320, 0xf00f9344, 0xd6d6a3e8, 0xcb61b38c,
                                       0x9b64c2b0, 0x86d3d2d4, 0xa00ae278, 0xbdbdf21c};
    uint32_t crc = UINT32_MAX;
    for (size_t i = 0; i < count; i++) {
        crc = table[(crc ^ bytes[i]) & 15U] ^ (crc >> 4);
        crc = table[(crc ^ (uint32_t)(bytes[i] >> 4)) & 15U] ^ (crc >> 4);
    }
    return ~crc;
}

/* Whether these bytes are a whole message of this layout, with its checksum. */
static bool sound(const union message *m, size_t size)
{
    size_t wanted = sizeof m->head;
    uint32_t tail[2] = {0, 0}; /* length, crc */
    if (m->head.kind == RIG_KIND_CONFIG || m->head.kind == RIG_KIND_FRAME) {
        const size_t of_frame = law ? sizeof m->law_input : sizeof m->input;
        wanted = m->head.kind == RIG_KIND_CONFIG ? sizeof m->part : of_frame;
    }
    if (size != wanted || m->head.magic != RIG_MAGIC_INPUT || m->head.layout != RIG_UNIT_LAYOUT) {
        return false;
    }
    memcpy(tail, m->bytes + size - sizeof tail, sizeof tail);
    return tail[0] == size - sizeof tail && (tail[1] == 0 || tail[1] == crc32_of(m->bytes, tail[0]));
}

static time_t now(void)
{
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return time.tv_sec;
}

static bool same(const struct sockaddr_in *a, const struct sockaddr_in *b)
{
    return a->sin_addr.s_addr == b->sin_addr.s_addr && a->sin_port == b->sin_port;
}

/* READY of no session means 'I am here'.  One rig at a time: another waits for END, or for SILENCE_S. */
static void greet(uint64_t number, const struct sockaddr_in *from)
{
    char text[sizeof((struct rig_ready *)0)->text];
    if (session != 0 && !same(from, &rig) && now() - heard_at < SILENCE_S) {
        snprintf(text, sizeof text, "busy with session %" PRIu64, session);
        say(from, RIG_KIND_REFUSED, number, text, 0);
        return;
    }
    if (number != session) {
        rig = *from;
        begin_session(number);
        heard_at = now();
    }
    say(&rig, RIG_KIND_READY, 0, UNIT_NAME, 0);
}

static void handle(const union message *m, const struct sockaddr_in *from)
{
    if (m->head.kind == RIG_KIND_HELLO) {
        greet(m->head.session, from);
        return;
    }
    if (session == 0 && m->head.kind == RIG_KIND_FRAME) { /* it has restarted, and the rig does not know */
        say(from, RIG_KIND_READY, 0, UNIT_NAME, 0);
    }
    if (session == 0 || m->head.session != session) {
        return;
    }
    heard_at = now();
    if (m->head.kind == RIG_KIND_CONFIG) {
        configure(&m->part);
    } else if (m->head.kind == RIG_KIND_FRAME) {
        step(m);
    } else if (m->head.kind == RIG_KIND_END) {
        begin_session(0);
    }
}

/* The next message, its size, -1 with errno. */
static ssize_t receive(union message *m, struct sockaddr_in *from)
{
    for (int looked = 0;; looked++) {
        socklen_t length = sizeof *from;
        const int flags = looked < looks ? MSG_DONTWAIT : 0;
        const ssize_t size = recvfrom(fd, m, sizeof *m, flags, (struct sockaddr *)from, &length);
        if (size >= 0 || flags == 0 || (errno != EAGAIN && errno != EWOULDBLOCK)) {
            return size;
        }
        if (looked % 8 == 7) {
            sched_yield();
        }
    }
}

/* Serve until the rig is gone; with --listen for ever.  Returns the exit code. */
static int serve(void)
{
    static union message m;
    bool heard = false;
    while (!gone) {
        struct sockaddr_in from;
        if (restart) {
            restart = 0;
            begin_session(0);
            if (connected) {
                say(&rig, RIG_KIND_READY, 0, UNIT_NAME, 0);
            }
        }
        const ssize_t size = receive(&m, &from);
        if (size >= (ssize_t)sizeof m.head && sound(&m, (size_t)size)) {
            heard = true;
            handle(&m, &from);
        } else if (size < 0 && errno == ECONNREFUSED) {
            gone = connected; /* a listener answers the next client */
        } else if (size < 0 && errno != EINTR) {
            perror(UNIT_NAME);
            return EXIT_FAILURE;
        }
    }
    begin_session(0);
    return heard ? EXIT_SUCCESS : EXIT_FAILURE;
}

static void ask_restart(int number)
{
    (void)number;
    restart = 1;
}

/* ADDRESS:PORT, or PORT alone for every address of this machine. */
static bool parse(const char *text, struct sockaddr_in *found)
{
    char address[INET_ADDRSTRLEN] = "0.0.0.0";
    unsigned port = 0;
    const bool whole = sscanf(text, "%15[0-9.]:%5u", address, &port) == 2;
    if (!whole && (strspn(text, "0123456789") != strlen(text) || sscanf(text, "%5u", &port) != 1)) {
        return false;
    }
    found->sin_family = AF_INET;
    found->sin_port = htons((uint16_t)port);
    return port > 0 && port <= UINT16_MAX && inet_pton(AF_INET, whole ? address : "0.0.0.0", &found->sin_addr) == 1;
}

int main(int argc, char **argv)
{
    connected = argc == 3 && strcmp(argv[1], "--rig") == 0;
    if (argc != 3 || (!connected && strcmp(argv[1], "--listen") != 0) || !parse(argv[2], &rig)) {
        fprintf(stderr, "usage: %s --rig ADDRESS:PORT | --listen [ADDRESS:]PORT\n", argv[0]);
        return 2;
    }
    if (getenv("RIG_UNIT_LOOKS") != NULL) { /* the rig says it, if it knows that a core is free for it */
        looks = atoi(getenv("RIG_UNIT_LOOKS"));
    }
    fd = socket(AF_INET, SOCK_DGRAM, 0);
    if (fd < 0 || (connected ? connect : bind)(fd, (const struct sockaddr *)&rig, sizeof rig) != 0) {
        perror(UNIT_NAME);
        return EXIT_FAILURE;
    }
    const struct sigaction on_hangup = {.sa_handler = ask_restart}; /* without SA_RESTART: recvfrom ends with EINTR */
    sigaction(SIGHUP, &on_hangup, NULL);
    if (connected) {
        say(&rig, RIG_KIND_READY, 0, UNIT_NAME, 0);
    }
    return serve();
}
