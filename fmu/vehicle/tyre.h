/* Magic Formula tyre (PAC2002, the coefficients' names and equations as in Pacejka, Tire and Vehicle Dynamics, 3rd ed.,
 * section 4.3) on first-order carcass deflections, with a vertical spring and a load-dependent rolling radius.
 *
 * Signs: ISO 8855 contact axes. kappa > 0 drives, alpha > 0 slides to the left and so pushes to the right. The
 * side-dependent terms are written for the left wheel and mirrored on the right. */
#ifndef TYRE_H
#define TYRE_H

#include "vehicle.h"

static const double MAX_SLIP_X = 1.5, MAX_SLIP_Y = 1.7; /* carcass deflection limits, in slips: far beyond the peak */

/* atan(B s - E (B s - atan B s)): the angle of the Magic Formula. E > 1 would let the curve turn back (E <= 1 is a
 * condition of the formula). */
INLINE Four shape(Four B, Four E, Four s) {
    const Four Bs = B * s;
    return arctangent(Bs - smaller(E, splat(1.0)) * (Bs - arctangent(Bs)));
}

INLINE Four sine_of_twice_atan(Four z) { return 2 * z / (1 + z * z); }

INLINE Four tyre_relaxation_y(const Variables *p, Four Fz, Four radius) { /* PAC2002, sigma_alpha */
    return larger(p->Tire_PTY1 * sine_of_twice_atan(Fz * (1 / (p->Tire_PTY2 * p->Tire_NominalLoad))) * radius, splat(0.05));
}

/* Effective rolling radius, as MF-Tyre has it: falls with load, much less than the loaded radius does. */
INLINE Four tyre_rolling_radius(const Variables *p, Four Fz, Four radius) {
    const Four load = p->Tire_LoadDependentRadius ? (Four)(Fz * (1 / p->Tire_NominalLoad)) : splat(1.0);
    return radius - p->Tire_NominalLoad / p->Tire_Stiffness * (p->Tire_FREFF * load + p->Tire_DREFF * arctangent(p->Tire_BREFF * load));
}

typedef struct { Four Fx, Fy, Mz, peak_x, peak_y; } Forces;

INLINE Forces magic_formula(const Variables *p, Four Fz, Four kappa, Four tan_alpha, Four gamma, Four side) {
    const double Fz0 = p->Tire_NominalLoad;
    const Four d = (Fz - Fz0) * (1 / Fz0), gamma2 = gamma * gamma, alpha = side * arctangent(tan_alpha);
    Forces f;
    gamma *= side;

    f.peak_x = (p->Tire_PDX1 + p->Tire_PDX2 * d) * p->Tire_FrictionX * p->Road_Friction * Fz;
    Four Kx = splat(Fz0 * p->Tire_PKX1);
    if (p->Tire_LoadDependentSlip) Kx = Fz * (p->Tire_PKX1 + p->Tire_PKX2 * d) * exponential(p->Tire_PKX3 * d);
    const Four Ex = p->Tire_PEX1 + (p->Tire_PEX2 + p->Tire_PEX3 * d) * d;
    const Four Fx0 = f.peak_x * sine(p->Tire_PCX1 * shape(Kx / (p->Tire_PCX1 * f.peak_x), Ex, kappa));

    f.peak_y = (p->Tire_PDY1 + p->Tire_PDY2 * d) * (1 - p->Tire_PDY3 * gamma2) * p->Tire_FrictionY * p->Road_Friction * Fz;
    const Four Ky = p->Tire_PKY1 * Fz0 * sine_of_twice_atan(Fz * (1 / (p->Tire_PKY2 * Fz0))) * (1 - p->Tire_PKY3 * magnitude(gamma));
    const Four sign = choose(alpha < 0.0, splat(-1.0), splat(1.0));
    const Four Ey = (p->Tire_PEY1 + p->Tire_PEY2 * d) * (1 - (p->Tire_PEY3 + p->Tire_PEY4 * gamma) * sign);
    const Four Fy0 = f.peak_y * sine(p->Tire_PCY1 * shape(Ky / (p->Tire_PCY1 * f.peak_y), Ey, alpha));

    const Four kappa2 = p->Tire_RBX2 * kappa, alpha2 = p->Tire_RBY2 * (alpha - p->Tire_RBY3);
    const Four Bx = p->Tire_RBX1 / root(1 + kappa2 * kappa2); /* cos(atan(z)) = 1 / sqrt(1 + z^2) */
    const Four By = p->Tire_RBY1 / root(1 + alpha2 * alpha2);
    const Four REX1 = splat(p->Tire_REX1);
    f.Fx = Fx0 * cosine(p->Tire_RCX1 * shape(Bx, REX1, alpha + p->Tire_RHX1)) /
           cosine(p->Tire_RCX1 * shape(Bx, REX1, splat(p->Tire_RHX1)));
    const Four Fy = Fy0 * cosine(p->Tire_RCY1 * shape(By, splat(p->Tire_REY1), kappa)); /* RHY1 = 0: no denominator */

    const Four ratio = Kx * kappa / Ky;
    const Four equivalent = sign * arctangent(root(tan_alpha * tan_alpha + ratio * ratio)); /* combined slip */
    const double Bt = p->Tire_QBZ1 / (p->Tire_FrictionY * p->Road_Friction); /* eq. 4.E40: less friction, same shape at less slip */
    const Four trail = Fz * (p->Tire_QDZ1 * p->Tire_Radius / Fz0) *
                       cosine(p->Tire_QCZ1 * shape(splat(Bt), splat(p->Tire_QEZ1), equivalent)) / root(1 + tan_alpha * tan_alpha);
    f.Fy = side * Fy;
    f.Mz = -trail * f.Fy;
    return f;
}

