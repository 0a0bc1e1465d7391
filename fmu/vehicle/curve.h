/* Monotone cubic (PCHIP) curve through the origin, extended linearly: the damper characteristics. */
#ifndef CURVE_H
#define CURVE_H

enum { CURVE_POINTS = 13 };

typedef struct {
    int n;
    double x[CURVE_POINTS], y[CURVE_POINTS], slope[CURVE_POINTS];
} Curve;

/* Force over velocity from `n` points each side of zero: `rebound` at +x, `compression` (magnitudes) at -x. */
void curve_damper(Curve *c, int n, const double x[], const double rebound[], const double compression[]);
double curve_value(const Curve *c, double x);

#endif
