/* Four doubles that go through the same arithmetic side by side: one for each corner of the car.
 *
 * A Four is a vector in the sense of GCC and Clang: + - * / and comparisons work on all four lanes, x[i] is one of
 * them. Each lane is plain IEEE arithmetic without fused operations, so every processor gives the same bits, whether
 * it works on four lanes at a time (AVX), on two (SSE2, NEON) or on one.
 *
 * The elementary functions are polynomials (near-minimax fits made with mpmath at 40 digits) after the usual range
 * reductions; tests/test_vehicle_four.py holds them against the exact values. */
#ifndef FOUR_H
#define FOUR_H

#include <math.h>

#pragma GCC diagnostic ignored "-Wpsabi" /* Fours are passed to inlined functions only */

#define INLINE static inline __attribute__((always_inline))

typedef double Four __attribute__((vector_size(32), aligned(8), may_alias));
typedef long long Mask __attribute__((vector_size(32))); /* of a comparison: all bits of a lane, or none */

#define FOUR(array) (*(const Four *)(array)) /* double[4], such as a parameter of each corner */

INLINE Four splat(double s) { return (Four){s, s, s, s}; }
INLINE Four choose(Mask m, Four yes, Four no) { return (Four)((m & (Mask)yes) | (~m & (Mask)no)); }
INLINE int any(Mask m) { return (m[0] | m[1] | m[2] | m[3]) != 0; }
INLINE Four smaller(Four a, Four b) { return choose(a < b, a, b); }
INLINE Four larger(Four a, Four b) { return choose(a > b, a, b); }
INLINE Four within(Four x, Four low, Four high) { return smaller(larger(x, low), high); }
INLINE Four magnitude(Four x) { return (Four)((Mask)x & ~(Mask)splat(-0.0)); }
INLINE Four with_sign_of(Four size, Four sign) { return (Four)((Mask)size | ((Mask)sign & (Mask)splat(-0.0))); } /* size >= 0 */
INLINE Four root(Four x) { return (Four){sqrt(x[0]), sqrt(x[1]), sqrt(x[2]), sqrt(x[3])}; }
INLINE Four if_so(Mask m, Four yes) { return (Four)(m & (Mask)yes); } /* else 0 */

#if defined(__has_builtin)
#if __has_builtin(__builtin_shufflevector)
#define HAS_SHUFFLE
#endif
#endif
#ifdef HAS_SHUFFLE
#define SHUFFLE(a, b, i, j, k, l) __builtin_shufflevector(a, b, i, j, k, l)
#else
#define PICK(a, b, i) ((i) < 4 ? (a)[(i) & 3] : (b)[(i) & 3])
#define SHUFFLE(a, b, i, j, k, l) ((Four){PICK(a, b, i), PICK(a, b, j), PICK(a, b, k), PICK(a, b, l)})
#endif

/* Over the lanes: (x0 + x1) + (x2 + x3), of four Fours at a time. */
INLINE Four sums(Four a, Four b, Four c, Four d) {
    const Four ab = SHUFFLE(a, b, 0, 4, 2, 6) + SHUFFLE(a, b, 1, 5, 3, 7);
    const Four cd = SHUFFLE(c, d, 0, 4, 2, 6) + SHUFFLE(c, d, 1, 5, 3, 7);
    return SHUFFLE(ab, cd, 0, 1, 4, 5) + SHUFFLE(ab, cd, 2, 3, 6, 7);
}
INLINE double sum(Four x) { return (x[0] + x[1]) + (x[2] + x[3]); }

/* Of (s - 1) / (s + 1) between the tangents of 1/8 and 3/8 pi, of -1 / s beyond; below, where slips mostly are, no
 * division is needed. */
