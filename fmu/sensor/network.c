#include <float.h>
#include <math.h>
#include <string.h>

#include "stages.h"

bool network_uses_command(const Network *n) { return n->features != NULL; }
bool network_predicts_deviation(const Network *n) { return n->features != NULL; }

size_t network_state_bytes(const Network *n) {
    return sizeof(float) * (n->features ? carried_state_floats(n) : windowed_state_floats(n));
}

size_t network_scratch_bytes(const Network *n) {
    return sizeof(float) * (n->features ? carried_scratch_floats(n) : windowed_scratch_floats(n));
}

void network_reset(const Network *n, void *state) { memset(state, 0, network_state_bytes(n)); }

static unsigned not_numbers(size_t count, const double *values) {
    unsigned bits = 0;
    for (size_t i = 0; i < count; ++i)
        if (!(fabs(values[i]) <= FLT_MAX)) bits |= 1u << i; /* false for a NaN too */
    return bits;
}

static bool all_numbers(const float values[WHEELS]) {
    for (int i = 0; i < WHEELS; ++i)
        if (!(fabsf(values[i]) <= FLT_MAX)) return false;
    return true;
}

/* In single precision, and where the state would not forget it, within what a car can do. */
static void take_sample(const Network *n, const double measured[CHANNELS], float sample[CHANNELS]) {
    for (int i = 0; i < CHANNELS; ++i) {
        double x = measured[i];
        if (n->features) x = fmin(fmax(x, -n->features->largest[i]), n->features->largest[i]);
        sample[i] = (float)x;
    }
}

bool network_step(const Network *n, void *state, void *scratch, const double measured[CHANNELS],
                  const double command[COMMANDS], double estimate[WHEELS], double deviation[WHEELS], unsigned *bad) {
    float sample[CHANNELS], held[COMMANDS], velocity[WHEELS], spread[WHEELS] = {0, 0, 0, 0};
    unsigned wrong = not_numbers(CHANNELS, measured);
    if (n->features) wrong |= not_numbers(COMMANDS, command) << CHANNELS;
    if (bad) *bad = wrong;
    if (wrong) {
        if (!n->features) windowed_forget(state);
        return false;
    }
    take_sample(n, measured, sample);
    bool counts;
    if (n->features) {
        for (int i = 0; i < COMMANDS; ++i) held[i] = (float)command[i];
        counts = carried_step(n, state, scratch, sample, held, velocity, spread);
    } else {
        if (n->residual) residual_channels(n->residual, sample);
        counts = windowed_step(n, state, scratch, sample, velocity);
    }
    if (!counts || !all_numbers(velocity) || !all_numbers(spread)) return false;
    for (int i = 0; i < WHEELS; ++i) estimate[i] = (double)velocity[i], deviation[i] = (double)spread[i];
    return true;
}

/* In sixteen sums, which every compiler can keep in vectors of its own size without changing the result. */
float readout(const Readout *r, size_t wheel, const float *values) {
    const float *w = r->weights + wheel * r->width;
    float sum[16] = {0}, total = r->start ? r->start[wheel] : 0.0f;
    for (size_t k = 0; k < r->width; k += 16)
        for (int l = 0; l < 16; ++l) sum[l] += w[k + l] * values[k + l];
    for (int l = 0; l < 16; ++l) total += sum[l];
    return total;
}
