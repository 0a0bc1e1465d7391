/* The sensor as the FMI layer sees it: when samples are taken, and which network takes them. */
#ifndef SENSOR_H
#define SENSOR_H

#include <stdint.h>
#include "model.h"
#include "network.h"

#define SAMPLES_PER_SECOND 100
#define SAMPLE_PERIOD 0.01 /* s */
#define LONGEST_GAP 10     /* samples for which a held channel does little harm: docs/robustness.md */
#define SETTLING 200       /* samples after a longer gap until nearly every error is its usual one again */
#define ALIGNMENT 64       /* bytes, of the network's blob, state and scratch memory */

/* What resources/network.bin holds; the same for every instance but for the scratch memory. */
typedef struct {
    Network network;
    void *blob, *scratch; /* aligned */
    void *blob_memory, *scratch_memory;
} Sensor;

/* What a step leaves to the next; the network's own state follows it, aligned. */
typedef struct {
    double start;             /* of the simulation, s: the time of sample 0 */
    int64_t next;             /* number of the sample that is due next */
    double command[COMMANDS]; /* of the dampers, held by the step before */
    double held[CHANNELS];    /* the last value of each channel, which bridges a gap of a carried state */
    uint32_t seen, lacking;   /* channels that have had a value, and that had none at the last sample, a bit to each */
    int32_t gap, waiting;     /* samples: since all channels had a value; until a carried state has settled */
} Sampling;

#define NETWORK_STATE_AT ((sizeof(Sampling) + ALIGNMENT - 1) / ALIGNMENT * ALIGNMENT)

/* sensor_file.c: the file's bytes, aligned, and how many; `memory` is what to free(). On failure NULL, and why. */
void *read_blob(const char *path, size_t *size, void **memory, const char **why);
/* Room of this many bytes, zeroed and aligned; NULL if memory is short. */
void *aligned_room(size_t size, void **memory);

#endif