INLINE Four arctangent(Four x) {
    Four s = magnitude(x), turned = splat(0.0);
    const Mask steep = s > 0.41421356237309503;
    if (any(steep)) {
        const Mask upright = s > 2.414213562373095;
        const Four one = splat(1.0), eighth = splat(0.7853981633974483);
        turned = if_so(steep, eighth) + if_so(upright, eighth);
        s = ((Four)(~upright & (Mask)s) - if_so(steep, one)) / (if_so(steep, s) + (Four)(~upright & (Mask)one));
    }
    const Four z = s * s, zz = z * z, z4 = zz * zz;
    const Four a = (-0.3333333333333333 + z * 0.1999999999999552) + zz * (-0.14285714284666542 + z * 0.11111111015256361);
    const Four b = (-0.09090904578123903 + z * 0.07692183190826087) + zz * (-0.06664511447381948 + z * 0.0585814891280221);
    const Four c = -0.0508544973794026 + z * 0.03923165829558719 + zz * -0.01917688711906226;
    return with_sign_of(turned + (s + s * z * (a + z4 * (b + z4 * c))), x);
}

/* sin(r + half_turns * pi) for |r| <= pi / 2 and whole half_turns, which come with a large number added to them: their
 * last bit is then the last bit of the sum. */
INLINE Four sine_of_reduced(Four r, Four counted) {
    const Four z = r * r, zz = z * z;
    const Four a = (-0.16666666666666666 + z * 0.008333333333333316) + zz * (-0.00019841269841254974 + z * 2.7557319219163234e-06);
    const Four b = (-2.5052107616996182e-08 + z * 1.6058977312464087e-10) + zz * (-7.643970296798572e-13 + z * 2.7314447669863995e-15);
    return (Four)((Mask)(r + r * z * (a + zz * zz * b)) ^ ((Mask)counted << 63));
}

static const double ROUNDER = 6755399441055744.0; /* 1.5 * 2^52: adding it rounds to a whole number */
static const double PI_HIGH = 3.1415926534682512, PI_LOW = 1.2154201013012384e-10, PER_PI = 0.3183098861837907;

/* |x| below some 1e5 */
INLINE Four sine(Four x) {
    const Four counted = x * PER_PI + ROUNDER, n = counted - ROUNDER;
    return sine_of_reduced((x - n * PI_HIGH) - n * PI_LOW, counted);
}

INLINE Four cosine(Four x) { /* sin(x + pi / 2) */
    const Four counted = (x * PER_PI + 0.5) + ROUNDER, n = counted - ROUNDER, half = n - 0.5;
    return sine_of_reduced((x - half * PI_HIGH) - half * PI_LOW, counted);
}

/* Of the mostly small kinematic angles: Taylor series to 1e-16 up to 0.2 rad. */
INLINE void sine_and_cosine(Four x, Four *s, Four *c) {
    if (any(magnitude(x) > 0.2)) {
        *s = sine(x), *c = cosine(x);
        return;
    }
    const Four z = x * x;
    *s = x + x * z * (-1.0 / 6 + z * (1.0 / 120 + z * (-1.0 / 5040 + z * (1.0 / 362880 + z * (-1.0 / 39916800)))));
    *c = 1 + z * (-0.5 + z * (1.0 / 24 + z * (-1.0 / 720 + z * (1.0 / 40320 + z * (-1.0 / 3628800)))));
}

/* |x| below 700 */
INLINE Four exponential(Four x) {
    const Four counted = x * 1.4426950408889634 + ROUNDER, n = counted - ROUNDER;
    const Four r = (x - n * 0.6931471803691238) - n * 1.9082149292705877e-10, rr = r * r;
    const Four a = (0.5 + r * 0.16666666666666669) + rr * (0.041666666666624164 + r * 0.008333333333330065);
    const Four b = (0.0013888888917196719 + r * 0.00019841269863040545) + rr * (2.4801521322368692e-05 + r * 2.7557268480310024e-06);
    const Four c = 2.7620075879983367e-07 + r * 2.5100375832561234e-08;
    const Four power = (Four)(((Mask)counted + 1023) << 52); /* 2^n */
    return power + power * (r + rr * (a + rr * rr * (b + rr * rr * c)));
}

#endif
