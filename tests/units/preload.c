/* A library for LD_PRELOAD that notes each process that loads it, in the file that NOTES names. */
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

__attribute__((constructor)) static void note(void)
{
    char line[4096];
    int notes = open(getenv("NOTES") ? getenv("NOTES") : "/dev/null", O_WRONLY | O_CREAT | O_APPEND, 0600);
    int own = open("/proc/self/cmdline", O_RDONLY);
    long count = own < 0 ? 0 : read(own, line, sizeof line - 1);
    for (long i = 0; i < count; i++) {
        line[i] = line[i] ? line[i] : ' ';
    }
    line[count > 0 ? count : 0] = '\n';
    if (write(notes, line, (count > 0 ? count : 0) + 1) < 0) {
        _exit(1);
    }
    close(own);
    close(notes);
}
