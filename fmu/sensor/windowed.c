/* A window's forward LSTM starts at its first sample, so at every sample W windows are under way. All of them move on by the new
 * sample at once: what the sample adds to the gates serves all, and the recurrent matrix is read once for W - 1 rows. The window that
 * ends here is the oldest row; the one that begins here takes its place, assigned from nothing. The backward direction, tapped at the
 * last sample, is one such first step. */
#include <string.h>

#include "stages.h"

/* Rows 0 to `under_way` - 1 hold windows. `turn` is the row of the next window; once all W - 1 rows are taken, that of the oldest. */
typedef struct {
    uint32_t under_way, turn;
    float unused[14];
} Flight;

enum { HEAD = sizeof(Flight) / sizeof(float) };

typedef struct {
    float *gates, *dense, *both, *cell, *next;
} Scratch;

size_t windowed_state_floats(const Network *n) { return NETWORK_WINDOWED_STATE(n->window, n->units); }
size_t windowed_scratch_floats(const Network *n) { return NETWORK_WINDOWED_SCRATCH(n->window, n->units, n->hidden); }

static Scratch divided(const Network *n, float *scratch) {
    Scratch s;
    s.gates = scratch;
    s.dense = s.gates + BLOCK * n->lstm.blocks;
    s.both = s.dense + BLOCK * n->dense.blocks;
    s.cell = s.both + 2 * n->padded;
    s.next = s.cell + n->padded;
    return s;
}

void windowed_forget(void *state) {
    Flight *flight = state;
    flight->under_way = flight->turn = 0;
}

/* The estimate of the window whose forward direction ended at `forward`. */
static void finish(const Network *n, const Scratch *s, const float *forward, const float *newest, float estimate[WHEELS]) {
    memcpy(s->both, forward, n->padded * sizeof *forward);
    n->kernel->product(&n->backward_input, newest, s->gates);
    n->kernel->begin(n->lstm.blocks, s->gates, s->both + n->padded, s->cell);
    n->kernel->product(&n->dense, s->both, s->dense);
    for (size_t k = 0; k < BLOCK * n->dense.blocks; ++k) s->dense[k] = s->dense[k] > 0 ? s->dense[k] : 0;
    for (size_t i = 0; i < WHEELS; ++i) estimate[i] = readout(&n->output, i, s->dense) * n->output_std[i] + n->output_mean[i];
}

bool windowed_step(const Network *n, void *state, float *scratch, const float sample[CHANNELS], float estimate[WHEELS]) {
    const Scratch s = divided(n, scratch);
    const size_t most = n->window - 1, step = n->padded;
    Flight *flight = state;
    float *hidden = (float *)state + HEAD, *cell = hidden + most * step, newest[CHANNELS];
    for (int i = 0; i < CHANNELS; ++i) newest[i] = (sample[i] - n->input_mean[i]) / n->input_std[i];

    const size_t turn = flight->turn, under_way = flight->under_way;
    const Rows rows = {under_way, hidden, step, s.next, cell, step, n->units};
    n->kernel->product(&n->forward_input, newest, s.gates);
    n->kernel->advance(&n->lstm, s.gates, &rows);
    memcpy(hidden, s.next, under_way * step * sizeof *hidden);
    n->kernel->begin(n->lstm.blocks, s.gates, hidden + turn * step, cell + turn * step);
    flight->turn = (uint32_t)((turn + 1) % most);
    if (under_way < most) {
        ++flight->under_way;
        return false;
    }
    finish(n, &s, s.next + turn * step, newest, estimate);
    return true;
}
