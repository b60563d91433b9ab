/* Lockstep for a simulated flight controller that has a clock of its own: a library for LD_PRELOAD.
 *
 * The firmware is unmodified.  Its main thread reads CLOCK_MONOTONIC and sleeps between two passes; its other threads
 * wait for datagrams and connections in select.  The library replaces these calls, so that threads take turns:
 *
 *  - Time runs only while the main thread runs: LOOK_NS for each reading of the clock, and the length of each sleep.
 *    The number of passes in a frame does not depend on the machine.
 *  - At the end of its frame the main thread waits in its sleep, where it holds no lock: the gate.
 *  - Other threads start, and return from select, only while the main thread waits at the gate, one at a time.  Each
 *    input gets one datagram a frame.  When all inputs have theirs and no thread has the turn, the next frame begins.
 *  - Each socket is bound to a free port of the loopback interface, which the library reports (lockstep.h).
 *
 * While the main thread waits for the end of a thread, all run freely.
 */
#define _GNU_SOURCE
#include <arpa/inet.h>
#include <dlfcn.h>
#include <netinet/in.h>
#include <pthread.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <sys/select.h>
#include <sys/socket.h>
#include <time.h>

#include "lockstep.h"

#define LOOK_NS 500
#define SECOND_NS INT64_C(1000000000)
#define MOMENT_NS 20000000
#define MOST_INPUTS 4

struct input {
    int port, fd;
    bool reading;  /* its thread has a datagram of this frame */
    bool finished; /* and has done with it */
};

struct routine {
    void *(*run)(void *);
    void *argument;
};

static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
static pthread_cond_t moved = PTHREAD_COND_INITIALIZER;
static pthread_t main_thread;
static struct input input[MOST_INPUTS];
static int inputs, messages = -1;
static int output_wanted, output_given;
static int64_t now_ns, gate_ns, frame_ns; /* of the main thread, of the end of its frame */
static uint64_t frames;
static bool at_gate, turn_taken, all_free;
static __thread bool has_turn;

static int (*real_bind)(int, const struct sockaddr *, socklen_t);
static ssize_t (*real_recvfrom)(int, void *, size_t, int, struct sockaddr *, socklen_t *);
static ssize_t (*real_sendto)(int, const void *, size_t, int, const struct sockaddr *, socklen_t);
static int (*real_select)(int, fd_set *, fd_set *, fd_set *, struct timeval *);
static int (*real_gettime)(clockid_t, struct timespec *);
static int (*real_sleep)(const struct timespec *, struct timespec *);
static int (*real_create)(pthread_t *, const pthread_attr_t *, void *(*)(void *), void *);
static int (*real_join)(pthread_t, void **);

static int64_t number(const char *name)
{
    const char *text = getenv(name);
    return text != NULL ? strtoll(text, NULL, 10) : 0;
}

__attribute__((constructor)) static void start(void)
{
    *(void **)&real_bind = dlsym(RTLD_NEXT, "bind");
    *(void **)&real_recvfrom = dlsym(RTLD_NEXT, "recvfrom");
    *(void **)&real_sendto = dlsym(RTLD_NEXT, "sendto");
    *(void **)&real_select = dlsym(RTLD_NEXT, "select");
    *(void **)&real_gettime = dlsym(RTLD_NEXT, "clock_gettime");
    *(void **)&real_sleep = dlsym(RTLD_NEXT, "nanosleep");
    *(void **)&real_create = dlsym(RTLD_NEXT, "pthread_create");
    *(void **)&real_join = dlsym(RTLD_NEXT, "pthread_join");
    main_thread = pthread_self();
    frame_ns = number("LOCKSTEP_FRAME_NS");
    gate_ns = number("LOCKSTEP_BOOT_NS");
    messages = frame_ns > 0 ? (int)number("LOCKSTEP_FD") : -1;
    const char *ports = getenv("LOCKSTEP_INPUTS"), *output = getenv("LOCKSTEP_OUTPUT");
    for (char *rest; ports != NULL && inputs < MOST_INPUTS; ports = rest) {
        const int port = (int)strtol(ports, &rest, 10);
        if (rest == ports) {
            break;
        }
        input[inputs++] = (struct input){.port = port, .fd = -1};
    }
    if (output != NULL) {
        char *rest;
        output_wanted = (int)strtol(output, &rest, 10);
        output_given = *rest == '=' ? (int)strtol(rest + 1, NULL, 10) : 0;
    }
}

static bool on(void)
{
    return messages >= 0;
}

static void tell(enum lockstep_kind kind, int wanted, int given)
{
    const struct lockstep_message message = {(uint32_t)kind, (uint16_t)wanted, (uint16_t)given, frames};
    (void)!send(messages, &message, sizeof message, MSG_NOSIGNAL);
}

/* Wait until something has moved, or a moment: glibc before 2.41 can lose the wake-up of a condition (bug 25847). */
static void wait(void)
{
    struct timespec until;
    real_gettime(CLOCK_REALTIME, &until);
    until.tv_nsec += MOMENT_NS;
    until.tv_sec += until.tv_nsec / SECOND_NS;
    until.tv_nsec %= SECOND_NS;
    pthread_cond_timedwait(&moved, &mutex, &until);
}

/* ---- The clock ---- */

int clock_gettime(clockid_t clock, struct timespec *time)
{
    if (!on() || clock != CLOCK_MONOTONIC) {
        return real_gettime(clock, time);
    }
    pthread_mutex_lock(&mutex);
    const bool main = pthread_equal(pthread_self(), main_thread);
    now_ns += main ? LOOK_NS : 0;
    const int64_t seen = main ? now_ns : gate_ns;
    pthread_mutex_unlock(&mutex);
    time->tv_sec = seen / SECOND_NS;
    time->tv_nsec = seen % SECOND_NS;
    return 0;
}

