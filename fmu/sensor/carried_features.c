/* What the network with carried state reads: sensor/carried/features.py, with the same operations in the same precision as the ONNX graph
 * of sensor/carried. */
#include "motion.h"

#include <math.h>
#include <string.h>

enum { AX, AY, AZ, ROLL, PITCH, YAW, VX, STEER_FL, STEER_FR, WHEEL_SPEED, STEER = 13 };
enum { RECENT = 1u << 24 }; /* samples; from here on single precision would not tell one more */

static const int DELAYED_SIGNALS[DELAYED] = {0, 1, 4, 5, 6};

/* Speed that driving does not explain, in double precision as it is a small difference of large speeds. */
static void residuals(const Features *f, const float x[CHANNELS], float residual[WHEELS]) {
    for (int w = 0; w < WHEELS; ++w) {
        const double half = w < 2 ? sin(0.5 * (double)x[STEER_FL + w]) : 0.0;
        const double rolling = ((double)x[VX] - (double)x[YAW] * f->wheel_y[w]) / (1.0 - 2.0 * half * half);
        const double driving = rolling * ((double)x[AX] * f->per_ax + (double)x[AY] * f->per_ay[w] + f->axle[w]);
        residual[w] = within((float)((double)x[WHEEL_SPEED + w] - driving), f->residual_least, f->residual_most);
    }
}

/* Slow means taken off: `signal` gets the four residuals, a_z, roll and pitch rate. */
static void without_means(const Features *f, Motion *m, const float x[CHANNELS], float speed, float signal[MEANS]) {
    const float samples = (float)m->taken;
    float residual[WHEELS];
    residuals(f, x, residual);
    for (int i = 0; i < MEANS; ++i) {
        const float sample = i < WHEELS ? within(residual[i] / speed, f->slip_least, f->slip_most) : x[AZ + i - WHEELS];
        const float rate = fmaxf(1.0f / (samples + f->zeros_before[i]), f->slowest_rates[i]);
        m->means[i] += (sample - m->means[i]) * rate;
        signal[i] = i < WHEELS ? residual[i] - m->means[i] * speed : sample - m->means[i];
    }
}

/* Slow rms of the body's motion over what is typical. */
static float level_of(const Features *f, Motion *m, const float free[INTEGRALS]) {
    float square = 0.0f;
    for (int i = 0; i < INTEGRALS; ++i) square += (free[i] / f->typical[i]) * (free[i] / f->typical[i]);
    const float rate = fmaxf(1.0f / ((float)m->taken + f->zeros_before[MEANS]), f->slowest_rates[MEANS]);
    m->energy += (square / INTEGRALS - m->energy) * rate;
    return sqrtf(m->energy + f->least_energy);
}

static const float *row_of(const Network *n, void *state, size_t age) {
    const size_t row = ((const Motion *)state)->newest + age;
    return delay_line(state) + LINE * (row < n->depth ? row : row - n->depth);
}

/* Cubic (Lagrange) between four rows of the delay line: sensor.carried.features.taken. */
static void delayed(const Network *n, void *state, float delay, float lead, float *out) {
    const float age = within(delay - lead, n->features->age_least, n->features->age_most);
    const float whole = floorf(age), p = age - whole, rest = 1.0f - p, rest2 = 2.0f - p, after = p + 1.0f;
    const float weight[4] = {p * rest * rest2 / -6.0f, after * rest * rest2 / 2.0f, after * p * rest2 / 2.0f, after * p * rest / -6.0f};
    const size_t number = (size_t)whole;
    const float *row[4] = {row_of(n, state, number ? number - 1 : 0), row_of(n, state, number), row_of(n, state, number + 1), row_of(n, state, number + 2)};
    for (int i = 0; i < DELAYED; ++i) {
        const int s = DELAYED_SIGNALS[i];
        out[i] = weight[0] * row[0][s] + weight[1] * row[1][s] + weight[2] * row[2][s] + weight[3] * row[3][s];
    }
}

/* The newest row of the delay line, and what it differs from the rows before it, once and twice. */
static void push(const Network *n, void *state, const float signal[LINE], float first[LINE], float second[LINE]) {
    Motion *m = state;
    const float *before = row_of(n, state, 0), *earlier = row_of(n, state, 1);
    for (int i = 0; i < LINE; ++i) {
        first[i] = signal[i] - before[i];
        second[i] = first[i] - (before[i] - earlier[i]);
    }
    m->newest = m->newest ? m->newest - 1 : (uint32_t)n->depth - 1;
    memcpy(delay_line(state) + LINE * m->newest, signal, LINE * sizeof *signal);
}

static void driving_features(const Features *f, const float x[CHANNELS], const float command[COMMANDS], float speed, float level, float *out) {
    const float values[DRIVING] = {x[AX], x[AY], x[YAW], x[VX] / f->speed_unit, f->slowness_unit / speed, logf(level),
                                   x[STEER_FL], x[STEER_FR], x[STEER], command[0], command[1], command[2], command[3]};
    memcpy(out, values, sizeof values);
}

float carried_features(const Network *n, void *state, const float x[CHANNELS], const float command[COMMANDS], float *features) {
    const Features *f = n->features;
    Motion *m = state;
    float signal[LINE], *moving = features + DRIVING;
    const float speed = fmaxf(x[VX], f->least_speed);
    if (m->taken < RECENT) ++m->taken;
    without_means(f, m, x, speed, signal);
    signal[7] = x[AX], signal[8] = x[AY], signal[9] = x[YAW];
    const float level = level_of(f, m, signal + WHEELS);
    driving_features(f, x, command, speed, level, features);
    for (int i = 0; i < INTEGRALS; ++i) m->integrals[i] = m->integrals[i] * f->integral_keep[i] + signal[WHEELS + i] * f->sample_time;
    memcpy(moving, signal, MEANS * sizeof *signal);
    memcpy(moving + MEANS, m->integrals, sizeof m->integrals);
    push(n, state, signal, moving + MEANS + INTEGRALS, moving + MEANS + INTEGRALS + LINE);
    for (size_t l = 0; l < n->leads; ++l) delayed(n, state, f->wheelbase_samples / speed, n->lead[l], moving + MOVING + DELAYED * l);
    for (size_t i = 0; i < n->feature_count - DRIVING; ++i)
        moving[i] = within(moving[i] / level / n->feature_scale[i], f->moving_least, f->moving_most);
    return level;
}
