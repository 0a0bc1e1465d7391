/* Sprung body and four wheel carriers as one multibody system, exactly.
 *
 * Unknowns: the body's six accelerations and one travel acceleration per corner. Each corner couples to the body only,
 * so the mass matrix is an arrow: the four travel rows are eliminated (Schur complement) and a 6x6 system remains, which
 * is solved by 3x3 blocks, translation and rotation. Newton-Euler in body axes about the reference point, projected on
 * the travels by path and turn (Featherstone, Rigid Body Dynamics Algorithms, ch. 2 and 9).
 *
 * A wheel's rotation about its axle is not in here: its momentum J*s with the absolute speed s decouples, which leaves
 * the gyroscopic moment. Left out: the inertia reaction of the steering acceleration. */
#ifndef MULTIBODY_H
#define MULTIBODY_H

#include "vehicle.h"

/* Carrier inertia, axisymmetric about the axle (the wheel's own inertia about it is kept apart). */
INLINE Vec4 carrier_inertia(const Variables *p, Vec4 axle, Vec4 a) {
    const double across = p->Wheel_CarrierInertiaX;
    return axpy((p->Wheel_CarrierInertiaY - across) * dot(axle, a), axle, scale(splat(across), a));
}

typedef struct { /* the four travels' rows of the arrow */
    Vec4 linear, angular; /* coupling to the body's accelerations */
    Four inertia, force;
} Rows;

INLINE Rows travel_rows(const Variables *p, const Vehicle *c, const State *x, Work *w) {
    const Corners *k = &w->corner;
    const Four mass = splat(c->carrier_mass), qd = x->travel_rate;
    const Vec4 omega = spread(x->rate), turn_inertia = carrier_inertia(p, k->axle, k->turn);
    /* Accelerations that are there with all unknowns zero. */
    Vec4 swing = cross(omega, axpy(2 * qd, k->path, cross(omega, k->r)));
    swing.x += qd * qd * k->path2_x;
    const Vec4 relative = axpy(qd, k->turn, scale(k->steer_rate, k->kingpin));
    const Vec4 spin_up = add(add(cross(omega, relative), scale(qd * qd, k->turn2)),
                             scale(qd * k->steer_rate, cross(k->turn, k->kingpin)));
    const Vec4 momentum = axpy(p->Wheel_Inertia * x->spin, k->axle, carrier_inertia(p, k->axle, k->rate));
    const Vec4 force = axpy(mass, sub(spread(w->gravity), swing), w->force);
    const Vec4 moment = sub(sub(w->moment, carrier_inertia(p, k->axle, spin_up)), cross(k->rate, momentum));
    w->body_force = add(w->body_force, total(force));
    w->body_moment = add(w->body_moment, total(add(cross(k->r, force), moment)));

    const Vec4 linear = scale(mass, k->path);
    return (Rows){linear, add(cross(k->r, linear), turn_inertia), dot(linear, k->path) + dot(k->turn, turn_inertia),
                  dot(k->path, force) + dot(k->turn, moment) + w->spring_force + w->damper_force};
}

typedef struct { double xx, yy, zz, xy, xz, yz; } Symmetric;
typedef struct { Vec x, y, z; } Rows3; /* of a 3x3 matrix */

INLINE Vec times(const Symmetric *a, Vec b) {
    return vec(a->xx * b.x + a->xy * b.y + a->xz * b.z, a->xy * b.x + a->yy * b.y + a->yz * b.z,
               a->xz * b.x + a->yz * b.y + a->zz * b.z);
}

INLINE Symmetric inverse(const Symmetric *a) {
    const double xx = a->yy * a->zz - a->yz * a->yz, xy = a->xz * a->yz - a->xy * a->zz, xz = a->xy * a->yz - a->xz * a->yy;
    const double one_over = 1 / (a->xx * xx + a->xy * xy + a->xz * xz);
    return (Symmetric){xx * one_over, (a->xx * a->zz - a->xz * a->xz) * one_over, (a->xx * a->yy - a->xy * a->xy) * one_over,
                       xy * one_over, xz * one_over, (a->xy * a->xz - a->xx * a->yz) * one_over};
}

/* What elimination of the travels leaves of a block: the sum over the corners of a b' / inertia. */
INLINE Symmetric eliminated(Vec4 a, Vec4 a_share) {
    const Vec diagonal = total(vec4(a.x * a_share.x, a.y * a_share.y, a.z * a_share.z));
    const Vec beside = total(vec4(a.x * a_share.y, a.x * a_share.z, a.y * a_share.z));
    return (Symmetric){diagonal.x, diagonal.y, diagonal.z, beside.x, beside.y, beside.z};
}

