#include "curve.h"

/* Interior slopes after Fritsch & Butland (SIAM J. Sci. Stat. Comput. 5, 1984), as scipy's PchipInterpolator takes
 * them: the weighted harmonic mean of the neighbouring secants, zero at an extremum. The ends take their secant, so
 * that the linear extension is continuous in slope. */
static void set_slopes(int points, const double x[], const double y[], double slope[]) {
    const int last = points - 1;
    slope[0] = (y[1] - y[0]) / (x[1] - x[0]);
    slope[last] = (y[last] - y[last - 1]) / (x[last] - x[last - 1]);
    for (int k = 1; k < last; ++k) {
        const double h0 = x[k] - x[k - 1], h1 = x[k + 1] - x[k];
        const double d0 = (y[k] - y[k - 1]) / h0, d1 = (y[k + 1] - y[k]) / h1;
        const double w0 = 2 * h1 + h0, w1 = h1 + 2 * h0;
        slope[k] = d0 * d1 > 0 ? (w0 + w1) / (w0 / d0 + w1 / d1) : 0.0;
    }
}

/* The cubic Hermite polynomial between two points. */
static Piece hermite(double x0, double x1, double y0, double y1, double slope0, double slope1) {
    const double h = x1 - x0, secant = (y1 - y0) / h;
    return (Piece){x0, y0, slope0, (3 * secant - 2 * slope0 - slope1) / h, (slope0 + slope1 - 2 * secant) / (h * h)};
}

void curve_damper(Curve *c, int n, const double x[], const double rebound[], const double compression[]) {
    const int points = 2 * n + 1;
    double y[CURVE_POINTS], slope[CURVE_POINTS];
    for (int k = 0; k < CURVE_POINTS; ++k) c->x[k] = INFINITY;
    c->x[n] = y[n] = 0.0;
    for (int k = 0; k < n; ++k) {
        c->x[n + 1 + k] = x[k], y[n + 1 + k] = rebound[k];
        c->x[n - 1 - k] = -x[k], y[n - 1 - k] = -compression[k];
    }
    set_slopes(points, c->x, y, slope);
    c->piece[0] = (Piece){c->x[0], y[0], slope[0], 0.0, 0.0};
    for (int k = 1; k < points; ++k) c->piece[k] = hermite(c->x[k - 1], c->x[k], y[k - 1], y[k], slope[k - 1], slope[k]);
    c->piece[points] = (Piece){c->x[points - 1], y[points - 1], slope[points - 1], 0.0, 0.0};
}
