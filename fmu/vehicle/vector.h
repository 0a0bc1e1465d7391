/* Three-vectors: Vec for the body, Vec4 for the same vector at each of the four corners. add, sub, scale, axpy, dot, cross
 * and unit take either. Matrices are row-major double[9], body axes -> inertial axes. */
#ifndef VECTOR_H
#define VECTOR_H

#include "four.h"

typedef struct { double x, y, z; } Vec;
typedef struct { Four x, y, z; } Vec4;

#define VECTOR_ARITHMETIC(V, S, suffix)                                                                               \
    INLINE V add##suffix(V a, V b) { return (V){a.x + b.x, a.y + b.y, a.z + b.z}; }                                   \
    INLINE V sub##suffix(V a, V b) { return (V){a.x - b.x, a.y - b.y, a.z - b.z}; }                                   \
    INLINE V scale##suffix(S s, V a) { return (V){s * a.x, s * a.y, s * a.z}; }                                       \
    INLINE V axpy##suffix(S s, V a, V b) { return (V){s * a.x + b.x, s * a.y + b.y, s * a.z + b.z}; }                 \
    INLINE S dot##suffix(V a, V b) { return a.x * b.x + a.y * b.y + a.z * b.z; }                                      \
    INLINE V cross##suffix(V a, V b) { return (V){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; } \
    INLINE V to_inertial##suffix(const double R[9], V a) {                                                            \
        return (V){R[0] * a.x + R[1] * a.y + R[2] * a.z, R[3] * a.x + R[4] * a.y + R[5] * a.z,                        \
                   R[6] * a.x + R[7] * a.y + R[8] * a.z};                                                             \
    }                                                                                                                 \
    INLINE V to_body##suffix(const double R[9], V a) {                                                                \
        return (V){R[0] * a.x + R[3] * a.y + R[6] * a.z, R[1] * a.x + R[4] * a.y + R[7] * a.z,                        \
                   R[2] * a.x + R[5] * a.y + R[8] * a.z};                                                             \
    }
VECTOR_ARITHMETIC(Vec, double, 1)
VECTOR_ARITHMETIC(Vec4, Four, 4)

#define EITHER(name, a) _Generic((a), Vec: name##1, Vec4: name##4)
#define add(a, b) EITHER(add, a)(a, b)
#define sub(a, b) EITHER(sub, a)(a, b)
#define scale(s, a) EITHER(scale, a)(s, a)
#define axpy(s, a, b) EITHER(axpy, a)(s, a, b) /* s a + b */
#define dot(a, b) EITHER(dot, a)(a, b)
#define cross(a, b) EITHER(cross, a)(a, b)
#define to_inertial(R, a) EITHER(to_inertial, a)(R, a)
#define to_body(R, a) EITHER(to_body, a)(R, a)

INLINE Vec vec(double x, double y, double z) { return (Vec){x, y, z}; }
INLINE Vec4 vec4(Four x, Four y, Four z) { return (Vec4){x, y, z}; }
INLINE Vec unit(Vec a) { return scale(1.0 / sqrt(dot(a, a)), a); }
INLINE Vec4 unit4(Vec4 a) { return scale(1.0 / root(dot(a, a)), a); }
INLINE Vec4 spread(Vec a) { return (Vec4){splat(a.x), splat(a.y), splat(a.z)}; } /* the same at every corner */
INLINE Vec corner_of(Vec4 a, int i) { return (Vec){a.x[i], a.y[i], a.z[i]}; }
INLINE Vec total(Vec4 a) { /* over the corners */
    const Four s = sums(a.x, a.y, a.z, a.z);
    return (Vec){s[0], s[1], s[2]};
}

/* Rotation matrix of a unit quaternion (w, x, y, z). */
INLINE void rotation(const double q[4], double R[9]) {
    const double w = q[0], x = q[1], y = q[2], z = q[3];
    R[0] = 1 - 2 * (y * y + z * z), R[1] = 2 * (x * y - w * z), R[2] = 2 * (x * z + w * y);
    R[3] = 2 * (x * y + w * z), R[4] = 1 - 2 * (x * x + z * z), R[5] = 2 * (y * z - w * x);
    R[6] = 2 * (x * z - w * y), R[7] = 2 * (y * z + w * x), R[8] = 1 - 2 * (x * x + y * y);
}
INLINE double clamp(double x, double low, double high) { return x < low ? low : x > high ? high : x; }

#endif
