/* Kinematics and forces of the four suspensions.
 *
 * Kinematics: smooth curves of wheel travel q. The carrier's orientation is Rz(toe) Rx(camber) Ry(knuckle pitch) and
 * then the steer rotation about the kingpin, which passes through the wheel centre. Everything the multibody equations
 * need (path, turn and their derivatives by q) follows from these curves, so anti-dive, anti-squat and the roll
 * centres come out of the geometry; no force is added for them. */
#include "vehicle.h"

/* Sine and cosine of the mostly small kinematic angles: Taylor series to 1e-13 up to 0.2 rad, the library beyond. */
static void small_angle(double a, double *sine, double *cosine) {
    if (fabs(a) > 0.2) {
        *sine = sin(a), *cosine = cos(a);
        return;
    }
    const double s = a * a;
    *sine = a * (1 - s / 6 * (1 - s / 20 * (1 - s / 42)));
    *cosine = 1 - s / 2 * (1 - s / 12 * (1 - s / 30 * (1 - s / 56)));
}

typedef struct { double sz, cz, sx, cx, sy, cy; } Angles;

static Vec turn_by(const Angles *a, Vec v) { /* Rz Rx Ry v */
    v = vec(a->cy * v.x + a->sy * v.z, v.y, a->cy * v.z - a->sy * v.x);
    v = vec(v.x, a->cx * v.y - a->sx * v.z, a->sx * v.y + a->cx * v.z);
    return vec(a->cz * v.x - a->sz * v.y, a->sz * v.x + a->cz * v.y, v.z);
}

void corner_kinematics(const Variables *p, const Vehicle *c, const State *x, int i, Corner *k) {
    const double q = x->travel[i], side = c->side[i];
    const double toe1 = side * p->Kin_BumpSteer[i];
    const double camber1 = side * (p->Kin_Camber[i] + 2 * p->Kin_CamberCurve[i] * q);
    const double camber2 = side * 2 * p->Kin_CamberCurve[i];
    const double pitch1 = p->Kin_KnucklePitch[i];
    const double toe = toe1 * q - side * p->Kin_Toe[i];
    const double camber = side * (p->Kin_StaticCamber[i] + (p->Kin_Camber[i] + p->Kin_CamberCurve[i] * q) * q);

    Angles a;
    small_angle(toe, &a.sz, &a.cz);
    small_angle(camber, &a.sx, &a.cx);
    small_angle(pitch1 * q, &a.sy, &a.cy);
    const Vec ez = vec(0, 0, 1), ex = vec(a.cz, a.sz, 0), ey = vec(-a.sz * a.cx, a.cz * a.cx, a.sx);

    const double recession = p->Kin_Recession[i], curve = p->Kin_RecessionCurve[i];
    k->r = add(c->hub[i], vec(-(recession + curve * q) * q, side * c->lateral_slope[i] * q, q));
    k->path = vec(-(recession + 2 * curve * q), side * c->lateral_slope[i], 1);
    k->path2 = vec(-2 * curve, 0, 0);
    const Vec turn_zx = axpy(camber1, ex, scale(toe1, ez));
    k->turn = axpy(pitch1, ey, turn_zx);
    k->turn2 = add(add(scale(camber2, ex), scale(camber1 * toe1, cross(ez, ex))), scale(pitch1, cross(turn_zx, ey)));

    double gradient;
    const double caster = p->Kin_Caster[i], steer = ackermann(p, c, x->rack, i, &gradient) + x->compliance[i];
    double sc, cc, ss, cs;
    small_angle(caster, &sc, &cc);
    small_angle(steer, &ss, &cs);
    k->steer = steer;
    k->kingpin = turn_by(&a, vec(-sc, 0, cc));
    k->axle = turn_by(&a, vec(-cc * ss, cs, -sc * ss)); /* e_y turned about the kingpin */

    k->rate = axpy(x->travel_rate[i], k->turn, x->rate); /* the steer rate joins once it is known */
    k->v = axpy(x->travel_rate[i], k->path, add(x->velocity, cross(x->rate, k->r)));
}

/* A stop of linear and cubic stiffness over its penetration d (zero before contact). */
static double stop_force(double linear, double cubic, double d) { return d > 0 ? d * (linear + cubic * d * d) : 0.0; }

static double stop_energy(double linear, double cubic, double d) {
    return d > 0 ? d * d * (linear / 2 + cubic * d * d / 4) : 0.0;
}

/* Anti-roll bar force on the left wheel of an axle, positive in compression: bar moment over track. */
static double bar_force(double stiffness, double track, double left, double right) {
    return -stiffness * (left - right) / (track * track);
}

static double damper_force(const Variables *p, const Vehicle *c, double valve, double velocity) {
    if (p->Damp_Passive) return curve_value(&c->passive, velocity);
    const double soft = curve_value(&c->soft, velocity);
    return soft + valve * (curve_value(&c->hard, velocity) - soft);
}

void suspension_forces(const Variables *p, const Vehicle *c, const State *x, Work *w) {
    const double *q = x->travel;
    const double front = bar_force(p->Susp_AntiRollFront, c->track, q[FL], q[FR]);
    const double rear = bar_force(p->Susp_AntiRollRear, c->track, q[RL], q[RR]);
    const double bar[CORNERS] = {front, -front, rear, -rear};
    for (int i = 0; i < CORNERS; ++i) {
        const double bump = stop_force(p->Susp_BumpRate, p->Susp_BumpCubic, q[i] - p->Susp_BumpGap[i]);
        const double rebound = stop_force(p->Susp_ReboundRate, p->Susp_ReboundCubic, -q[i] - p->Susp_ReboundGap[i]);
        w->spring_force[i] = bar[i] + rebound - bump - c->preload[i] - p->Susp_WheelRate[i] * q[i];
        w->damper_force[i] = p->Damp_Scale[i] * damper_force(p, c, x->valve[i], -x->travel_rate[i]);
    }
}

double suspension_energy(const Variables *p, const Vehicle *c, const State *x) {
    const double *q = x->travel;
    const double front = (q[FL] - q[FR]) / c->track, rear = (q[RL] - q[RR]) / c->track;
    double energy = (p->Susp_AntiRollFront * front * front + p->Susp_AntiRollRear * rear * rear) / 2;
    for (int i = 0; i < CORNERS; ++i) {
        energy += q[i] * (c->preload[i] + p->Susp_WheelRate[i] * q[i] / 2);
        energy += stop_energy(p->Susp_BumpRate, p->Susp_BumpCubic, q[i] - p->Susp_BumpGap[i]);
        energy += stop_energy(p->Susp_ReboundRate, p->Susp_ReboundCubic, -q[i] - p->Susp_ReboundGap[i]);
    }
    return energy;
}
