/* A unit that prints what it reads, leaves things in its folder, and then votes the first channel. */
#include <dirent.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "rig_unit.h"

static int entries(const char *folder)
{
    int count = -2; /* . and .. */
    DIR *opened = opendir(folder);
    if (!opened) {
        return -1;
    }
    while (readdir(opened)) {
        count++;
    }
    closedir(opened);
    return count;
}

int rig_unit_open(const struct rig_config *config)
{
    const char *folder = getenv("RIG_UNIT_FOLDER"), *shown = getenv("SHOWN"), *way = getenv("WAY");
    char text[4096];
    printf("SHOWN=%s\n", shown ? shown : "none");
    printf("OF_SHELL=%s\n", getenv("OF_SHELL") ? "there" : "none");
    printf("FOLDER=%s %d\n", folder ? folder : "none", folder ? entries(folder) : -1);
    fflush(stdout);
    if (folder && way && strcmp(way, "leave") == 0) { /* a full folder without permissions, and a link out of it */
        snprintf(text, sizeof text, "%s/a", folder);
        mkdir(text, 0700);
        snprintf(text, sizeof text, "%s/a/b", folder);
        fclose(fopen(text, "w"));
        snprintf(text, sizeof text, "%s/a", folder);
        chmod(text, 0);
        snprintf(text, sizeof text, "%s/out", folder);
        if (symlink(getenv("OUTSIDE"), text)) {
            return 2;
        }
    }
    if (folder && way && strcmp(way, "replace") == 0) { /* a link in the place of the folder */
        if (rmdir(folder) || symlink(getenv("OUTSIDE"), folder)) {
            return 3;
        }
    }
    return config->layout != RIG_UNIT_LAYOUT;
}

int rig_unit_step(const struct rig_input *in, struct rig_output *out)
{
    const char *way = getenv("WAY");
    if (in->frame == 50 && way && strcmp(way, "abort") == 0) {
        abort();
    }
    while (in->frame == 50 && way && strcmp(way, "hang") == 0) {
        pause();
    }
    for (int s = 0; s < RIG_SIGNALS; s++) {
        out->voted[s] = in->channels[s][0];
    }
    out->said = RIG_SAID_VOTED;
    return 0;
}

void rig_unit_close(void)
{
}
