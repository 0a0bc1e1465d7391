/* The start: the car stands or rolls in static equilibrium on the road where it is put.
 *
 * Nine unknowns (heave, roll, pitch, four travels, and one longitudinal and one lateral slip common to the wheels) make
 * nine accelerations vanish; Newton's method with a finite-difference Jacobian on the model's own derivative. The
 * states behind (spins, motor torques, brakes, rack) are set to the values that balance. */
#include <string.h>
#include "powertrain.h"
#include "tyre.h"
#include "vehicle.h"

enum { UNKNOWNS = 9, ITERATIONS = 40 };

typedef struct {
    Model *model;
    const Vehicle *c;
    Memory *memory;
    double speed;
    Work w;
    State dx;
} Start;

static void euler_quaternion(double roll, double pitch, double yaw, double q[4]) {
    const double cr = cos(roll / 2), sr = sin(roll / 2), cp = cos(pitch / 2), sp = sin(pitch / 2);
    const double cy = cos(yaw / 2), sy = sin(yaw / 2);
    q[0] = cr * cp * cy + sr * sp * sy, q[1] = sr * cp * cy - cr * sp * sy;
    q[2] = cr * sp * cy + sr * cp * sy, q[3] = cr * cp * sy - sr * sp * cy;
}

static void evaluate(Start *s) {
    vehicle_derivative(&s->model->v, s->c, s->memory, &s->memory->x, &s->w, &s->dx);
}

static void set_pose(Start *s, const double y[UNKNOWNS]) {
    State *x = &s->memory->x;
    const Variables *p = &s->model->v;
    double R[9];
    euler_quaternion(y[1], y[2], p->Init_Yaw, x->quaternion);
    rotation(x->quaternion, R);
    x->position = sub(vec(p->Init_x, p->Init_y, y[0]), to_inertial(R, s->c->cog));
    x->travel = FOUR(y + 3);
}

/* Velocity along the road, spins, carcass, motors, brakes and rack as the pose and the slips ask. */
static void set_balance(Start *s, double slip_x, double slip_y) {
    State *x = &s->memory->x;
    const Variables *p = &s->model->v;
    const Tyre *t = &s->w.tyre;
    const Vec normal = unit(total(s->w.contact.normal));
    const Vec forward = unit(sub(vec(1, 0, 0), scale(normal.x, normal)));
    x->velocity = add(scale(s->speed, forward), scale(s->speed * slip_y, cross(normal, forward)));
    x->spin = dot(spread(x->velocity), s->w.contact.forward) * (1 + slip_x) / t->rolling_radius;
    x->stretch_x = splat(slip_x * p->Tire_RelaxationX);
    x->stretch_y = -slip_y * tyre_relaxation_y(p, t->Fz, s->c->radius);
    x->compliance = FOUR(p->Kin_LateralForceSteer) * t->Fy;
    const Four torque = -s->w.axial_moment;
    if (s->speed > 0) {
        x->windup = torque / FOUR(p->PT_ShaftStiffness);
        x->motor_torque = torque / p->PT_GearRatio;
    } else {
        x->brake_windup = within(-torque, -x->brake_torque, x->brake_torque) / p->Brake_Stiffness;
    }
    x->motor_speed = x->spin - dot(spread(x->rate), s->w.corner.axle);
    x->rack += s->w.rack_rate * p->Steer_Damping / p->Steer_Stiffness;
}

static void residual(Start *s, const double y[UNKNOWNS], double f[UNKNOWNS]) {
    set_pose(s, y);
    for (int pass = 0; pass < 3; ++pass) { /* loads -> rolling radius -> spins -> loads */
        evaluate(s);
        set_balance(s, y[7], y[8]);
    }
    evaluate(s);
    const Vec a = s->w.acceleration, alpha = s->w.angular_acceleration;
    f[0] = a.z, f[1] = alpha.x, f[2] = alpha.y, f[7] = a.x, f[8] = a.y;
    for (int i = 0; i < CORNERS; ++i) f[3 + i] = s->w.travel_acceleration[i] / 100; /* stiff row: comparable size */
}

