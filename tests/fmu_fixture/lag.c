/* x' = (gain u - x) / T, exact over a step with u held: the model of the tests of the FMI ceremony. */
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "model.h"

typedef struct {
    double x[4];
} State;

typedef struct {
    double gain;
} Derived;

ModelStatus model_load(Model *m)
{
    m->state_size = sizeof(State);
    return MODEL_OK;
}

ModelStatus model_prepare(Model *m)
{
    model_release(m);
    Derived *derived = calloc(1, sizeof *derived);
    if (!derived)
        return MODEL_ERROR;
    m->derived = derived;
    derived->gain = 1.0;
    if (!m->v.Gain_File[0])
        return MODEL_OK;
    char path[4096];
    bool absolute = m->v.Gain_File[0] == '/';
    snprintf(path, sizeof path, "%s/%s", absolute ? "" : m->resources, m->v.Gain_File);
    FILE *file = fopen(path, "r");
    if (!file || fscanf(file, "%lf", &derived->gain) != 1) {
        model_log(m, MODEL_ERROR, "logGain", "Gain.File = \"%s\": cannot read a number from %s.", m->v.Gain_File, path);
        if (file)
            fclose(file);
        return MODEL_ERROR;
    }
    fclose(file);
    model_log(m, MODEL_OK, "logGain", "The gain is %g (100 %% of #1).", derived->gain);
    return MODEL_OK;
}

static void outputs(Model *m)
{
    const State *s = m->state;
    for (int i = 0; i < 4; i++)
        m->v.Out[i] = m->v.Lag_Saturate ? fmin(fmax(s->x[i], -3.0), 3.0) : s->x[i];
    m->v.Out_Above = m->v.Out[0] > 1.0;
    strncpy(m->v.Out_Resources, m->resources, MODEL_STRING_SIZE - 1);
}

ModelStatus model_initialise(Model *m, double start)
{
    (void)start;
    State *s = m->state;
    for (int i = 0; i < 4; i++)
        s->x[i] = m->v.Lag_Start;
    outputs(m);
    return MODEL_OK;
}

ModelStatus model_step(Model *m, double t, double h)
{
    (void)t;
    State *s = m->state;
    const Derived *derived = m->derived;
    double target = derived->gain * m->v.Lag_Gain * m->v.In_u;
    for (int i = 0; i < 4 && !m->v.In_Hold; i++)
        s->x[i] = target + (s->x[i] - target) * exp(-h / m->v.Lag_Time[i]);
    outputs(m);
    if (m->v.In_u == -7.5) /* a way to fail */
        m->v.Out[1] = NAN;
    return MODEL_OK;
}

void model_release(Model *m)
{
    free(m->derived);
    m->derived = NULL;
}
