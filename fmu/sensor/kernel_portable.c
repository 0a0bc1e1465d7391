/* Plain C, for every other processor and as the measure of the others. */
#include <math.h>

#include "kernel.h"

static float gate_opening(float x) { return 1.0f / (1.0f + expf(-x)); }

/* Where unit `u` of a block has its gates: four places, 8 apart. */
static size_t place(size_t unit) { return unit / BLOCK_UNITS * BLOCK + unit % BLOCK_UNITS / 8 * 32 + unit % 8; }

static void product(const Layer *layer, const float *input, float *sums) {
    for (size_t b = 0; b < layer->blocks; ++b) {
        const float *m = layer->matrix + b * layer->depth * BLOCK;
        float sum[BLOCK];
        for (int l = 0; l < BLOCK; ++l) sum[l] = layer->start[b * BLOCK + l];
        for (size_t k = 0; k < layer->depth; ++k, m += BLOCK)
            for (int l = 0; l < BLOCK; ++l) sum[l] += m[l] * input[k];
        for (int l = 0; l < BLOCK; ++l) sums[b * BLOCK + l] = sum[l];
    }
}

static void begin(size_t blocks, const float *gates, float *hidden, float *cell) {
    for (size_t u = 0; u < blocks * BLOCK_UNITS; ++u) {
        const float *g = gates + place(u);
        cell[u] = gate_opening(g[0]) * tanhf(g[16]);
        hidden[u] = gate_opening(g[24]) * tanhf(cell[u]);
    }
}

static void advance_row(const Layer *layer, const float *start, const float *input, float *hidden, float *cell) {
    for (size_t b = 0; b < layer->blocks; ++b) {
        const Layer one = {layer->matrix + b * layer->depth * BLOCK, start + b * BLOCK, layer->depth, 1};
        float gates[BLOCK];
        product(&one, input, gates);
        for (size_t u = 0; u < BLOCK_UNITS; ++u) {
            const float *g = gates + place(u);
            float *c = cell + b * BLOCK_UNITS + u;
            *c = gate_opening(g[8]) * *c + gate_opening(g[0]) * tanhf(g[16]);
            hidden[b * BLOCK_UNITS + u] = gate_opening(g[24]) * tanhf(*c);
        }
    }
}

static void advance(const Layer *layer, const float *start, const Rows *rows) {
    for (size_t r = 0; r < rows->count; ++r)
        advance_row(layer, start, rows->input + r * rows->input_step, rows->hidden + r * rows->step, rows->cell + r * rows->step);
}

static void bend(size_t count, float *values) {
    for (size_t i = 0; i < count; ++i) values[i] = tanhf(values[i]);
}

const Kernel PORTABLE = {"portable", product, begin, advance, bend};
