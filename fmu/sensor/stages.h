/* The two kinds of networks. `sample` is what network_step has checked, in single precision. */
#ifndef STAGES_H
#define STAGES_H

#include "kernel.h"
#include "packed.h"

size_t windowed_state_floats(const Network *n);
size_t windowed_scratch_floats(const Network *n);
void windowed_forget(void *state);
bool windowed_step(const Network *n, void *state, float *scratch, const float sample[CHANNELS], float estimate[WHEELS]);

size_t carried_state_floats(const Network *n);
size_t carried_scratch_floats(const Network *n);
bool carried_step(const Network *n, void *state, float *scratch, const float sample[CHANNELS], const float command[COMMANDS],
                  float estimate[WHEELS], float deviation[WHEELS]);

/* The features of one sample, `feature_count` of them, with `state` moved on; returns the level of motion. */
float carried_features(const Network *n, void *state, const float sample[CHANNELS], const float command[COMMANDS], float *features);

/* Replaces the wheel speeds by their residuals. */
void residual_channels(const Residual *r, float sample[CHANNELS]);

float readout(const Readout *r, size_t wheel, const float *values);

static inline float within(float x, float least, float most) { return x < least ? least : x > most ? most : x; }

#endif
