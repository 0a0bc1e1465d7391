/* The carried network's state, apart from its LSTM. */
#ifndef MOTION_H
#define MOTION_H

#include "stages.h"

typedef struct {
    uint32_t taken;  /* samples */
    uint32_t newest; /* row of the delay line; the one before it is the next row */
    float energy, means[MEANS], integrals[INTEGRALS], unused[3];
} Motion;

enum { HEAD = sizeof(Motion) / sizeof(float) };

/* The delay line [depth][LINE] begins behind the head. */
static inline float *delay_line(void *state) { return (float *)state + HEAD; }

#endif
