/* A trained network from a packed file (sensor/packed), sample by sample: fourteen channels in, four suspension velocities out.
 *
 * No heap, no files; of the C library memcpy, memset and math only, so that the same sources serve the FMU and a bare-metal
 * target. A Network is a view into the packed bytes; what changes from sample to sample lies in the caller's state, plain
 * bytes that may be copied and moved. docs/sensor-c.md tells how it works. */
#ifndef NETWORK_H
#define NETWORK_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { CHANNELS = 14, COMMANDS = 4, WHEELS = 4 };

/* Room for memory that is fixed when a program is compiled, in floats of four bytes. `features` are 43 and five for each lead of the
 * delay line, `depth` its length: the packed file's record has them. */
#define NETWORK_ROUND(count, multiple) (((count) + (multiple) - 1) / (multiple) * (multiple))
#define NETWORK_WINDOWED_STATE(window, units) (16 + 2 * ((window) - 1) * NETWORK_ROUND(units, 16))
#define NETWORK_WINDOWED_SCRATCH(window, units, hidden) \
    (NETWORK_ROUND(hidden, 64) + ((window) + 6) * NETWORK_ROUND(units, 16))
#define NETWORK_CARRIED_STATE(units, depth) (16 + NETWORK_ROUND((depth) * 10, 16) + 2 * NETWORK_ROUND(units, 16))
#define NETWORK_CARRIED_SCRATCH(features, front, units, hidden) \
    (NETWORK_ROUND(features, 16) + NETWORK_ROUND(front, 64) + NETWORK_ROUND(hidden, 64) + NETWORK_ROUND(front, 16) + \
     2 * NETWORK_ROUND(units, 16))

/* start + matrix x, sixty-four sums to a block: matrix[blocks][depth][64], start[blocks][64]. */
typedef struct {
    const float *matrix, *start;
    size_t depth, blocks;
} Layer;

/* Four sums: weights[4][width], start[4]. */
typedef struct {
    const float *weights, *start;
    size_t width;
} Readout;

typedef struct {
    const struct Kernel *kernel;
    size_t window; /* samples; 1 with carried state */
    size_t units, hidden, warm_up;
    size_t padded; /* units, filled up to a multiple of 16 with units that stay zero */
    const float *input_mean, *input_std;
    Layer lstm, dense;
    Readout output;

    /* windowed */
    const struct Residual *residual; /* NULL: the channels as they are */
    Layer forward_input, backward_input;
    const float *output_mean, *output_std;

    /* with carried state; NULL in a windowed network */
    const struct Features *features;
    size_t front_units, feature_count, leads, depth;
    const float *lead, *feature_scale;
    Layer front;
    Readout deviation, straight;
} Network;

/* Checks the packed bytes (64-byte aligned; they must outlive the network) and keeps pointers into them. Returns NULL, or a
 * sentence saying what is wrong with them. */
const char *network_open(Network *network, const void *blob, size_t bytes);

/* State: aligned as a double. Copying its bytes copies it. Scratch: what it holds between two steps does not matter. */
size_t network_state_bytes(const Network *network);
size_t network_scratch_bytes(const Network *network);
void network_reset(const Network *network, void *state);

/* One sample: channels in SI units in the order of sensor/channels.py, and the damper commands held until it, which a windowed
 * network does not read -> estimates and their predicted standard deviations [m/s], 0 of a windowed network.
 *
 * Returns whether the estimates count; if not, they are left as they were. They do not count
 * - until the window is full, or the carried state has settled;
 * - for a sample that holds a NaN, an infinity or a magnitude beyond single precision: `bad` (may be NULL) gets a bit for each such
 *   channel, and CHANNELS + i for command i where it is read. A window starts anew after it: that sample and the W - 1 next
 *   ones have no estimate. A carried state does not take such a sample. */
bool network_step(const Network *network, void *state, void *scratch, const double measured[CHANNELS],
                  const double command[COMMANDS], double estimate[WHEELS], double deviation[WHEELS], unsigned *bad);

bool network_uses_command(const Network *network);
bool network_predicts_deviation(const Network *network);

/* The instruction set of networks opened from now on: "avx512", "avx2", "sse2", "neon" or "portable"; the best one that the
 * processor has unless chosen otherwise. Different ones round differently, in the seventh digit. */
const char *network_kernel(void);
bool network_choose_kernel(const char *name); /* false if this machine or this build has it not */

#endif
