/* AVX-512F; compiled for it here, whatever the compiler's options are, and run where cpuid tells of it. */
#include "kernel.h"

#ifdef KERNELS_WIDE
#include <immintrin.h>

#ifdef __clang__
#pragma clang attribute push(__attribute__((target("avx512f"))), apply_to = function)
#else
#pragma GCC target("avx512f")
#endif

#define LANES 16
#define ROWS 6
#define ROW_STRANDS 2
#define WIDE 4
#define STRANDS 2

typedef __m512 Vector;

static inline Vector load(const float *at) { return _mm512_loadu_ps(at); }
static inline void store(float *at, Vector v) { _mm512_storeu_ps(at, v); }
static inline Vector splat(float x) { return _mm512_set1_ps(x); }
static inline Vector plus(Vector a, Vector b) { return _mm512_add_ps(a, b); }
static inline Vector multiply(Vector a, Vector b) { return _mm512_mul_ps(a, b); }
static inline Vector divide(Vector a, Vector b) { return _mm512_div_ps(a, b); }
static inline Vector times_plus(Vector a, Vector b, Vector c) { return _mm512_fmadd_ps(a, b, c); }
static inline Vector limited(Vector x, float most) { return _mm512_max_ps(splat(-most), _mm512_min_ps(splat(most), x)); }

#define PAIR(a, b, halves) _mm512_shuffle_f32x4(a, b, halves)
#define LOW 0x44
#define HIGH 0xEE
#include "kernel_body.h"

const Kernel KERNEL_AVX512 = {"avx512", product, begin, advance, bend, open};

#ifdef __clang__
#pragma clang attribute pop
#endif
#else
typedef int no_avx512;
#endif
