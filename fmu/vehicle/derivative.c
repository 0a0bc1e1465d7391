/* The equations of motion, from the state to its derivative, and the integrator. Read `derivative` first: its lines are
 * the model's parts, each in a header of its name, so that all of it becomes one function.
 *
 * The corners go through the arithmetic four at a time (four.h). On an x86-64 processor with AVX2 that is one
 * instruction, otherwise two; the bits are the same. */
#include <string.h>
#include "contact.h"
#include "multibody.h"
#include "powertrain.h"
#include "steering.h"
#include "suspension.h"
#include "tyre.h"
#include "vehicle.h"

INLINE void aerodynamics(const Variables *p, const Vehicle *c, const State *x, Work *w, State *dx) {
    const double v = x->velocity.x, pressure = p->Aero_Density * p->Aero_Area * v * v / 2;
    const double drag = (v < 0 ? 1 : -1) * p->Aero_Drag * pressure;
    const double front = p->Aero_LiftFront * pressure, rear = p->Aero_LiftRear * pressure;
    w->body_force = vec(drag, 0, front + rear);
    w->body_moment = vec(0, -front * c->hub.x[FL] - rear * c->hub.x[RL], 0);
    dx->dissipated = -(drag * v + (front + rear) * x->velocity.z + w->body_moment.y * x->rate.y);
}

/* Force of the wheels' imbalance at their centres: it turns with the wheel. */
static Vec4 imbalance(const Variables *p, const State *x, const Contact *t) {
    const Four angle = x->angle, size = FOUR(p->Wheel_Imbalance) * x->spin * x->spin;
    const Four s = {sin(angle[FL]), sin(angle[FR]), sin(angle[RL]), sin(angle[RR])};
    const Four c = {cos(angle[FL]), cos(angle[FR]), cos(angle[RL]), cos(angle[RR])};
    return axpy(size * s, t->forward, scale(size * c, t->normal));
}

/* Tyre forces and wheel imbalance as a wrench at the wheel centre; what turns the wheel is kept apart. */
INLINE void wheel_loads(const Variables *p, const Vehicle *c, const State *x, Work *w) {
    const Contact *t = &w->contact;
    const Tyre *y = &w->tyre;
    const Vec4 axle = w->corner.axle;
    const Vec4 force = axpy(y->Fx, t->forward, axpy(y->Fy, t->left, scale(y->Fz, t->normal)));
    /* Power needs the rolling radius as Fx's lever about the axle: what the loaded radius gives too much or too
     * little is the forward shift of the vertical force (Pacejka, 3rd ed., section 1.2). */
    const Four about_axle = y->My + y->Fx * (t->loaded_radius - y->rolling_radius);
    const Vec4 moment = axpy(about_axle, axle, axpy(y->Mz, t->normal, cross(t->arm, force)));
    w->force = c->is_imbalanced ? add(force, imbalance(p, x, t)) : force;
    w->axial_moment = dot(moment, axle);
    w->moment = axpy(-w->axial_moment, axle, moment);
}

INLINE void kinematic_rates(const State *x, const Work *w, State *dx) {
    const double *q = x->quaternion;
    const Vec o = x->rate;
    dx->position = to_inertial(w->R, x->velocity);
    dx->quaternion[0] = -(q[1] * o.x + q[2] * o.y + q[3] * o.z) / 2;
    dx->quaternion[1] = (q[0] * o.x + q[2] * o.z - q[3] * o.y) / 2;
    dx->quaternion[2] = (q[0] * o.y + q[3] * o.x - q[1] * o.z) / 2;
    dx->quaternion[3] = (q[0] * o.z + q[1] * o.y - q[2] * o.x) / 2;
    dx->velocity = sub(w->acceleration, cross(o, x->velocity));
    dx->rate = w->angular_acceleration;
    dx->travel = x->travel_rate;
    dx->travel_rate = w->travel_acceleration;
}

INLINE void lag_rates(const Variables *p, const State *x, const Work *w, State *dx) {
    dx->stretch_x = w->tyre.stretch_x_rate;
    dx->stretch_y = w->tyre.stretch_y_rate;
    dx->valve = (FOUR(p->Car_SuspControl_Damper_CtrlOut) - x->valve) * (1 / p->Damp_ValveLag);
    dx->compliance = w->compliance_rate;
    dx->rack = w->rack_rate;
    dx->dissipated += sum(w->tyre.dissipation - w->damper_force * x->travel_rate);
}

/* Butterworth, second order. */
INLINE void imu_rates(const Variables *p, const Vehicle *c, const State *x, const Work *w, State *dx) {
    if (p->Sensor_Imu_Cutoff <= 0) {
        memset(dx->imu, 0, sizeof dx->imu + sizeof dx->imu_rate);
        return;
    }
    double reading[6];
    const double omega = 6.283185307179586 * p->Sensor_Imu_Cutoff;
    imu_reading(c, x, w, reading);
    for (int j = 0; j < 6; ++j) {
        dx->imu[j] = x->imu_rate[j];
        dx->imu_rate[j] = omega * (omega * (reading[j] - x->imu[j]) - 1.4142135623730951 * x->imu_rate[j]);
    }
}

INLINE void derivative(const Variables *p, const Vehicle *c, Memory *m, const State *x, Work *w, State *dx) {
    rotation(x->quaternion, w->R);
    w->gravity = to_body(w->R, vec(0, 0, -p->Env_Gravity));
    aerodynamics(p, c, x, w, dx);
    corner_kinematics(p, c, x, &w->corner);
    contact_patches(p, c, x, w, m->hint);
    tyre_forces(p, c, x, w);
    wheel_loads(p, c, x, w);
    suspension_forces(p, c, x, w);
    powertrain(p, c, x, w, dx);
    steering_rates(p, c, x, p->DM_Steer_Ang, w);
    multibody_accelerations(p, c, x, w);
    kinematic_rates(x, w, dx);
    lag_rates(p, x, w, dx);
    imu_rates(p, c, x, w, dx);
}

