/* Sprung body and four wheel carriers as one multibody system, exactly.
 *
 * Unknowns: the body's six accelerations and one travel acceleration per corner. Each corner couples to the body only,
 * so the mass matrix is an arrow: the four travel rows are eliminated (Schur complement) and a 6x6 Cholesky solve
 * remains. Newton-Euler in body axes about the reference point, projected on the travels by path and turn
 * (Featherstone, Rigid Body Dynamics Algorithms, ch. 2 and 9).
 *
 * A wheel's rotation about its axle is not in here: its momentum J*s with the absolute speed s decouples, which leaves
 * the gyroscopic moment. Left out: the inertia reaction of the steering acceleration. */
#include <string.h>
#include "vehicle.h"

/* Carrier inertia, axisymmetric about the axle (the wheel's own inertia about it is kept apart). */
static Vec carrier_inertia(const Variables *p, Vec axle, Vec a) {
    const double across = p->Wheel_CarrierInertiaX;
    return axpy((p->Wheel_CarrierInertiaY - across) * dot(axle, a), axle, scale(across, a));
}

static void add_carrier(double M[6][6], const Variables *p, double mass, Vec r, Vec axle) {
    const double across = p->Wheel_CarrierInertiaX, extra = p->Wheel_CarrierInertiaY - across;
    const double rr = dot(r, r), R[3] = {r.x, r.y, r.z}, A[3] = {axle.x, axle.y, axle.z};
    for (int a = 0; a < 3; ++a) {
        M[a][a] += mass;
        M[3 + a][3 + a] += mass * rr + across;
        for (int b = 0; b <= a; ++b) M[3 + a][3 + b] += extra * A[a] * A[b] - mass * R[a] * R[b];
    }
    M[3][1] -= mass * r.z, M[3][2] += mass * r.y; /* lower left block: mass [r]x */
    M[4][0] += mass * r.z, M[4][2] -= mass * r.x;
    M[5][0] -= mass * r.y, M[5][1] += mass * r.x;
}

/* Solve M a = f in place (lower triangle of M given, positive definite). */
static void cholesky_solve(double M[6][6], double f[6]) {
    for (int j = 0; j < 6; ++j) {
        for (int i = j; i < 6; ++i) {
            double sum = M[i][j];
            for (int k = 0; k < j; ++k) sum -= M[i][k] * M[j][k];
            M[i][j] = i == j ? sqrt(sum) : sum / M[j][j];
        }
    }
    for (int i = 0; i < 6; ++i) {
        for (int k = 0; k < i; ++k) f[i] -= M[i][k] * f[k];
        f[i] /= M[i][i];
    }
    for (int i = 5; i >= 0; --i) {
        for (int k = i + 1; k < 6; ++k) f[i] -= M[k][i] * f[k];
        f[i] /= M[i][i];
    }
}

typedef struct { double coupling[6], inertia, force; } Row; /* a travel's row of the arrow */

static Row travel_row(const Variables *p, const Vehicle *c, const State *x, Work *w, int i) {
    const Corner *k = &w->corner[i];
    const double mass = c->carrier_mass, qd = x->travel_rate[i];
    const Vec omega = x->rate, turn_inertia = carrier_inertia(p, k->axle, k->turn);
    /* Accelerations that are there with all unknowns zero. */
    const Vec swing = add(cross(omega, axpy(2 * qd, k->path, cross(omega, k->r))), scale(qd * qd, k->path2));
    const Vec relative = axpy(qd, k->turn, scale(k->steer_rate, k->kingpin));
    const Vec spin_up = add(add(cross(omega, relative), scale(qd * qd, k->turn2)),
                            scale(qd * k->steer_rate, cross(k->turn, k->kingpin)));
    const Vec momentum = axpy(p->Wheel_Inertia * x->spin[i], k->axle, carrier_inertia(p, k->axle, k->rate));
    const Vec force = sub(axpy(mass, w->gravity, w->force[i]), scale(mass, swing));
    const Vec moment = sub(sub(w->moment[i], carrier_inertia(p, k->axle, spin_up)), cross(k->rate, momentum));
    w->body_force = add(w->body_force, force);
    w->body_moment = add(w->body_moment, add(cross(k->r, force), moment));

    const Vec mp = scale(mass, k->path), angular = add(cross(k->r, mp), turn_inertia);
    return (Row){{mp.x, mp.y, mp.z, angular.x, angular.y, angular.z},
                 dot(mp, k->path) + dot(k->turn, turn_inertia),
                 dot(k->path, force) + dot(k->turn, moment) + w->spring_force[i] + w->damper_force[i]};
}

void multibody_accelerations(const Variables *p, const Vehicle *c, const State *x, Work *w) {
    double M[6][6];
    memset(M, 0, sizeof M);
    for (int a = 0; a < 3; ++a) M[a][a] = c->body_mass;
    M[3][3] = c->body_inertia.x, M[4][4] = c->body_inertia.y, M[5][5] = c->body_inertia.z;
    const Vec omega = x->rate, I = c->body_inertia;
    const Vec L = vec(I.x * omega.x, I.y * omega.y, I.z * omega.z);
    w->body_force = axpy(c->body_mass, w->gravity, w->body_force);
    w->body_moment = sub(w->body_moment, cross(omega, L));

    Row row[CORNERS];
    for (int i = 0; i < CORNERS; ++i) {
        row[i] = travel_row(p, c, x, w, i);
        add_carrier(M, p, c->carrier_mass, w->corner[i].r, w->corner[i].axle);
    }
    double f[6] = {w->body_force.x, w->body_force.y, w->body_force.z, w->body_moment.x, w->body_moment.y, w->body_moment.z};
    for (int i = 0; i < CORNERS; ++i) {
        for (int a = 0; a < 6; ++a) {
            const double share = row[i].coupling[a] / row[i].inertia;
            f[a] -= share * row[i].force;
            for (int b = 0; b <= a; ++b) M[a][b] -= share * row[i].coupling[b];
        }
    }
    cholesky_solve(M, f);
    for (int i = 0; i < CORNERS; ++i) {
        double force = row[i].force;
        for (int a = 0; a < 6; ++a) force -= row[i].coupling[a] * f[a];
        w->travel_acceleration[i] = force / row[i].inertia;
    }
    w->acceleration = vec(f[0], f[1], f[2]);
    w->angular_acceleration = vec(f[3], f[4], f[5]);
}

double kinetic_energy(const Variables *p, const Vehicle *c, const State *x, const Work *w) {
    const Vec I = c->body_inertia, o = x->rate;
    const double rotor = p->PT_RotorInertia * p->PT_GearRatio * p->PT_GearRatio;
    double twice = c->body_mass * dot(x->velocity, x->velocity) + I.x * o.x * o.x + I.y * o.y * o.y + I.z * o.z * o.z;
    for (int i = 0; i < CORNERS; ++i) {
        const Corner *k = &w->corner[i];
        twice += c->carrier_mass * dot(k->v, k->v) + dot(k->rate, carrier_inertia(p, k->axle, k->rate));
        twice += p->Wheel_Inertia * x->spin[i] * x->spin[i] + rotor * x->motor_speed[i] * x->motor_speed[i];
    }
    return twice / 2;
}
