/* What takes the time, once for each instruction set. */
#ifndef KERNEL_H
#define KERNEL_H

#include "network.h"

/* Units of an LSTM come in blocks of 16, the sums of a block's gates as
 * [i 0-7][f 0-7][g 0-7][o 0-7][i 8-15][f 8-15][g 8-15][o 8-15]. */
#define BLOCK 64
#define BLOCK_UNITS 16

/* Several states of one LSTM, row by row. */
typedef struct {
    size_t count;
    const float *input; /* what the matrix multiplies: [count] rows of `depth`, `input_step` apart */
    size_t input_step;
    float *hidden; /* out, not the input: [count] rows of 16 * blocks, `step` apart */
    float *cell;   /* in and out, likewise */
    size_t step;
    size_t units; /* of each row; what fills it up to a multiple of 16 becomes zero in `hidden` */
} Rows;

typedef struct Kernel {
    const char *name;
    /* sums[64 * blocks] = start + matrix input */
    void (*product)(const Layer *layer, const float *input, float *sums);
    /* An LSTM's first step from nothing, of the sums of its gates. */
    void (*begin)(size_t blocks, const float *gates, float *hidden, float *cell);
    /* One LSTM step of all rows, from sums that begin with `start` (which serves all rows) in place of the layer's. */
    void (*advance)(const Layer *layer, const float *start, const Rows *rows);
    /* tanh and 1 / (1 + exp(-x)) of each value; the count is a multiple of 16 */
    void (*bend)(size_t count, float *values);
    void (*open)(size_t count, float *values);
} Kernel;

const Kernel *best_kernel(void);

/* GCC keeps no stack aligned to 32 bytes on Windows (its bug 54412), so that wide registers cannot be saved there. */
#if defined(__x86_64__) && (defined(__clang__) || (defined(__GNUC__) && !defined(_WIN32)))
#define KERNELS_WIDE
extern const Kernel KERNEL_AVX512, KERNEL_AVX2;
#endif
#if defined(__SSE2__) || defined(_M_X64)
#define KERNELS_SSE2
extern const Kernel KERNEL_SSE2;
#endif
#if defined(__aarch64__) && defined(__ARM_NEON)
#define KERNELS_NEON
extern const Kernel KERNEL_NEON;
#endif
extern const Kernel KERNEL_PORTABLE;

#endif
