/* The vehicle model: from inputs and state to the state one step on. Read `vehicle_derivative` first. */
#include <stdlib.h>
#include <string.h>
#include "vehicle.h"

const size_t model_state_size = sizeof(Memory);

static void aerodynamics(const Variables *p, const Vehicle *c, const State *x, Work *w, State *dx) {
    const double v = x->velocity.x, pressure = p->Aero_Density * p->Aero_Area * v * v / 2;
    const double drag = (v < 0 ? 1 : -1) * p->Aero_Drag * pressure;
    const double front = p->Aero_LiftFront * pressure, rear = p->Aero_LiftRear * pressure;
    w->body_force = vec(drag, 0, front + rear);
    w->body_moment = vec(0, -front * c->hub[FL].x - rear * c->hub[RL].x, 0);
    dx->dissipated -= drag * v + (front + rear) * x->velocity.z + w->body_moment.y * x->rate.y;
}

/* Tyre forces and wheel imbalance as a wrench at the wheel centre; what turns the wheel is kept apart. */
static void wheel_loads(const Variables *p, const State *x, Work *w, int i) {
    const Contact *t = &w->contact[i];
    const Tyre *y = &w->tyre[i];
    const Vec axle = w->corner[i].axle;
    Vec force = axpy(y->Fx, t->forward, axpy(y->Fy, t->left, scale(y->Fz, t->normal)));
    /* Power needs the rolling radius as Fx's lever about the axle: what the loaded radius gives too much or too
     * little is the forward shift of the vertical force (Pacejka, 3rd ed., section 1.2). */
    const double about_axle = y->My + y->Fx * (t->loaded_radius - y->rolling_radius);
    const Vec moment = axpy(about_axle, axle, axpy(y->Mz, t->normal, cross(t->arm, force)));
    if (p->Wheel_Imbalance[i] > 0) {
        const double size = p->Wheel_Imbalance[i] * x->spin[i] * x->spin[i];
        force = add(force, scale(size, axpy(sin(x->angle[i]), t->forward, scale(cos(x->angle[i]), t->normal))));
    }
    w->axial_moment[i] = dot(moment, axle);
    w->force[i] = force;
    w->moment[i] = axpy(-w->axial_moment[i], axle, moment);
}

static void kinematic_rates(const State *x, const Work *w, State *dx) {
    const double *q = x->quaternion;
    const Vec o = x->rate;
    dx->position = to_inertial(w->R, x->velocity);
    dx->quaternion[0] = -(q[1] * o.x + q[2] * o.y + q[3] * o.z) / 2;
    dx->quaternion[1] = (q[0] * o.x + q[2] * o.z - q[3] * o.y) / 2;
    dx->quaternion[2] = (q[0] * o.y + q[3] * o.x - q[1] * o.z) / 2;
    dx->quaternion[3] = (q[0] * o.z + q[1] * o.y - q[2] * o.x) / 2;
    dx->velocity = sub(w->acceleration, cross(o, x->velocity));
    dx->rate = w->angular_acceleration;
    memcpy(dx->travel, x->travel_rate, sizeof dx->travel);
    memcpy(dx->travel_rate, w->travel_acceleration, sizeof dx->travel_rate);
}

static void lag_rates(const Variables *p, const Vehicle *c, const State *x, const Work *w, State *dx) {
    for (int i = 0; i < CORNERS; ++i) {
        dx->stretch_x[i] = w->tyre[i].stretch_x_rate;
        dx->stretch_y[i] = w->tyre[i].stretch_y_rate;
        dx->valve[i] = (p->Car_SuspControl_Damper_CtrlOut[i] - x->valve[i]) / p->Damp_ValveLag;
        dx->compliance[i] = w->compliance_rate[i];
        dx->dissipated += w->tyre[i].dissipation - w->damper_force[i] * x->travel_rate[i];
    }
    dx->rack = w->rack_rate;
    if (p->Sensor_Imu_Cutoff <= 0) return;
    double reading[6];
    const double omega = 6.283185307179586 * p->Sensor_Imu_Cutoff;
    imu_reading(c, x, w, reading);
    for (int j = 0; j < 6; ++j) { /* Butterworth, second order */
        dx->imu[j] = x->imu_rate[j];
        dx->imu_rate[j] = omega * (omega * (reading[j] - x->imu[j]) - 1.4142135623730951 * x->imu_rate[j]);
    }
}

