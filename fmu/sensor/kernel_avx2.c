/* AVX2 with fused multiply-add; compiled for them here, whatever the compiler's options are, and run where cpuid tells of them. */
#include "kernel.h"

#ifdef KERNELS_WIDE
#include <immintrin.h>

#ifdef __clang__
#pragma clang attribute push(__attribute__((target("avx2,fma"))), apply_to = function)
#else
#pragma GCC target("avx2,fma")
#endif

#define LANES 8
#define ROWS 3
#define ROW_STRANDS 2
#define WIDE 8
#define STRANDS 1

typedef __m256 Vector;

static inline Vector load(const float *at) { return _mm256_loadu_ps(at); }
static inline void store(float *at, Vector v) { _mm256_storeu_ps(at, v); }
static inline Vector splat(float x) { return _mm256_set1_ps(x); }
static inline Vector plus(Vector a, Vector b) { return _mm256_add_ps(a, b); }
static inline Vector multiply(Vector a, Vector b) { return _mm256_mul_ps(a, b); }
static inline Vector divide(Vector a, Vector b) { return _mm256_div_ps(a, b); }
static inline Vector times_plus(Vector a, Vector b, Vector c) { return _mm256_fmadd_ps(a, b, c); }
static inline Vector limited(Vector x, float most) { return _mm256_max_ps(splat(-most), _mm256_min_ps(splat(most), x)); }

#include "kernel_body.h"

const Kernel KERNEL_AVX2 = {"avx2", product, begin, advance, bend, open};

#ifdef __clang__
#pragma clang attribute pop
#endif
#else
typedef int no_avx2;
#endif
