/* In plain C, for processors without vectors: four numbers side by side, as their registers hold. */
#include "kernel.h"

#define LANES 4
#define ROWS 1
#define WIDE 4
#define STRANDS 1

typedef struct {
    float lane[LANES];
} Vector;

static inline Vector load(const float *at) {
    const Vector v = {{at[0], at[1], at[2], at[3]}};
    return v;
}

static inline void store(float *at, Vector v) { at[0] = v.lane[0], at[1] = v.lane[1], at[2] = v.lane[2], at[3] = v.lane[3]; }

static inline Vector splat(float x) {
    const Vector v = {{x, x, x, x}};
    return v;
}

#define OF_EACH(expression)                       \
    Vector v;                                     \
    for (int l = 0; l < LANES; ++l) v.lane[l] = (expression); \
    return v

static inline Vector plus(Vector a, Vector b) { OF_EACH(a.lane[l] + b.lane[l]); }
static inline Vector multiply(Vector a, Vector b) { OF_EACH(a.lane[l] * b.lane[l]); }
static inline Vector divide(Vector a, Vector b) { OF_EACH(a.lane[l] / b.lane[l]); }
static inline Vector times_plus(Vector a, Vector b, Vector c) { OF_EACH(a.lane[l] * b.lane[l] + c.lane[l]); }
static inline Vector limited(Vector x, float most) { OF_EACH(x.lane[l] < -most ? -most : x.lane[l] > most ? most : x.lane[l]); }

#include "kernel_body.h"

const Kernel KERNEL_PORTABLE = {"portable", product, begin, advance, bend, open};
