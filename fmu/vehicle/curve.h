/* Monotone cubic (PCHIP) curve through the origin, extended linearly: the damper characteristics. */
#ifndef CURVE_H
#define CURVE_H

#include "four.h"

enum { CURVE_POINTS = 13 };

typedef struct { double x, y, slope, square, cube; } Piece; /* y + slope d + square d^2 + cube d^3, d from x on */

typedef struct {
    double x[CURVE_POINTS];         /* ascending; +infinity where there are fewer points */
    Piece piece[CURVE_POINTS + 1];  /* below the first point, between them, beyond the last one */
} Curve;

/* Force over velocity from `n` points each side of zero: `rebound` at +x, `compression` (magnitudes) at -x. */
void curve_damper(Curve *c, int n, const double x[], const double rebound[], const double compression[]);

INLINE Four curve_values(const Curve *c, Four x) {
    Mask passed = {0, 0, 0, 0}; /* minus the number of points at or below x: which piece */
    for (int k = 0; k < CURVE_POINTS; ++k) passed += x >= c->x[k];
    const Piece *a = &c->piece[-passed[0]], *b = &c->piece[-passed[1]], *e = &c->piece[-passed[2]], *f = &c->piece[-passed[3]];
    const Four d = x - (Four){a->x, b->x, e->x, f->x};
    const Four square = {a->square, b->square, e->square, f->square}, cube = {a->cube, b->cube, e->cube, f->cube};
    return (Four){a->y, b->y, e->y, f->y} + d * ((Four){a->slope, b->slope, e->slope, f->slope} + d * (square + d * cube));
}

#endif
