/* The plant's parts one at a time, for the tests: plain doubles in, plain doubles out. Linked with the vehicle's own
 * sources, whose parts are headers. */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "table.h"
#include "multibody.h"
#include "suspension.h"
#include "tyre.h"

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
    if (plant) {
        plant->model.v = model_start;
        plant->model.resources = "";
    }
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

static Vec4 corners(const Vec a[CORNERS]) {
    return vec4((Four){a[0].x, a[1].x, a[2].x, a[3].x}, (Four){a[0].y, a[1].y, a[2].y, a[3].y}, (Four){a[0].z, a[1].z, a[2].z, a[3].z});
}

void probe_multibody(const Plant *plant, const Motion *in, Response *out) {
    State x;
    Work w;
    memset(&x, 0, sizeof x);
    memset(&w, 0, sizeof w);
    memcpy(x.quaternion, in->quaternion, sizeof x.quaternion);
    x.travel = FOUR(in->travel), x.travel_rate = FOUR(in->travel_rate);
    x.spin = FOUR(in->spin), x.compliance = FOUR(in->compliance);
    x.velocity = in->velocity, x.rate = in->rate, x.rack = in->rack;
    rotation(x.quaternion, w.R);
    w.gravity = to_body(w.R, vec(0, 0, -plant->model.v.Env_Gravity));
    w.body_force = in->body_force, w.body_moment = in->body_moment;
    Corners *k = &w.corner;
    corner_kinematics(&plant->model.v, &plant->vehicle, &x, k);
    k->steer_rate = FOUR(in->steer_rate);
    k->rate = axpy(k->steer_rate, k->kingpin, k->rate);
    w.force = corners(in->force), w.moment = corners(in->moment);
    w.spring_force = FOUR(in->spring_force), w.damper_force = FOUR(in->damper_force);
    for (int i = 0; i < CORNERS; ++i) {
        out->r[i] = corner_of(k->r, i), out->v[i] = corner_of(k->v, i);
        out->rate[i] = corner_of(k->rate, i), out->axle[i] = corner_of(k->axle, i);
    }
    out->kinetic_energy = kinetic_energy(&plant->model.v, &plant->vehicle, &x, &w);
    multibody_accelerations(&plant->model.v, &plant->vehicle, &x, &w);
    out->acceleration = w.acceleration, out->angular_acceleration = w.angular_acceleration;
    memcpy(out->travel_acceleration, &w.travel_acceleration, sizeof out->travel_acceleration);
}

/* out: Fx, Fy, Mz, peak_x, peak_y */
void probe_magic_formula(const Plant *plant, double Fz, double kappa, double tan_alpha, double gamma, double side, double out[5]) {
    const Forces f = magic_formula(&plant->model.v, splat(Fz), splat(kappa), splat(tan_alpha), splat(gamma), splat(side));
    out[0] = f.Fx[0], out[1] = f.Fy[0], out[2] = f.Mz[0], out[3] = f.peak_x[0], out[4] = f.peak_y[0];
}

double probe_relaxation_y(const Plant *plant, double Fz, double radius) {
    return tyre_relaxation_y(&plant->model.v, splat(Fz), splat(radius))[0];
}
double probe_rolling_radius(const Plant *plant, double Fz, double radius) {
    return tyre_rolling_radius(&plant->model.v, splat(Fz), splat(radius))[0];
}

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
    x.spin = splat(in->spin), x.stretch_x = splat(in->stretch_x), x.stretch_y = splat(in->stretch_y);
    Contact *t = &w.contact;
    t->forward = spread(vec(1, 0, 0)), t->left = spread(vec(0, 1, 0)), t->normal = spread(vec(0, 0, 1));
    t->deflection = splat(in->deflection), t->deflection_rate = splat(in->deflection_rate);
    t->sine_inclination = splat(in->sine_inclination);
    t->loaded_radius = plant->vehicle.radius - in->deflection;
    t->arm = vec4(splat(0.0), splat(0.0), -t->loaded_radius);
    w.corner.v = spread(in->velocity);
    tyre_forces(&plant->model.v, &plant->vehicle, &x, &w);
    const Tyre *y = &w.tyre;
    const int i = corner, touches = y->Fz[i] > 0;
    const Forces f = magic_formula(&plant->model.v, y->Fz, y->slip_x, y->slip_y, t->sine_inclination, plant->vehicle.side);
    *out = (Grip){y->Fx[i], y->Fy[i], y->Fz[i], y->Mz[i], y->My[i], y->slip_x[i], y->slip_y[i], y->stretch_x_rate[i],
                  y->stretch_y_rate[i], y->dissipation[i], touches ? f.peak_x[i] : 0, touches ? f.peak_y[i] : 0};
}

/* which: 0 passive, 1 soft, 2 hard */
double probe_damper(const Plant *plant, int which, double velocity) {
    const Curve *curves[] = {&plant->vehicle.passive, &plant->vehicle.soft, &plant->vehicle.hard};
    return curve_values(curves[which], splat(velocity))[0];
}

/* which: 0 sine, 1 cosine, 2 arctangent, 3 exponential */
void probe_elementary(int which, int n, const double x[], double out[]) {
    for (int k = 0; k < n; ++k) {
        const Four a = splat(x[k]), y = which == 0 ? sine(a) : which == 1 ? cosine(a) : which == 2 ? arctangent(a) : exponential(a);
        out[k] = y[k & 3];
    }
}

/* A wheel that turns to angle[k] at time k h; out[n] is the sensor's reading after every `steps` of these. */
void probe_encoder(const Plant *plant, int readings, int steps, double h, const double angle[], double out[]) {
    Memory m;
    double speed[CORNERS];
    memset(&m, 0, sizeof m);
    m.x.angle = splat(angle[0]);
    encoder_start(&plant->model.v, &m, (double[CORNERS]){0});
    for (int n = 0; n < readings; ++n) {
        for (int k = 1; k <= steps; ++k) {
            const Four before = m.x.angle;
            m.x.angle = splat(angle[n * steps + k]);
            encoder_step(&plant->model.v, &m, (const double *)&before, h);
        }
        encoder_read(&plant->model.v, &m, speed);
        out[n] = speed[n % CORNERS];
    }
}