int nanosleep(const struct timespec *wanted, struct timespec *rest)
{
    if (!on() || !pthread_equal(pthread_self(), main_thread)) {
        return real_sleep(wanted, rest);
    }
    pthread_mutex_lock(&mutex);
    now_ns += wanted->tv_sec * SECOND_NS + wanted->tv_nsec;
    while (now_ns >= gate_ns) {
        if (!at_gate) {
            at_gate = true;
            tell(LOCKSTEP_GATE, 0, 0);
            pthread_cond_broadcast(&moved);
        }
        wait();
    }
    pthread_mutex_unlock(&mutex);
    return 0;
}

/* ---- The turns of the other threads ---- */

/* Let the main thread go on when all inputs have had their datagram. */
static void begin_frame(void)
{
    for (int i = 0; i < inputs; i++) {
        if (!input[i].finished) {
            return;
        }
    }
    for (int i = 0; i < inputs; i++) {
        input[i].finished = false;
    }
    frames++;
    gate_ns += frame_ns;
    at_gate = false;
}

static void give_turn(struct input *of)
{
    pthread_mutex_lock(&mutex);
    turn_taken = turn_taken && !has_turn;
    has_turn = false;
    if (of != NULL && of->reading) {
        of->reading = false;
        of->finished = true;
        begin_frame();
    }
    pthread_cond_broadcast(&moved);
    pthread_mutex_unlock(&mutex);
}

static void take_turn(const struct input *of)
{
    pthread_mutex_lock(&mutex);
    while (!all_free && (!at_gate || turn_taken || (of != NULL && of->finished))) {
        wait();
    }
    turn_taken = has_turn = true;
    pthread_mutex_unlock(&mutex);
}

static void *run_in_turn(void *data)
{
    const struct routine routine = *(struct routine *)data;
    free(data);
    take_turn(NULL);
    void *result = routine.run(routine.argument);
    give_turn(NULL);
    return result;
}

int pthread_create(pthread_t *thread, const pthread_attr_t *attributes, void *(*run)(void *), void *argument)
{
    struct routine *routine = on() ? malloc(sizeof *routine) : NULL;
    if (routine == NULL) {
        return real_create(thread, attributes, run, argument);
    }
    *routine = (struct routine){run, argument};
    return real_create(thread, attributes, run_in_turn, routine);
}

int pthread_join(pthread_t thread, void **result)
{
    pthread_mutex_lock(&mutex);
    all_free = true;
    pthread_cond_broadcast(&moved);
    pthread_mutex_unlock(&mutex);
    return real_join(thread, result);
}

int select(int n, fd_set *in, fd_set *out, fd_set *except, struct timeval *limit)
{
    struct input *of = NULL;
    if (!on() || pthread_equal(pthread_self(), main_thread)) {
        return real_select(n, in, out, except, limit);
    }
    for (int i = 0; in != NULL && i < inputs; i++) {
        of = input[i].fd >= 0 && input[i].fd < n && FD_ISSET(input[i].fd, in) ? &input[i] : of;
    }
    give_turn(of);
    const int ready = real_select(n, in, out, except, limit);
    take_turn(of);
    return ready;
}

ssize_t recvfrom(int fd, void *data, size_t size, int flags, struct sockaddr *from, socklen_t *length)
{
    const ssize_t got = real_recvfrom(fd, data, size, flags, from, length);
    for (int i = 0; on() && i < inputs; i++) {
        input[i].reading = input[i].reading || (input[i].fd == fd && got > 0);
    }
    return got;
}

/* ---- The ports ---- */

/* The port lies in the same place in the addresses of both families. */
static int port_of(const struct sockaddr *address)
{
    const bool ip = address != NULL && (address->sa_family == AF_INET || address->sa_family == AF_INET6);
    return ip ? ntohs(((const struct sockaddr_in *)address)->sin_port) : 0;
}

int bind(int fd, const struct sockaddr *address, socklen_t length)
{
    const int wanted = port_of(address);
    if (!on() || wanted == 0) {
        return real_bind(fd, address, length);
    }
    struct sockaddr_in6 any = {.sin6_family = AF_INET6}; /* as ::ffff:127.0.0.1 */
    any.sin6_addr.s6_addr[10] = any.sin6_addr.s6_addr[11] = 0xff;
    any.sin6_addr.s6_addr[12] = 127;
    any.sin6_addr.s6_addr[15] = 1;
    if (address->sa_family == AF_INET) {
        *(struct sockaddr_in *)&any =
            (struct sockaddr_in){.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    }
    socklen_t size = length;
    if (real_bind(fd, (const struct sockaddr *)&any, length) != 0
        || getsockname(fd, (struct sockaddr *)&any, &size) != 0) {
        return -1;
    }
    for (int i = 0; i < inputs; i++) {
        input[i].fd = input[i].port == wanted ? fd : input[i].fd;
    }
    tell(LOCKSTEP_PORT, wanted, port_of((const struct sockaddr *)&any));
    return 0;
}

ssize_t sendto(int fd, const void *data, size_t size, int flags, const struct sockaddr *to, socklen_t length)
{
    const int wanted = port_of(to);
    if (!on() || wanted == 0) {
        return real_sendto(fd, data, size, flags, to, length);
    }
    if (wanted != output_wanted) {
        return (ssize_t)size;
    }
    const struct sockaddr_in given = {
        .sin_family = AF_INET,
        .sin_port = htons((uint16_t)output_given),
        .sin_addr.s_addr = htonl(INADDR_LOOPBACK),
    };
    return real_sendto(fd, data, size, flags, (const struct sockaddr *)&given, sizeof given);
}