/* What the continuous equations leave to be kept: the quaternion's length and the limit of the brake's friction. */
INLINE void settle(const Variables *p, State *x) {
    double *q = x->quaternion;
    const double per_length = 1 / sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    for (int j = 0; j < 4; ++j) q[j] *= per_length;
    const Four slip = larger(x->brake_torque, splat(0.0)) * (1 / p->Brake_Stiffness);
    x->brake_windup = within(x->brake_windup, -slip, slip);
}

/* x += h * (weighted derivatives f, g, e) over the state as one array. A lag that dies away would end in subnormal
 * numbers, which cost a processor a hundred cycles each: they are zero here. */
INLINE void advance(State *x, double h, const double weight[3], const State *f, const State *g, const State *e) {
    _Static_assert(STATES % CORNERS == 0, "the state is advanced four doubles at a time");
    Four *xs = (Four *)x;
    const Four *fs = (const Four *)f, *gs = (const Four *)g, *es = (const Four *)e;
    for (int j = 0; j < STATES / CORNERS; ++j) {
        const Four next = xs[j] + h * (weight[0] * fs[j] + weight[1] * gs[j] + weight[2] * es[j]);
        xs[j] = choose(magnitude(next) < 1e-150, splat(0.0), next);
    }
}

INLINE void step_on(const Variables *p, Memory *m, double h, const double weight[3], const State *f, const State *g, const State *e) {
    const Four angle = m->x.angle;
    advance(&m->x, h, weight, f, g, e);
    settle(p, &m->x);
    if (encoder_is_on(p)) encoder_step(p, m, (const double *)&angle, h);
}

typedef void Derivative(const Variables *p, const Vehicle *c, Memory *m, const State *x, Work *w, State *dx);

/* Weights of the derivatives now, before and earlier. A quarter of the way from Adams-Bashforth 2 to Adams-Bashforth 3:
 * a quarter of the second-order error is gone, and hard dampers stay inside the region of stability, which shrinks from 1
 * to 0.83 (docs/decisions/0001-integrator.md). */
static const double EULER[3] = {1, 0, 0}, HEUN[3] = {0.5, 0.5, 0}, ADAMS_BASHFORTH_2[3] = {1.5, -0.5, 0};
static const double BLENDED[3] = {1.5 + 5.0 / 48, -0.5 - 10.0 / 48, 5.0 / 48};

/* One evaluation a step. The inputs jump at every communication point, where earlier derivatives are of no use: the first
 * step is Heun's, which also makes a communication step depend on nothing but the state. From then on the travels take the
 * mean of the old and the new rate, which is there for nothing and five times as exact as an extrapolation. The evaluation
 * at the end serves the outputs. */
INLINE void integrate(const Variables *p, const Vehicle *c, Memory *m, double h, int steps, Work *w, Derivative *evaluate) {
    State f[3], trial = m->x;
    evaluate(p, c, m, &m->x, w, &f[0]);
    advance(&trial, h, EULER, &f[0], &f[0], &f[0]);
    settle(p, &trial);
    evaluate(p, c, m, &trial, w, &f[1]);
    step_on(p, m, h, HEUN, &f[0], &f[1], &f[0]);
    for (int n = 1; n < steps; ++n) {
        State *now = &f[n % 3], *before = &f[(n + 2) % 3], *earlier = n > 1 ? &f[(n + 1) % 3] : before;
        const Four travel = m->x.travel, rate = m->x.travel_rate;
        evaluate(p, c, m, &m->x, w, now);
        step_on(p, m, h, n > 1 ? BLENDED : ADAMS_BASHFORTH_2, now, before, earlier);
        m->x.travel = travel + h / 2 * (rate + m->x.travel_rate);
    }
    evaluate(p, c, m, &m->x, w, &f[0]);
}

#if defined(__x86_64__) && defined(__GNUC__) && !defined(WITHOUT_AVX2)
#define AVX2 __attribute__((target("avx2")))
static AVX2 __attribute__((noinline)) void derivative_avx2(
    const Variables *p, const Vehicle *c, Memory *m, const State *x, Work *w, State *dx) {
    derivative(p, c, m, x, w, dx);
}
static AVX2 void integrate_avx2(const Variables *p, const Vehicle *c, Memory *m, double h, int steps, Work *w) {
    integrate(p, c, m, h, steps, w, derivative_avx2);
}
#define HAS_AVX2 __builtin_cpu_supports("avx2")
#else
#define HAS_AVX2 0
#define derivative_avx2 derivative_plain
#define integrate_avx2 integrate_plain
#endif

static __attribute__((noinline)) void derivative_plain(
    const Variables *p, const Vehicle *c, Memory *m, const State *x, Work *w, State *dx) {
    derivative(p, c, m, x, w, dx);
}
static void integrate_plain(const Variables *p, const Vehicle *c, Memory *m, double h, int steps, Work *w) {
    integrate(p, c, m, h, steps, w, derivative_plain);
}

void vehicle_derivative(const Variables *p, const Vehicle *c, Memory *m, const State *x, Work *w, State *dx) {
    if (HAS_AVX2) derivative_avx2(p, c, m, x, w, dx);
    else derivative_plain(p, c, m, x, w, dx);
}

void vehicle_integrate(const Variables *p, const Vehicle *c, Memory *m, double h, int steps, Work *w) {
    if (HAS_AVX2) integrate_avx2(p, c, m, h, steps, w);
    else integrate_plain(p, c, m, h, steps, w);
}
