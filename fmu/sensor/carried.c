/* The network with carried state: features, dense layer, one LSTM step, dense layer, four velocities and their deviations. */
#include <math.h>
#include <string.h>

#include "motion.h"

typedef struct {
    float *features, *front, *both, *next, *dense;
} Scratch;

static size_t features_room(const Network *n) { return NETWORK_ROUND(n->feature_count, BLOCK_UNITS); }
static size_t line_room(const Network *n) { return NETWORK_ROUND(n->depth * LINE, BLOCK_UNITS); }

size_t carried_state_floats(const Network *n) { return NETWORK_CARRIED_STATE(n->units, n->depth); }

size_t carried_scratch_floats(const Network *n) {
    return NETWORK_CARRIED_SCRATCH(n->feature_count, n->front_units, n->units, n->hidden);
}

static Scratch divided(const Network *n, float *scratch) {
    Scratch s;
    s.features = scratch;
    s.front = s.features + features_room(n);
    s.dense = s.front + BLOCK * n->front.blocks;
    s.both = s.dense + BLOCK * n->dense.blocks;
    s.next = s.both + NETWORK_ROUND(n->front_units, BLOCK_UNITS) + n->padded;
    return s;
}

/* Standardised features -> the LSTM's new output, in the state. */
static const float *recurrent(const Network *n, void *state, const Scratch *s) {
    float *hidden = delay_line(state) + line_room(n), *cell = hidden + n->padded;
    const Rows row = {1, s->both, 0, s->next, cell, 0, n->units};
    n->kernel->product(&n->front, s->features, s->front);
    n->kernel->bend(BLOCK * n->front.blocks, s->front);
    memcpy(s->both, s->front, n->front_units * sizeof *hidden);
    memcpy(s->both + n->front_units, hidden, n->units * sizeof *hidden);
    n->kernel->advance(&n->lstm, n->lstm.start, &row);
    memcpy(hidden, s->next, n->padded * sizeof *hidden);
    return hidden;
}

bool carried_step(const Network *n, void *state, float *scratch, const float sample[CHANNELS], const float command[COMMANDS],
                  float estimate[WHEELS], float deviation[WHEELS]) {
    const Features *f = n->features;
    const Scratch s = divided(n, scratch);
    const float level = carried_features(n, state, sample, command, s.features);
    for (size_t i = 0; i < n->feature_count; ++i) s.features[i] = (s.features[i] - n->input_mean[i]) / n->input_std[i];
    for (size_t i = n->feature_count; i < features_room(n); ++i) s.features[i] = 0.0f;
    const float *hidden = recurrent(n, state, &s);
    if (((const Motion *)state)->taken <= n->warm_up) return false;

    n->kernel->product(&n->dense, hidden, s.dense);
    for (size_t k = 0; k < BLOCK * n->dense.blocks; ++k) s.dense[k] = s.dense[k] > 0 ? s.dense[k] : 0;
    for (size_t i = 0; i < WHEELS; ++i) {
        estimate[i] = (readout(&n->output, i, s.dense) + readout(&n->straight, i, s.features)) * f->scale * level;
        const float logarithm = within(readout(&n->deviation, i, s.dense), f->deviation_least, f->deviation_most);
        deviation[i] = expf(logarithm) * f->deviation_scale[i] * level;
    }
    return true;
}