INLINE void multibody_accelerations(const Variables *p, const Vehicle *c, const State *x, Work *w) {
    const Vec omega = x->rate, I = c->body_inertia;
    w->body_force = axpy(c->body_mass, w->gravity, w->body_force);
    w->body_moment = sub(w->body_moment, cross(omega, vec(I.x * omega.x, I.y * omega.y, I.z * omega.z)));

    const Rows row = travel_rows(p, c, x, w);
    const Four share = 1 / row.inertia;
    const Vec4 r = w->corner.r, axle = w->corner.axle, linear_share = scale(share, row.linear), angular_share = scale(share, row.angular);
    const double m = c->carrier_mass, across = p->Wheel_CarrierInertiaX, extra = p->Wheel_CarrierInertiaY - across;
    const double whole = c->body_mass + CORNERS * m;
    const Vec first = scale(m, total(r)); /* first moment of the carriers */

    /* [A B'; B C] [acceleration; angular acceleration] = [f; n] */
    Symmetric A = eliminated(row.linear, linear_share), C = eliminated(row.angular, angular_share);
    A = (Symmetric){whole - A.xx, whole - A.yy, whole - A.zz, -A.xy, -A.xz, -A.yz};
    const Four xx = r.x * r.x, yy = r.y * r.y, zz = r.z * r.z;
    const Vec around = total(vec4(m * (yy + zz) + extra * axle.x * axle.x, m * (xx + zz) + extra * axle.y * axle.y,
                                  m * (xx + yy) + extra * axle.z * axle.z));
    const Vec product = total(vec4(extra * axle.x * axle.y - m * r.x * r.y, extra * axle.x * axle.z - m * r.x * r.z,
                                   extra * axle.y * axle.z - m * r.y * r.z));
    C = (Symmetric){I.x + CORNERS * across + around.x - C.xx, I.y + CORNERS * across + around.y - C.yy,
                    I.z + CORNERS * across + around.z - C.zz, product.x - C.xy, product.y - C.xz, product.z - C.yz};
    const Vec coupled_x = total(scale(row.angular.x, linear_share)), coupled_y = total(scale(row.angular.y, linear_share));
    const Vec coupled_z = total(scale(row.angular.z, linear_share));
    const Rows3 B = {{-coupled_x.x, -first.z - coupled_x.y, first.y - coupled_x.z},
                     {first.z - coupled_y.x, -coupled_y.y, -first.x - coupled_y.z},
                     {-first.y - coupled_z.x, first.x - coupled_z.y, -coupled_z.z}};
    const Vec f = sub(w->body_force, total(scale(row.force, linear_share)));
    const Vec n = sub(w->body_moment, total(scale(row.force, angular_share)));

    const Symmetric inverse_A = inverse(&A);
    const Rows3 G = {times(&inverse_A, B.x), times(&inverse_A, B.y), times(&inverse_A, B.z)}; /* B / A */
    const Symmetric S = {C.xx - dot(G.x, B.x), C.yy - dot(G.y, B.y), C.zz - dot(G.z, B.z),
                         C.xy - dot(G.x, B.y), C.xz - dot(G.x, B.z), C.yz - dot(G.y, B.z)};
    const Symmetric inverse_S = inverse(&S);
    const Vec alpha = times(&inverse_S, sub(n, vec(dot(G.x, f), dot(G.y, f), dot(G.z, f))));
    const Vec back = axpy(alpha.x, B.x, axpy(alpha.y, B.y, scale(alpha.z, B.z)));
    const Vec acceleration = times(&inverse_A, sub(f, back));

    w->acceleration = acceleration, w->angular_acceleration = alpha;
    w->travel_acceleration = share * (row.force - dot(row.linear, spread(acceleration)) - dot(row.angular, spread(alpha)));
}

INLINE double kinetic_energy(const Variables *p, const Vehicle *c, const State *x, const Work *w) {
    const Vec I = c->body_inertia, o = x->rate;
    const Corners *k = &w->corner;
    const double rotor = p->PT_RotorInertia * p->PT_GearRatio * p->PT_GearRatio;
    const double body = c->body_mass * dot(x->velocity, x->velocity) + I.x * o.x * o.x + I.y * o.y * o.y + I.z * o.z * o.z;
    const Four corners = c->carrier_mass * dot(k->v, k->v) + dot(k->rate, carrier_inertia(p, k->axle, k->rate)) +
                         p->Wheel_Inertia * x->spin * x->spin + rotor * x->motor_speed * x->motor_speed;
    return (body + sum(corners)) / 2;
}

#endif
