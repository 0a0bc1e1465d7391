/* A controller FMU to start from: continuous skyhook, with the damper map of the built-in vehicle. A law without a
 * memory; one with a state keeps it in m->state, whose size model_load() gives (fmu/common/model.h). */
#include <math.h>
#include "model.h"

enum { CORNERS = 4, INNER = 5, POINTS = 2 * INNER + 1 };

/* Force [N] at a front wheel over the extension speed [m/s]: soft and hard. */
static const double SPEED[POINTS] = {-1.0, -0.5, -0.25, -0.1, -0.05, 0.0, 0.05, 0.1, 0.25, 0.5, 1.0};
static const double SOFT[POINTS] = {-650, -380, -230, -120, -65, 0, 110, 190, 330, 560, 1000};
static const double HARD[POINTS] = {-3000, -2150, -1550, -900, -520, 0, 900, 1500, 2350, 3300, 4900};
#define LEAST_SPAN 1.0 /* N; where soft and hard are nearer to each other, no command is better */

static double secant(const double force[], int k)
{
    return (force[k + 1] - force[k]) / (SPEED[k + 1] - SPEED[k]);
}

/* Slope of a monotone cubic at a point: the weighted harmonic mean of its secants (Fritsch & Butland, SIAM J. Sci. Stat.
 * Comput. 5, 1984). */
static double slope(const double force[], int k)
{
    if (k == 0 || k == POINTS - 1)
        return secant(force, k ? k - 1 : 0);
    double before = SPEED[k] - SPEED[k - 1], after = SPEED[k + 1] - SPEED[k];
    double w0 = 2 * after + before, w1 = after + 2 * before;
    return (w0 + w1) / (w0 / secant(force, k - 1) + w1 / secant(force, k));
}

/* Force at an extension speed; straight beyond the table. */
static double force_at(const double force[], double v)
{
    int k = 0;
    while (k < POINTS && v >= SPEED[k])
        k++;
    if (k == 0)
        return force[0] + (v - SPEED[0]) * slope(force, 0);
    double t = v - SPEED[k - 1], a = slope(force, k - 1);
    if (k == POINTS)
        return force[POINTS - 1] + t * a;
    double h = SPEED[k] - SPEED[k - 1], s = secant(force, k - 1), b = slope(force, k);
    return force[k - 1] + t * (a + t * ((3 * s - 2 * a - b) / h + t * ((a + b - 2 * s) / (h * h))));
}

/* The command whose force comes nearest to the wanted one; a damper only resists. */
static double command(double wanted, double v, double scale)
{
    if (wanted * v <= 0.0)
        return 0.0;
    double soft = scale * force_at(SOFT, v), span = scale * force_at(HARD, v) - soft;
    return fabs(span) <= LEAST_SPAN ? 0.0 : fmin(fmax((wanted - soft) / span, 0.0), 1.0);
}

ModelStatus model_load(Model *m)
{
    m->state_size = 0;
    return MODEL_OK;
}

ModelStatus model_prepare(Model *m)
{
    (void)m;
    return MODEL_OK;
}

/* The outputs at t_0 follow from the inputs at t_0: the first command of a run. */
ModelStatus model_initialise(Model *m, double start)
{
    return model_step(m, start, 0.0);
}

ModelStatus model_step(Model *m, double t, double h)
{
    (void)t, (void)h;
    Variables *v = &m->v;
    for (int i = 0; i < CORNERS; i++)
        v->Car_SuspControl_Damper_CtrlOut[i] = command(v->Skyhook_Gain * v->VBody[i], v->VRel[i], v->Damp_Scale[i]);
    return MODEL_OK;
}

void model_release(Model *m)
{
    (void)m;
}
