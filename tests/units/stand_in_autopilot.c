/* A firmware for the tests of docs/examples/autopilot: the ports, threads and clock of Betaflight's simulator build.
 *
 * Its main thread makes a pass every 100 us of CLOCK_MONOTONIC; threads receive state (9003), sticks (9004) and lines of
 * a command line (TCP 5761).  It arms as the real one does.  The file MODE beside the program holds what is wrong:
 *
 *     no-servos refuses-settings never-saves quits stuck silent never-arms disarms nan dies reversed
 *     clock    its elevator shows the number of passes in the frame
 *     records  what it receives goes to files beside it: states, sticks, lines
 */
#define _GNU_SOURCE
#include <arpa/inet.h>
#include <math.h>
#include <netinet/tcp.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/select.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

struct state {
    double time_s, rate[3], acceleration[3], quaternion[4], velocity[3], position[3], pressure;
};
struct sticks {
    double time_s;
    uint16_t channel[16];
};
struct servos {
    uint16_t motors;
    float pwm[16];
};

static char mode[64], beside[4096];
static struct state state;
static struct sticks sticks;
static volatile int states, lines; /* received */
static char line[256];
static int client = -1;

static int is(const char *name)
{
    return strcmp(mode, name) == 0;
}

static double now_s(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static void record(const char *name, const void *data, size_t size)
{
    char path[4200];
    snprintf(path, sizeof path, "%s%s", beside, name);
    FILE *file = is("records") ? fopen(path, "a") : NULL;
    if (file != NULL) {
        fwrite(data, 1, size, file);
        fclose(file);
    }
}

static int bound(int kind, int port)
{
    struct sockaddr_in here = {.sin_family = AF_INET, .sin_port = htons((uint16_t)port)};
    const int fd = socket(AF_INET, kind, 0);
    if (bind(fd, (struct sockaddr *)&here, sizeof here) != 0 || (kind == SOCK_STREAM && listen(fd, 1) != 0)) {
        exit(3);
    }
    return fd;
}

static int readable(int fd)
{
    struct timeval limit = {.tv_usec = 100000};
    fd_set in;
    FD_ZERO(&in);
    FD_SET(fd, &in);
    return select(fd + 1, &in, NULL, NULL, &limit) == 1;
}

static void *receive(void *data)
{
    const int fd = *(int *)data;
    char bytes[sizeof(struct state)];
    for (;;) {
        const ssize_t size = readable(fd) ? recvfrom(fd, bytes, sizeof bytes, 0, NULL, NULL) : 0;
        if (size == sizeof state) {
            memcpy(&state, bytes, sizeof state);
            record("states", bytes, sizeof state);
            states++;
        } else if (size == sizeof sticks) {
            memcpy(&sticks, bytes, sizeof sticks);
            record("sticks", bytes, sizeof sticks);
        }
    }
    return NULL;
}

static void *serve(void *data)
{
    const int door = *(int *)data;
    for (;;) {
        if (client < 0) {
            client = readable(door) ? accept(door, NULL, NULL) : -1;
            /* An answer in parts would wait 40 ms for the acknowledgement of its first part. */
            setsockopt(client, IPPROTO_TCP, TCP_NODELAY, &(int){1}, sizeof(int));
        } else if (readable(client)) {
            const ssize_t size = recv(client, line, sizeof line - 1, 0);
            line[size > 0 ? size : 0] = '\0';
            record("lines", line, strlen(line));
            lines += size > 0;
        }
    }
    return NULL;
}

static void say(const char *text)
{
    (void)!send(client, text, strlen(text), MSG_NOSIGNAL);
}

/* One line of the command line, by the main thread. */
static void obey(void)
{
    const int save = strncmp(line, "save", 4) == 0;
    if (save && !is("never-saves")) {
        FILE *file = fopen("eeprom.bin", "w");
        fputs("settings", file);
        fclose(file);
        exit(0);
    }
    say(line);
    say(is("no-servos") && strncmp(line, "servo", 5) == 0 ? "###ERROR IN servo: UNKNOWN COMMAND, TRY 'HELP'###" : "");
    say(is("refuses-settings") && strncmp(line, "set p_pitch", 11) == 0 ? "###ERROR IN set: INVALID VALUE###\r\nAllowed range: 0 - 9" : "");
    say("\r\n# ");
}

static float servo(double change)
{
    return (float)fmin(fmax(1500.0 + change, 1000.0), 2000.0);
}

/* A law of rates and attitude, about level; gains in us per rad/s and per rad. */
static void fill(struct servos *out, int armed)
{
    const double *q = state.quaternion;
    const double roll = atan2(2.0 * (q[0] * q[1] + q[2] * q[3]), 1.0 - 2.0 * (q[1] * q[1] + q[2] * q[2]));
    const double pitch = asin(fmin(fmax(2.0 * (q[0] * q[2] - q[3] * q[1]), -1.0), 1.0));
    const double wanted_roll = 0.785 * (sticks.channel[0] - 1500.0) / 500.0;
    const double wanted_pitch = -0.785 * (sticks.channel[1] - 1500.0) / 500.0;
    out->motors = 1;
    out->pwm[0] = armed ? sticks.channel[2] : 1000.0F;
    out->pwm[2] = servo(-400.0 * state.rate[0] - 400.0 * (roll - wanted_roll));
    out->pwm[4] = servo(1000.0 * state.rate[2]);
    out->pwm[5] = is("nan") && state.time_s > 8.0 ? NAN : servo(1600.0 * state.rate[1] + 1200.0 * (pitch - wanted_pitch));
}

static int is_armed(double since_start_s)
{
    static int off, armed;
    off = off || (since_start_s > 5.0 && sticks.channel[4] < 1500);
    armed = (armed || (off && since_start_s > 5.0)) && sticks.channel[4] > 1700;
    return armed && !is("never-arms") && !(is("disarms") && state.time_s > 8.0);
}

int main(int count, char **arguments)
{
    struct sockaddr_in to = {.sin_family = AF_INET, .sin_port = htons(9001), .sin_addr.s_addr = htonl(INADDR_LOOPBACK)};
    struct servos out;
    pthread_t thread;
    char path[4200];
    const int has_settings = access("eeprom.bin", R_OK) == 0;
    const ssize_t size = readlink("/proc/self/exe", beside, sizeof beside - 1);
    if (size < 0) {
        return 5;
    }
    beside[size] = '\0';
    strrchr(beside, '/')[1] = '\0';
    snprintf(path, sizeof path, "%sMODE", beside);
    FILE *file = fopen(path, "r");
    if (file == NULL || fscanf(file, "%63s", mode) != 1 || is("quits") || count < 2) {
        return 4;
    }
    (void)arguments;
    const double start_s = now_s();
    const int out_fd = socket(AF_INET, SOCK_DGRAM, 0);
    static int state_fd, stick_fd, door;
    state_fd = bound(SOCK_DGRAM, 9003);
    stick_fd = bound(SOCK_DGRAM, 9004);
    door = bound(SOCK_STREAM, 5761);
    pthread_create(&thread, NULL, receive, &state_fd);
    pthread_create(&thread, NULL, receive, &stick_fd);
    pthread_create(&thread, NULL, serve, &door);
    for (int answered = 0, obeyed = 0, passes = 0;; passes++) {
        const int in_flight = has_settings && states > 800;
        while (is("stuck") && in_flight) {
            select(0, NULL, NULL, NULL, &(struct timeval){.tv_usec = 10000}); /* no sleep that the clock library sees */
        }
        nanosleep(&(struct timespec){.tv_nsec = 100000}, NULL);
        const double t = now_s() - start_s;
        if (obeyed < lines) {
            obeyed = lines;
            obey();
        }
        if (is("dies") && in_flight) {
            abort();
        }
        if (answered < states) {
            answered = states;
            fill(&out, is_armed(t));
            out.pwm[5] = is("clock") ? 1500.0F + (float)passes : is("reversed") ? 3000.0F - out.pwm[5] : out.pwm[5];
            passes = 0;
            if (!(is("silent") && in_flight)) {
                sendto(out_fd, &out, sizeof out, 0, (struct sockaddr *)&to, sizeof to);
            }
        }
    }
}