void vehicle_derivative(const Variables *p, const Vehicle *c, Memory *m, const State *x, Work *w, State *dx) {
    memset(dx, 0, sizeof *dx);
    rotation(x->quaternion, w->R);
    w->gravity = to_body(w->R, vec(0, 0, -p->Env_Gravity));
    aerodynamics(p, c, x, w, dx);
    for (int i = 0; i < CORNERS; ++i) {
        corner_kinematics(p, c, x, i, &w->corner[i]);
        contact_patch(p, c, x, w, &m->hint[i], i);
        tyre_forces(p, c, x, w, i);
        wheel_loads(p, x, w, i);
    }
    suspension_forces(p, c, x, w);
    powertrain(p, c, x, w, dx);
    steering_rates(p, c, x, p->DM_Steer_Ang, w);
    multibody_accelerations(p, c, x, w);
    kinematic_rates(x, w, dx);
    lag_rates(p, c, x, w, dx);
}

/* What the continuous equations leave to be kept: the quaternion's length and the limits of friction and carcass. */
static void settle(const Variables *p, State *x) {
    double *q = x->quaternion, length = sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    for (int j = 0; j < 4; ++j) q[j] /= length;
    for (int i = 0; i < CORNERS; ++i) {
        const double slip = fmax(x->brake_torque[i], 0) / p->Brake_Stiffness;
        x->brake_windup[i] = clamp(x->brake_windup[i], -slip, slip);
    }
}

/* x += h * (a * f + b * g) over the state as one array. A lag that dies away would end in subnormal numbers, which cost
 * a processor a hundred cycles each: they are zero here. */
static void advance(State *x, double h, double a, const State *f, double b, const State *g) {
    double *xs = (double *)x;
    const double *fs = (const double *)f, *gs = (const double *)g;
    for (int j = 0; j < STATES; ++j) {
        const double next = xs[j] + h * (a * fs[j] + b * gs[j]);
        xs[j] = fabs(next) < 1e-150 ? 0.0 : next;
    }
}

/* Second-order Adams-Bashforth: one evaluation a step. The inputs jump at every communication point, where the previous
 * derivative is of no use: the first step is Heun's, which also makes a communication step depend on nothing but the
 * state. The evaluation at the end serves the outputs. */
static void integrate(const Variables *p, const Vehicle *c, Memory *m, double h, int steps, Work *w) {
    State f[2], trial = m->x;
    vehicle_derivative(p, c, m, &m->x, w, &f[0]);
    advance(&trial, h, 1, &f[0], 0, &f[0]);
    settle(p, &trial);
    vehicle_derivative(p, c, m, &trial, w, &f[1]);
    advance(&m->x, h, 0.5, &f[0], 0.5, &f[1]);
    settle(p, &m->x);
    for (int n = 1; n < steps; ++n) {
        State *now = &f[n & 1], *before = &f[(n & 1) ^ 1];
        vehicle_derivative(p, c, m, &m->x, w, now);
        advance(&m->x, h, 1.5, now, -0.5, before);
        settle(p, &m->x);
    }
    vehicle_derivative(p, c, m, &m->x, w, &f[0]);
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

ModelStatus model_initialise(Model *m) {
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
    vehicle_outputs(&m->v, c, memory, &w);
    return MODEL_OK;
}

ModelStatus model_step(Model *m, double t, double h) {
    const Vehicle *c = m->derived;
    Memory *memory = m->state;
    Work w;
    const int steps = (int)ceil(h / m->v.Solver_Step - 1e-6);
    integrate(&m->v, c, memory, h / (steps < 1 ? 1 : steps), steps < 1 ? 1 : steps, &w);
    memory->steer = m->v.DM_Steer_Ang;
    vehicle_outputs(&m->v, c, memory, &w);
    const double *xs = (const double *)&memory->x;
    double sum = 0;
    for (int j = 0; j < STATES; ++j) sum += xs[j];
    if (isfinite(sum)) return MODEL_OK;
    model_log(m, MODEL_ERROR, "logStatusError", "the vehicle's state is no longer finite at t = %g s: lower Solver.Step or look at the inputs", t + h);
    return MODEL_ERROR;
}
