/* NEON of 64-bit ARM, which every such processor has. */
#include "kernel.h"

#ifdef KERNELS_NEON
#include <arm_neon.h>

#define LANES 4
#define ROWS 6
#define ROW_STRANDS 2
#define WIDE 8
#define STRANDS 1

typedef float32x4_t Vector;

static inline Vector load(const float *at) { return vld1q_f32(at); }
static inline void store(float *at, Vector v) { vst1q_f32(at, v); }
static inline Vector splat(float x) { return vdupq_n_f32(x); }
static inline Vector plus(Vector a, Vector b) { return vaddq_f32(a, b); }
static inline Vector multiply(Vector a, Vector b) { return vmulq_f32(a, b); }
static inline Vector divide(Vector a, Vector b) { return vdivq_f32(a, b); }
static inline Vector times_plus(Vector a, Vector b, Vector c) { return vfmaq_f32(c, a, b); }
static inline Vector limited(Vector x, float most) { return vmaxq_f32(splat(-most), vminq_f32(splat(most), x)); }

#include "kernel_body.h"

const Kernel KERNEL_NEON = {"neon", product, begin, advance, bend, open};
#else
typedef int no_neon;
#endif