static void solve(double A[UNKNOWNS][UNKNOWNS + 1], double out[UNKNOWNS]) { /* Gauss with partial pivoting */
    for (int j = 0; j < UNKNOWNS; ++j) {
        int pivot = j;
        for (int i = j + 1; i < UNKNOWNS; ++i)
            if (fabs(A[i][j]) > fabs(A[pivot][j])) pivot = i;
        for (int k = j; k <= UNKNOWNS; ++k) {
            const double t = A[j][k];
            A[j][k] = A[pivot][k], A[pivot][k] = t;
        }
        for (int i = j + 1; i < UNKNOWNS; ++i) {
            const double factor = A[i][j] / A[j][j];
            for (int k = j; k <= UNKNOWNS; ++k) A[i][k] -= factor * A[j][k];
        }
    }
    for (int j = UNKNOWNS - 1; j >= 0; --j) {
        out[j] = A[j][UNKNOWNS];
        for (int k = j + 1; k < UNKNOWNS; ++k) out[j] -= A[j][k] * out[k];
        out[j] /= A[j][j];
    }
}

static double largest(const double f[UNKNOWNS]) {
    double most = 0;
    for (int j = 0; j < UNKNOWNS; ++j) most = isfinite(f[j]) ? fmax(most, fabs(f[j])) : INFINITY;
    return most;
}

/* First guess: the body parallel to the road under the four hubs. */
static void guess(Start *s, double y[UNKNOWNS]) {
    memset(y, 0, UNKNOWNS * sizeof *y);
    const Variables *p = &s->model->v;
    for (int pass = 0; pass < 3; ++pass) {
        set_pose(s, y);
        evaluate(s);
        const Four z = s->w.contact.height;
        const double wheelbase = p->Body_CogToFront + p->Body_CogToRear, track = s->c->track;
        const double front = (z[FL] + z[FR]) / 2, rear = (z[RL] + z[RR]) / 2;
        const double left = (z[FL] + z[RL]) / 2, right = (z[FR] + z[RR]) / 2;
        y[1] = atan((left - right) / track);
        y[2] = atan((rear - front) / wheelbase);
        y[0] = (front * p->Body_CogToRear + rear * p->Body_CogToFront) / wheelbase + p->Body_CogHeight;
    }
}

ModelStatus equilibrium(Model *m, const Vehicle *c, Memory *memory) {
    static const double limit[UNKNOWNS] = {0.1, 0.1, 0.1, 0.03, 0.03, 0.03, 0.03, 0.05, 0.05};
    Start s = {.model = m, .c = c, .memory = memory, .speed = m->v.Init_Velocity};
    State *x = &memory->x;
    x->valve = FOUR(m->v.Car_SuspControl_Damper_CtrlOut);
    x->brake_torque = brake_demand(&m->v, c);
    double y[UNKNOWNS], f[UNKNOWNS], nudged[UNKNOWNS], A[UNKNOWNS][UNKNOWNS + 1], step[UNKNOWNS];
    guess(&s, y);
    residual(&s, y, f);
    for (int n = 0; n < ITERATIONS && largest(f) > 1e-9; ++n) {
        for (int j = 0; j < UNKNOWNS; ++j) {
            const double nudge = 1e-6, keep = y[j];
            y[j] += nudge;
            residual(&s, y, nudged);
            y[j] = keep;
            for (int i = 0; i < UNKNOWNS; ++i) A[i][j] = (nudged[i] - f[i]) / nudge;
        }
        for (int i = 0; i < UNKNOWNS; ++i) A[i][UNKNOWNS] = -f[i];
        solve(A, step);
        for (int j = 0; j < UNKNOWNS; ++j) y[j] += clamp(step[j], -limit[j], limit[j]);
        residual(&s, y, f);
    }
    if (largest(f) > 1e-6) {
        model_log(m, MODEL_ERROR, "logEquilibrium",
                  "no static equilibrium at Init.x = %g m, Init.y = %g m, Init.Velocity = %g m/s (residual %g m/s2): start on an even "
                  "part of the road, below the tyres' grip",
                  m->v.Init_x, m->v.Init_y, m->v.Init_Velocity, largest(f));
        return MODEL_ERROR;
    }
    return MODEL_OK;
}
