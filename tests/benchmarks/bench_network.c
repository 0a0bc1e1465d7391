/* Times the C sensor: bench_network NETWORK KERNEL SAMPLES prints one number of nanoseconds per sample and line, for the samples after
 * the first fifth. With KERNEL "default" the sensor chooses. Counting instructions, let SAMPLES differ between two runs. */
#define _POSIX_C_SOURCE 200809L
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include "network.h"

static void *room(size_t bytes) {
    void *start = NULL;
    if (posix_memalign(&start, 64, bytes + 64)) exit(3);
    memset(start, 0, bytes);
    return start;
}

static void *file(const char *path, size_t *bytes) {
    FILE *f = fopen(path, "rb");
    if (!f || fseek(f, 0, SEEK_END)) exit(2);
    *bytes = (size_t)ftell(f);
    rewind(f);
    void *content = room(*bytes);
    if (fread(content, 1, *bytes, f) != *bytes) exit(2);
    fclose(f);
    return content;
}

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return 1e9 * (double)t.tv_sec + (double)t.tv_nsec;
}

/* A car at 15 m/s whose channels shake, the same in every run. */
static void shake(unsigned *seed, double measured[CHANNELS]) {
    static const double mean[CHANNELS] = {0, 0, 0, 0, 0, 0, 15, 0, 0, 15, 15, 15, 15, 0};
    for (int i = 0; i < CHANNELS; ++i) {
        *seed = *seed * 1664525u + 1013904223u;
        measured[i] = mean[i] + 0.1 * ((double)(*seed >> 8) / (1 << 23) - 1.0);
    }
}

int main(int count, char **given) {
    if (count != 4) return fprintf(stderr, "bench_network NETWORK KERNEL SAMPLES\n"), 2;
    if (strcmp(given[2], "default") && !network_choose_kernel(given[2])) return fprintf(stderr, "no kernel %s here\n", given[2]), 2;
    const long samples = atol(given[3]);
    size_t bytes;
    Network network;
    const void *blob = file(given[1], &bytes);
    const char *wrong = network_open(&network, blob, bytes);
    if (wrong) return fprintf(stderr, "%s\n", wrong), 2;
    void *state = room(network_state_bytes(&network)), *scratch = room(network_scratch_bytes(&network));
    double *taken = room((size_t)samples * sizeof *taken), measured[CHANNELS], estimate[WHEELS] = {0}, deviation[WHEELS];
    const double command[COMMANDS] = {0.3, 0.3, 0.3, 0.3};
    unsigned seed = 1;
    network_reset(&network, state);
    for (long k = 0; k < samples; ++k) {
        shake(&seed, measured);
        const double begin = now();
        network_step(&network, state, scratch, measured, command, estimate, deviation, NULL);
        taken[k] = now() - begin;
    }
    for (long k = samples / 5; k < samples; ++k) printf("%.0f\n", taken[k]);
    return estimate[0] == estimate[0] ? 0 : 1;
}
