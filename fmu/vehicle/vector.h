/* Three-vectors, small enough to inline everywhere. Matrices are row-major double[9], body axes -> inertial axes. */
#ifndef VECTOR_H
#define VECTOR_H

#include <math.h>

typedef struct { double x, y, z; } Vec;

static inline Vec vec(double x, double y, double z) { return (Vec){x, y, z}; }
static inline Vec add(Vec a, Vec b) { return vec(a.x + b.x, a.y + b.y, a.z + b.z); }
static inline Vec sub(Vec a, Vec b) { return vec(a.x - b.x, a.y - b.y, a.z - b.z); }
static inline Vec scale(double s, Vec a) { return vec(s * a.x, s * a.y, s * a.z); }
static inline Vec axpy(double s, Vec a, Vec b) { return vec(s * a.x + b.x, s * a.y + b.y, s * a.z + b.z); }
static inline double dot(Vec a, Vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static inline Vec cross(Vec a, Vec b) {
    return vec(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);
}
static inline Vec unit(Vec a) { return scale(1.0 / sqrt(dot(a, a)), a); }

static inline Vec to_inertial(const double R[9], Vec a) {
    return vec(R[0] * a.x + R[1] * a.y + R[2] * a.z, R[3] * a.x + R[4] * a.y + R[5] * a.z,
               R[6] * a.x + R[7] * a.y + R[8] * a.z);
}
static inline Vec to_body(const double R[9], Vec a) {
    return vec(R[0] * a.x + R[3] * a.y + R[6] * a.z, R[1] * a.x + R[4] * a.y + R[7] * a.z,
               R[2] * a.x + R[5] * a.y + R[8] * a.z);
}
/* Rotation matrix of a unit quaternion (w, x, y, z). */
static inline void rotation(const double q[4], double R[9]) {
    const double w = q[0], x = q[1], y = q[2], z = q[3];
    R[0] = 1 - 2 * (y * y + z * z), R[1] = 2 * (x * y - w * z), R[2] = 2 * (x * z + w * y);
    R[3] = 2 * (x * y + w * z), R[4] = 1 - 2 * (x * x + z * z), R[5] = 2 * (y * z - w * x);
    R[6] = 2 * (x * z - w * y), R[7] = 2 * (y * z + w * x), R[8] = 1 - 2 * (x * x + y * y);
}
static inline double clamp(double x, double low, double high) { return x < low ? low : x > high ? high : x; }

#endif