/* Carcass: d(stretch)/dt = -V_s - |V_x| / sigma * stretch, slip = stretch / sigma (Pacejka eq. 7.7-7.9). */
INLINE Four stretch_rate(Four slip, double limit, Four V_slip, Four V_x) {
    const Four rate = -V_slip - magnitude(V_x) * slip;
    const Mask at_limit = ((slip >= limit) & (rate > 0.0)) | ((slip <= -limit) & (rate < 0.0));
    return choose(at_limit, splat(0.0), rate);
}

/* Carcass damping may not take the pair of forces out of the friction ellipse where the formula's own do not go. */
INLINE void stay_in_ellipse(Tyre *y, const Forces *f) {
    const Four per_x = 1 / f->peak_x, per_y = 1 / f->peak_y;
    const Four used_x = y->Fx * per_x, used_y = y->Fy * per_y, own_x = f->Fx * per_x, own_y = f->Fy * per_y;
    const Four usage = root(used_x * used_x + used_y * used_y);
    const Four most = larger(root(own_x * own_x + own_y * own_y), splat(1.0));
    const Four kept = smaller(most / larger(usage, splat(1.0)), splat(1.0));
    y->Fx *= kept, y->Fy *= kept;
    y->grip_share = usage * kept;
}

INLINE Four on_ground(Mask touches, Four value) { return choose(touches, value, splat(0.0)); }

INLINE void tyre_forces(const Variables *p, const Vehicle *c, const State *x, Work *w) {
    const Contact *t = &w->contact;
    const Corners *k = &w->corner;
    Tyre *y = &w->tyre;
    const Four damper = p->Tire_Damping * t->deflection_rate, load = p->Tire_Stiffness * t->deflection + damper;
    const Mask touches = (t->deflection > 0.0) & (load > 1.0);
    const Four Fz = choose(touches, load, splat(1.0)); /* off the ground the formula runs on nothing, and is not used */
    y->rolling_radius = tyre_rolling_radius(p, on_ground(touches, Fz), c->radius);
    const Four V_x = dot(k->v, t->forward), V_sx = V_x - y->rolling_radius * x->spin;
    const Four V_sy = dot(add(k->v, cross(k->rate, t->arm)), t->left);
    const Four slip_x = within(x->stretch_x * (1 / p->Tire_RelaxationX), splat(-MAX_SLIP_X), splat(MAX_SLIP_X));
    const Four slip_y = within(-x->stretch_y / tyre_relaxation_y(p, Fz, c->radius), splat(-MAX_SLIP_Y), splat(MAX_SLIP_Y));
    const Four rate_x = stretch_rate(slip_x, MAX_SLIP_X, V_sx, V_x), rate_y = stretch_rate(-slip_y, MAX_SLIP_Y, V_sy, V_x);

    const Forces f = magic_formula(p, Fz, slip_x, slip_y, t->sine_inclination, c->side);
    const Four fade = within(1 - magnitude(V_x) * (1 / p->Tire_StandstillSpeed), splat(0.0), splat(1.0));
    const Four extra = p->Tire_StandstillDamping * fade * fade * (3 - 2 * fade);
    y->Fx = within(f.Fx + (p->Tire_CarcassDampingX + extra) * rate_x, -f.peak_x, f.peak_x);
    y->Fy = within(f.Fy + (p->Tire_CarcassDampingY + extra) * rate_y, -f.peak_y, f.peak_y);
    stay_in_ellipse(y, &f);

    y->Fz = on_ground(touches, Fz), y->Fx = on_ground(touches, y->Fx), y->Fy = on_ground(touches, y->Fy);
    y->grip_share = on_ground(touches, y->grip_share);
    y->Mz = on_ground(touches, f.Mz);
    y->My = -p->Tire_QSY1 * c->radius * y->Fz * within(x->spin * y->rolling_radius * 10, splat(-1.0), splat(1.0));
    y->slip_x = on_ground(touches, slip_x), y->slip_y = on_ground(touches, slip_y);
    y->stretch_x_rate = choose(touches, rate_x, -100 * x->stretch_x); /* off the ground the carcass recovers */
    y->stretch_y_rate = choose(touches, rate_y, -100 * x->stretch_y);
    /* Rotation about the normal; a cambered wheel's spin has a part in it. */
    const Four turn = dot(k->rate, t->normal) + x->spin * t->sine_inclination;
    y->dissipation = on_ground(touches, damper * t->deflection_rate - y->Fx * V_sx - y->Fy * V_sy - y->My * x->spin - y->Mz * turn);
}

#endif
