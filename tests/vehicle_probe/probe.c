/* The plant's parts one at a time, for the tests: plain doubles in, plain doubles out. Linked with the vehicle's own
 * sources; tyre.c is included, because its Magic Formula is private to it. */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "table.h"
#include "tyre.c"

typedef struct {
    Model model;
    Vehicle vehicle;
} Plant;

void model_log(const Model *m, ModelStatus status, const char *category, const char *format, ...) {
    va_list list;
    (void)m, (void)status;
    va_start(list, format);
    fprintf(stderr, "%s: ", category);
    vfprintf(stderr, format, list);
    fputc('\n', stderr);
    va_end(list);
}

Plant *probe_new(void) {
    Plant *plant = calloc(1, sizeof *plant);
    if (plant) plant->model.v = model_start;
    return plant;
}

void probe_free(Plant *plant) { free(plant); }

/* 0, or -1 where there is no such variable. */
int probe_set(Plant *plant, const char *name, double value) {
    for (int kind = KIND_REAL; kind <= KIND_BOOLEAN; ++kind) {
        for (size_t k = 0; k < model_tables[kind].count; ++k) {
            const VariableInfo *row = &model_tables[kind].rows[k];
            char *place = (char *)&plant->model.v + row->offset;
            if (strcmp(row->name, name) != 0) continue;
            if (kind == KIND_REAL) memcpy(place, &value, sizeof value);
            else *(int *)place = value != 0;
            return 0;
        }
    }
    return -1;
}

int probe_prepare(Plant *plant) { return vehicle_constants(&plant->model, &plant->vehicle) == MODEL_OK ? 0 : -1; }

typedef struct {
    double quaternion[4];
    Vec velocity, rate;
    double travel[CORNERS], travel_rate[CORNERS], spin[CORNERS], compliance[CORNERS], rack, steer_rate[CORNERS];
    Vec force[CORNERS], moment[CORNERS], body_force, body_moment;
    double spring_force[CORNERS], damper_force[CORNERS];
} Motion;

typedef struct {
    Vec acceleration, angular_acceleration;
    double travel_acceleration[CORNERS], kinetic_energy;
    Vec r[CORNERS], v[CORNERS], rate[CORNERS], axle[CORNERS];
} Response;

void probe_multibody(const Plant *plant, const Motion *in, Response *out) {
    State x;
    Work w;
    memset(&x, 0, sizeof x);
    memset(&w, 0, sizeof w);
    memcpy(x.quaternion, in->quaternion, sizeof x.quaternion);
    memcpy(x.travel, in->travel, sizeof x.travel);
    memcpy(x.travel_rate, in->travel_rate, sizeof x.travel_rate);
    memcpy(x.spin, in->spin, sizeof x.spin);
    memcpy(x.compliance, in->compliance, sizeof x.compliance);
    x.velocity = in->velocity, x.rate = in->rate, x.rack = in->rack;
    rotation(x.quaternion, w.R);
    w.gravity = to_body(w.R, vec(0, 0, -plant->model.v.Env_Gravity));
    w.body_force = in->body_force, w.body_moment = in->body_moment;
    for (int i = 0; i < CORNERS; ++i) {
        Corner *k = &w.corner[i];
        corner_kinematics(&plant->model.v, &plant->vehicle, &x, i, k);
        k->steer_rate = in->steer_rate[i];
        k->rate = axpy(k->steer_rate, k->kingpin, k->rate);
        w.force[i] = in->force[i], w.moment[i] = in->moment[i];
        w.spring_force[i] = in->spring_force[i], w.damper_force[i] = in->damper_force[i];
        out->r[i] = k->r, out->v[i] = k->v, out->rate[i] = k->rate, out->axle[i] = k->axle;
    }
    out->kinetic_energy = kinetic_energy(&plant->model.v, &plant->vehicle, &x, &w);
    multibody_accelerations(&plant->model.v, &plant->vehicle, &x, &w);
    out->acceleration = w.acceleration, out->angular_acceleration = w.angular_acceleration;
    memcpy(out->travel_acceleration, w.travel_acceleration, sizeof out->travel_acceleration);
}

/* out: Fx, Fy, Mz, peak_x, peak_y */
void probe_magic_formula(const Plant *plant, double Fz, double kappa, double tan_alpha, double gamma, double side, double out[5]) {
    const Forces f = magic_formula(&plant->model.v, Fz, kappa, tan_alpha, gamma, side);
    out[0] = f.Fx, out[1] = f.Fy, out[2] = f.Mz, out[3] = f.peak_x, out[4] = f.peak_y;
}

double probe_relaxation_y(const Plant *plant, double Fz, double radius) { return tyre_relaxation_y(&plant->model.v, Fz, radius); }
double probe_rolling_radius(const Plant *plant, double Fz, double radius) { return tyre_rolling_radius(&plant->model.v, Fz, radius); }

typedef struct {
    double deflection, deflection_rate, sine_inclination, spin, stretch_x, stretch_y;
    Vec velocity;
} Rolling;

typedef struct {
    double Fx, Fy, Fz, Mz, My, slip_x, slip_y, stretch_x_rate, stretch_y_rate, dissipation, peak_x, peak_y;
} Grip;

/* One wheel on a flat road, its hub's velocity along the contact axes; the knuckle does not turn. */
void probe_tyre(const Plant *plant, const Rolling *in, int corner, Grip *out) {
    State x;
    Work w;
    memset(&x, 0, sizeof x);
    memset(&w, 0, sizeof w);
    x.spin[corner] = in->spin, x.stretch_x[corner] = in->stretch_x, x.stretch_y[corner] = in->stretch_y;
    Contact *t = &w.contact[corner];
    t->forward = vec(1, 0, 0), t->left = vec(0, 1, 0), t->normal = vec(0, 0, 1);
    t->deflection = in->deflection, t->deflection_rate = in->deflection_rate;
    t->sine_inclination = in->sine_inclination;
    t->loaded_radius = plant->vehicle.radius[corner] - in->deflection;
    t->arm = vec(0, 0, -t->loaded_radius);
    w.corner[corner].v = in->velocity;
    tyre_forces(&plant->model.v, &plant->vehicle, &x, &w, corner);
    const Tyre *y = &w.tyre[corner];
    const Forces f = magic_formula(&plant->model.v, y->Fz, y->slip_x, y->slip_y, in->sine_inclination, plant->vehicle.side[corner]);
    *out = (Grip){y->Fx, y->Fy, y->Fz, y->Mz, y->My, y->slip_x, y->slip_y, y->stretch_x_rate, y->stretch_y_rate,
                  y->dissipation, y->Fz > 0 ? f.peak_x : 0, y->Fz > 0 ? f.peak_y : 0};
}

/* which: 0 passive, 1 soft, 2 hard */
double probe_damper(const Plant *plant, int which, double velocity) {
    const Curve *curves[] = {&plant->vehicle.passive, &plant->vehicle.soft, &plant->vehicle.hard};
    return curve_value(curves[which], velocity);
}
