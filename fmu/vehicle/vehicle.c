/* The vehicle model as the FMI layer sees it: prepared, initialised, stepped. The equations are in derivative.c. */
#include <limits.h>
#include <stdlib.h>
#include <string.h>
#include "vehicle.h"

ModelStatus model_load(Model *m) {
    m->state_size = sizeof(Memory);
    return MODEL_OK;
}

ModelStatus model_prepare(Model *m) {
    model_release(m);
    Vehicle *c = calloc(1, sizeof *c);
    if (!c) {
        model_log(m, MODEL_ERROR, "logStatusError", "out of memory");
        return MODEL_ERROR;
    }
    m->derived = c;
    return vehicle_constants(m, c);
}

void model_release(Model *m) {
    Vehicle *c = m->derived;
    if (c) road_free(c->road);
    free(c);
    m->derived = NULL;
}

ModelStatus model_initialise(Model *m, double start) {
    (void)start; /* nothing in the model depends on the time */
    const Vehicle *c = m->derived;
    Memory *memory = m->state;
    Work w;
    State dx;
    memset(memory, 0, sizeof *memory);
    for (int i = 0; i <= CORNERS; ++i) memory->hint[i] = -1;
    const ModelStatus status = equilibrium(m, c, memory);
    if (status != MODEL_OK) return status;
    memory->steer = m->v.DM_Steer_Ang;
    vehicle_derivative(&m->v, c, memory, &memory->x, &w, &dx);
    imu_reading(c, &memory->x, &w, memory->x.imu);
    encoder_start(&m->v, memory, (const double *)&memory->x.spin);
    vehicle_outputs(&m->v, c, memory, &w);
    return MODEL_OK;
}

ModelStatus model_step(Model *m, double t, double h) {
    const Vehicle *c = m->derived;
    Memory *memory = m->state;
    Work w;
    const double wanted = fmax(ceil(h / m->v.Solver_Step - 1e-6), 1.0);
    if (wanted > INT_MAX) { /* hours of computing: a mistake in the unit of time, most likely */
        model_log(m, MODEL_ERROR, "logStatusError", "a step of %g s is cut into %g steps of Solver.Step = %g s; there may be %d", h, wanted, m->v.Solver_Step, INT_MAX);
        return MODEL_ERROR;
    }
    const int steps = (int)wanted;
    vehicle_integrate(&m->v, c, memory, h / steps, steps, &w);
    memory->steer = m->v.DM_Steer_Ang;
    vehicle_outputs(&m->v, c, memory, &w);
    const double *xs = (const double *)&memory->x;
    double sum = 0;
    for (int j = 0; j < STATES; ++j) sum += xs[j];
    if (isfinite(sum)) return MODEL_OK;
    model_log(m, MODEL_ERROR, "logStatusError", "the vehicle's state is no longer finite at t = %g s: lower Solver.Step or look at the inputs", t + h);
    return MODEL_ERROR;
}
