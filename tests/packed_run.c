/* Runs the C sensor over samples from a file, for the sanitizers: packed_run NETWORK SAMPLES KERNEL. Every buffer has exactly the size
 * that the sensor asks for. Prints the estimates that count, as hexadecimal numbers; a network that is refused, its sentence. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "network.h"

static void *file(const char *path, size_t *bytes) {
    FILE *f = fopen(path, "rb");
    if (!f || fseek(f, 0, SEEK_END)) exit(2);
    *bytes = (size_t)ftell(f);
    rewind(f);
    void *content = aligned_alloc(64, *bytes ? (*bytes + 63) / 64 * 64 : 64);
    if (!content || fread(content, 1, *bytes, f) != *bytes) exit(2);
    fclose(f);
    return content;
}

static void run(const Network *network, const double *samples, size_t count) {
    void *state = malloc(network_state_bytes(network)), *scratch = malloc(network_scratch_bytes(network));
    double estimate[WHEELS], deviation[WHEELS];
    memset(scratch, 0xFF, network_scratch_bytes(network));
    network_reset(network, state);
    for (size_t k = 0; k < count; ++k) {
        const double *sample = samples + k * (CHANNELS + COMMANDS);
        unsigned bad;
        if (!network_step(network, state, scratch, sample, sample + CHANNELS, estimate, deviation, &bad)) continue;
        printf("%zu %a %a %a %a %a\n", k, estimate[0], estimate[1], estimate[2], estimate[3], deviation[3]);
    }
    free(state), free(scratch);
}

int main(int count, char **given) {
    if (count != 4 || !network_choose_kernel(given[3])) return 2;
    size_t bytes, sample_bytes;
    void *blob = file(given[1], &bytes);
    double *samples = file(given[2], &sample_bytes);
    Network network;
    const char *wrong = network_open(&network, blob, bytes);
    if (wrong) puts(wrong);
    else run(&network, samples, sample_bytes / sizeof(double) / (CHANNELS + COMMANDS));
    free(blob), free(samples);
    return 0;
}
