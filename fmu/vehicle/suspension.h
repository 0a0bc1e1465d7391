/* Kinematics and forces of the four suspensions.
 *
 * Kinematics: smooth curves of wheel travel q. The carrier's orientation is Rz(toe) Rx(camber) Ry(knuckle pitch) and
 * then the steer rotation about the kingpin, which passes through the wheel centre. Everything the multibody equations
 * need (path, turn and their derivatives by q) follows from these curves, so anti-dive, anti-squat and the roll
 * centres come out of the geometry; no force is added for them. */
#ifndef SUSPENSION_H
#define SUSPENSION_H

#include "steering.h"
#include "vehicle.h"

typedef struct { Four sz, cz, sx, cx, sy, cy; } Angles;

INLINE Vec4 turn_by(const Angles *a, Vec4 v) { /* Rz Rx Ry v */
    v = vec4(a->cy * v.x + a->sy * v.z, v.y, a->cy * v.z - a->sy * v.x);
    v = vec4(v.x, a->cx * v.y - a->sx * v.z, a->sx * v.y + a->cx * v.z);
    return vec4(a->cz * v.x - a->sz * v.y, a->sz * v.x + a->cz * v.y, v.z);
}

INLINE void corner_kinematics(const Variables *p, const Vehicle *c, const State *x, Corners *k) {
    const Four q = x->travel, side = c->side;
    const Four toe1 = side * FOUR(p->Kin_BumpSteer), pitch1 = FOUR(p->Kin_KnucklePitch);
    const Four camber_slope = FOUR(p->Kin_Camber), camber_curve = FOUR(p->Kin_CamberCurve);
    const Four camber1 = side * (camber_slope + 2 * camber_curve * q), camber2 = side * 2 * camber_curve;
    const Four toe = toe1 * q - side * FOUR(p->Kin_Toe);
    const Four camber = side * (FOUR(p->Kin_StaticCamber) + (camber_slope + camber_curve * q) * q);
    Angles a;
    sine_and_cosine(toe, &a.sz, &a.cz);
    sine_and_cosine(camber, &a.sx, &a.cx);
    sine_and_cosine(pitch1 * q, &a.sy, &a.cy);
    const Four eyx = -a.sz * a.cx, eyy = a.cz * a.cx, eyz = a.sx; /* the axle unsteered; ex = (cz, sz, 0) */

    const Four recession = FOUR(p->Kin_Recession), curve = FOUR(p->Kin_RecessionCurve);
    k->r = add(c->hub, vec4(-(recession + curve * q) * q, c->lateral_slope * q, q));
    k->path = vec4(-(recession + 2 * curve * q), c->lateral_slope, splat(1.0));
    k->path2_x = -2 * curve;
    const Vec4 turn_zx = vec4(camber1 * a.cz, camber1 * a.sz, toe1);
    const Vec4 ey = vec4(eyx, eyy, eyz);
    const Vec4 sway = cross(turn_zx, ey);
    k->turn = axpy(pitch1, ey, turn_zx);
    k->turn2 = vec4(camber2 * a.cz - camber1 * toe1 * a.sz + pitch1 * sway.x,
                    camber2 * a.sz + camber1 * toe1 * a.cz + pitch1 * sway.y, pitch1 * sway.z);

    const Four steer = ackermann(c, x->rack) + x->compliance;
    Four ss, cs;
    sine_and_cosine(steer, &ss, &cs);
    k->steer = steer;
    k->kingpin = turn_by(&a, vec4(-c->sine_caster, splat(0.0), c->cosine_caster));
    k->axle = turn_by(&a, vec4(-c->cosine_caster * ss, cs, -c->sine_caster * ss)); /* e_y turned about the kingpin */

    const Vec4 rate = spread(x->rate);
    k->rate = axpy(x->travel_rate, k->turn, rate); /* the steer rate joins once it is known */
    k->v = axpy(x->travel_rate, k->path, add(spread(x->velocity), cross(rate, k->r)));
}

/* A stop of linear and cubic stiffness over its penetration d (zero before contact). */
INLINE Four stop_force(double linear, double cubic, Four d) {
    d = larger(d, splat(0.0));
    return d * (linear + cubic * d * d);
}

INLINE Four stop_energy(double linear, double cubic, Four d) {
    d = larger(d, splat(0.0));
    return d * d * (linear / 2 + cubic * d * d / 4);
}

/* Left wheel against right wheel of the same axle, with the sign of the own wheel first. */
INLINE Four across_the_axle(Four q) { return (Four){q[FL] - q[FR], q[FR] - q[FL], q[RL] - q[RR], q[RR] - q[RL]}; }

INLINE Four damper_curve_force(const Variables *p, const Vehicle *c, Four valve, Four velocity) {
    if (p->Damp_Passive) return curve_values(&c->passive, velocity);
    const Four soft = curve_values(&c->soft, velocity);
    return soft + valve * (curve_values(&c->hard, velocity) - soft);
}

INLINE void suspension_forces(const Variables *p, const Vehicle *c, const State *x, Work *w) {
    const Four q = x->travel;
    const Four bump = stop_force(p->Susp_BumpRate, p->Susp_BumpCubic, q - FOUR(p->Susp_BumpGap));
    const Four rebound = stop_force(p->Susp_ReboundRate, p->Susp_ReboundCubic, -q - FOUR(p->Susp_ReboundGap));
    const Four bar = -c->bar_rate * across_the_axle(q);
    w->spring_force = bar + rebound - bump - c->preload - FOUR(p->Susp_WheelRate) * q;
    w->damper_force = FOUR(p->Damp_Scale) * damper_curve_force(p, c, x->valve, -x->travel_rate);
}

INLINE double suspension_energy(const Variables *p, const Vehicle *c, const State *x) {
    const Four q = x->travel, wind = across_the_axle(q);
    const Four bump = stop_energy(p->Susp_BumpRate, p->Susp_BumpCubic, q - FOUR(p->Susp_BumpGap));
    const Four rebound = stop_energy(p->Susp_ReboundRate, p->Susp_ReboundCubic, -q - FOUR(p->Susp_ReboundGap));
    return sum(q * (c->preload + FOUR(p->Susp_WheelRate) * q / 2) + bump + rebound + c->bar_rate * wind * wind / 4);
}

#endif
