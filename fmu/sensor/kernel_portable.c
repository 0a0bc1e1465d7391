/* In plain C, for processors without vectors: four numbers side by side, as their registers hold. */
#include "kernel.h"

#define LANES 4
#define ROWS 1
#define ROW_STRANDS 1
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

/* Written out: not every compiler unrolls a loop over four. */
#define EACH(of)                                         \
    const Vector v = {{of(0), of(1), of(2), of(3)}}; \
    return v
#define SUM(l) a.lane[l] + b.lane[l]
#define PRODUCT(l) a.lane[l] * b.lane[l]
#define QUOTIENT(l) a.lane[l] / b.lane[l]
#define PRODUCT_AND_SUM(l) a.lane[l] * b.lane[l] + c.lane[l]
#define LIMITED(l) x.lane[l] < -most ? -most : x.lane[l] > most ? most : x.lane[l]

static inline Vector plus(Vector a, Vector b) { EACH(SUM); }
static inline Vector multiply(Vector a, Vector b) { EACH(PRODUCT); }
static inline Vector divide(Vector a, Vector b) { EACH(QUOTIENT); }
static inline Vector times_plus(Vector a, Vector b, Vector c) { EACH(PRODUCT_AND_SUM); }
static inline Vector limited(Vector x, float most) { EACH(LIMITED); }

#include "kernel_body.h"

const Kernel KERNEL_PORTABLE = {"portable", product, begin, advance, bend, open};
