/* Commands that tell what the controller was told: FL half plus a thousandth of the chosen input, FR the step's end over
 * 100 s, RL whether the estimate counts, RR the number of steps over 10 000. They leave in percent. */
#include <string.h>
#include "model.h"

typedef struct {
    double steps;
} State;

ModelStatus model_load(Model *m)
{
    m->state_size = sizeof(State);
    return MODEL_OK;
}

ModelStatus model_prepare(Model *m)
{
    (void)m;
    return MODEL_OK;
}

static void echo(Model *m, double time)
{
    double told;
    const State *s = m->state;
    double *out = m->v.Car_SuspControl_Damper_CtrlOut;
    memcpy(&told, (const char *)&m->v.Car_ax + (size_t)m->v.Echo_Input * sizeof told, sizeof told);
    out[0] = 100 * (0.5 + 0.001 * told);
    out[1] = time;
    out[2] = m->v.Sensor_Valid ? 100.0 : 0.0;
    out[3] = s->steps / 100;
}

ModelStatus model_initialise(Model *m, double start)
{
    State *s = m->state;
    s->steps = 0;
    echo(m, start);
    return MODEL_OK;
}

ModelStatus model_step(Model *m, double t, double h)
{
    State *s = m->state;
    s->steps++;
    echo(m, t + h);
    if (m->v.Echo_FailAt >= 0 && t + h > m->v.Echo_FailAt) {
        model_log(m, MODEL_ERROR, "logStatusError", "it lost its voice");
        return MODEL_ERROR;
    }
    return MODEL_OK;
}

void model_release(Model *m)
{
    (void)m;
}
