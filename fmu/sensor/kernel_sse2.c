/* SSE2: every x86-64 processor. */
#include "kernel.h"

#ifdef KERNELS_SSE2
#include <emmintrin.h>

#define LANES 4
#define ROWS 2
#define ROW_STRANDS 2
#define WIDE 8
#define STRANDS 1

typedef __m128 Vector;

static inline Vector load(const float *at) { return _mm_loadu_ps(at); }
static inline void store(float *at, Vector v) { _mm_storeu_ps(at, v); }
static inline Vector splat(float x) { return _mm_set1_ps(x); }
static inline Vector plus(Vector a, Vector b) { return _mm_add_ps(a, b); }
static inline Vector multiply(Vector a, Vector b) { return _mm_mul_ps(a, b); }
static inline Vector divide(Vector a, Vector b) { return _mm_div_ps(a, b); }
static inline Vector times_plus(Vector a, Vector b, Vector c) { return _mm_add_ps(_mm_mul_ps(a, b), c); }
static inline Vector limited(Vector x, float most) { return _mm_max_ps(splat(-most), _mm_min_ps(splat(most), x)); }

#include "kernel_body.h"

const Kernel KERNEL_SSE2 = {"sse2", product, begin, advance, bend, open};
#else
typedef int no_sse2;
#endif
