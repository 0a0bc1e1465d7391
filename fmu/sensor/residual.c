/* sensor/residual_matrices.py: residual = clip(x wheels - (x driving) / cos(x steering) * (x slip + rolling)), in double precision, since
 * 30 m/s of driving are taken from a speed that is 30 m/s and a few mm/s. */
#include <math.h>

#include "stages.h"

static double times(const float sample[CHANNELS], const double matrix[CHANNELS][WHEELS], int wheel) {
    double sum = 0.0;
    for (int i = 0; i < CHANNELS; ++i) sum += (double)sample[i] * matrix[i][wheel];
    return sum;
}

void residual_channels(const Residual *r, float sample[CHANNELS]) {
    double residual[WHEELS];
    for (int w = 0; w < WHEELS; ++w) {
        const double rolling = times(sample, r->driving, w) / cos(times(sample, r->steering, w));
        const double driven = rolling * (times(sample, r->slip, w) + r->rolling[w]);
        residual[w] = fmin(fmax(times(sample, r->wheels, w) - driven, r->lowest), r->highest);
    }
    for (int i = 0; i < CHANNELS; ++i) {
        double x = (double)sample[i] * r->others[i];
        for (int w = 0; w < WHEELS; ++w) x += residual[w] * r->spread[w][i];
        sample[i] = (float)x;
    }
}
