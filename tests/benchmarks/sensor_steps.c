/* A packed network without Python around it, for instruction counts: `sensor_steps NETWORK KERNEL STEPS`. */
#include <stdio.h>
#include <stdlib.h>
#include "network.h"

static void *room(size_t bytes) { return aligned_alloc(64, (bytes + 63) / 64 * 64); }

static void *content(const char *path, size_t *bytes) {
    FILE *file = fopen(path, "rb");
    if (!file || fseek(file, 0, SEEK_END)) return NULL;
    *bytes = (size_t)ftell(file);
    rewind(file);
    void *blob = room(*bytes);
    const size_t got = blob ? fread(blob, 1, *bytes, file) : 0;
    fclose(file);
    return got == *bytes ? blob : NULL;
}

int main(int argc, char **argv) {
    static Network network;
    size_t bytes = 0;
    void *blob = argc == 4 ? content(argv[1], &bytes) : NULL;
    const int steps = argc == 4 ? atoi(argv[3]) : 0;
    if (!blob || steps < 1 || !network_choose_kernel(argv[2]) || network_open(&network, blob, bytes)) return 2;
    void *state = room(network_state_bytes(&network)), *scratch = room(network_scratch_bytes(&network));
    double measured[CHANNELS], command[COMMANDS] = {0.3, 0.3, 0.3, 0.3}, estimate[WHEELS] = {0}, deviation[WHEELS] = {0};
    network_reset(&network, state);
    unsigned random = 1;
    for (int k = 0; k < steps; ++k) {
        for (int i = 0; i < CHANNELS; ++i) {
            random = 1664525u * random + 1013904223u;
            measured[i] = (i == 6 || (i > 8 && i < 13) ? 20.0 : 0.0) + 1e-10 * random;
        }
        network_step(&network, state, scratch, measured, command, estimate, deviation, NULL);
    }
    printf("%.9f m/s\n", estimate[0]);
    return 0;
}
