#include "curve.h"

/* Interior slopes after Fritsch & Butland (SIAM J. Sci. Stat. Comput. 5, 1984), as scipy's PchipInterpolator takes
 * them: the weighted harmonic mean of the neighbouring secants, zero at an extremum. The ends take their secant, so
 * that the linear extension is continuous in slope. */
static void set_slopes(Curve *c) {
    const int last = c->n - 1;
    c->slope[0] = (c->y[1] - c->y[0]) / (c->x[1] - c->x[0]);
    c->slope[last] = (c->y[last] - c->y[last - 1]) / (c->x[last] - c->x[last - 1]);
    for (int k = 1; k < last; ++k) {
        const double h0 = c->x[k] - c->x[k - 1], h1 = c->x[k + 1] - c->x[k];
        const double d0 = (c->y[k] - c->y[k - 1]) / h0, d1 = (c->y[k + 1] - c->y[k]) / h1;
        const double w0 = 2 * h1 + h0, w1 = h1 + 2 * h0;
        c->slope[k] = d0 * d1 > 0 ? (w0 + w1) / (w0 / d0 + w1 / d1) : 0.0;
    }
}

void curve_damper(Curve *c, int n, const double x[], const double rebound[], const double compression[]) {
    c->n = 2 * n + 1;
    c->x[n] = c->y[n] = 0.0;
    for (int k = 0; k < n; ++k) {
        c->x[n + 1 + k] = x[k], c->y[n + 1 + k] = rebound[k];
        c->x[n - 1 - k] = -x[k], c->y[n - 1 - k] = -compression[k];
    }
    set_slopes(c);
}

double curve_value(const Curve *c, double x) {
    const int last = c->n - 1;
    if (x <= c->x[0]) return c->y[0] + c->slope[0] * (x - c->x[0]);
    if (x >= c->x[last]) return c->y[last] + c->slope[last] * (x - c->x[last]);
    int k = x < 0 ? 0 : c->n / 2;
    while (x >= c->x[k + 1]) ++k;
    const double h = c->x[k + 1] - c->x[k], t = (x - c->x[k]) / h;
    const double d = c->y[k + 1] - c->y[k], m0 = h * c->slope[k], m1 = h * c->slope[k + 1];
    return c->y[k] + t * (m0 + t * (3 * d - 2 * m0 - m1 + t * (m0 + m1 - 2 * d)));
}
