/* Magic Formula tyre (PAC2002, the coefficients' names and equations as in Pacejka, Tire and Vehicle Dynamics, 3rd ed.,
 * section 4.3) on first-order carcass deflections, with a vertical spring and a load-dependent rolling radius.
 *
 * Signs: ISO 8855 contact axes. kappa > 0 drives, alpha > 0 slides to the left and so pushes to the right. The
 * side-dependent terms are written for the left wheel and mirrored on the right. */
#include "vehicle.h"

static const double MAX_SLIP_X = 1.5, MAX_SLIP_Y = 1.7; /* carcass deflection limits, in slips: far beyond the peak */

/* sin(C atan(B s - E (B s - atan B s))), and the cosine form; E > 1 would let the curve turn back (E <= 1 is a condition of the formula). */
static double shape(double B, double E, double s) {
    const double Bs = B * s, e = E > 1 ? 1 : E;
    return atan(Bs - e * (Bs - atan(Bs)));
}

static double sine_of_twice_atan(double z) { return 2 * z / (1 + z * z); }

double tyre_relaxation_y(const Variables *p, double Fz, double radius) { /* PAC2002, sigma_alpha */
    const double length = p->Tire_PTY1 * sine_of_twice_atan(Fz / (p->Tire_PTY2 * p->Tire_NominalLoad)) * radius;
    return length > 0.05 ? length : 0.05;
}

/* Effective rolling radius, as MF-Tyre has it: falls with load, much less than the loaded radius does. */
double tyre_rolling_radius(const Variables *p, double Fz, double radius) {
    const double load = p->Tire_LoadDependentRadius ? Fz / p->Tire_NominalLoad : 1.0;
    return radius - p->Tire_NominalLoad / p->Tire_Stiffness * (p->Tire_FREFF * load + p->Tire_DREFF * atan(p->Tire_BREFF * load));
}

typedef struct { double Fx, Fy, Mz, peak_x, peak_y; } Forces;

static Forces magic_formula(const Variables *p, double Fz, double kappa, double tan_alpha, double gamma, double side) {
    const double Fz0 = p->Tire_NominalLoad, d = (Fz - Fz0) / Fz0, gamma2 = gamma * gamma;
    const double alpha = side * atan(tan_alpha);
    Forces f;
    gamma *= side;

    f.peak_x = (p->Tire_PDX1 + p->Tire_PDX2 * d) * p->Tire_FrictionX * p->Road_Friction * Fz;
    const double Kx = Fz * (p->Tire_PKX1 + p->Tire_PKX2 * d) * exp(p->Tire_PKX3 * d);
    const double Ex = p->Tire_PEX1 + (p->Tire_PEX2 + p->Tire_PEX3 * d) * d;
    const double Fx0 = f.peak_x * sin(p->Tire_PCX1 * shape(Kx / (p->Tire_PCX1 * f.peak_x), Ex, kappa));

    f.peak_y = (p->Tire_PDY1 + p->Tire_PDY2 * d) * (1 - p->Tire_PDY3 * gamma2) * p->Tire_FrictionY * p->Road_Friction * Fz;
    const double Ky = p->Tire_PKY1 * Fz0 * sine_of_twice_atan(Fz / (p->Tire_PKY2 * Fz0)) * (1 - p->Tire_PKY3 * fabs(gamma));
    const double sign = alpha < 0 ? -1 : 1;
    const double Ey = (p->Tire_PEY1 + p->Tire_PEY2 * d) * (1 - (p->Tire_PEY3 + p->Tire_PEY4 * gamma) * sign);
    const double Fy0 = f.peak_y * sin(p->Tire_PCY1 * shape(Ky / (p->Tire_PCY1 * f.peak_y), Ey, alpha));

    const double kappa2 = p->Tire_RBX2 * kappa, alpha2 = p->Tire_RBY2 * (alpha - p->Tire_RBY3);
    const double Bx = p->Tire_RBX1 / sqrt(1 + kappa2 * kappa2); /* cos(atan(z)) = 1 / sqrt(1 + z^2) */
    const double By = p->Tire_RBY1 / sqrt(1 + alpha2 * alpha2);
    f.Fx = Fx0 * cos(p->Tire_RCX1 * shape(Bx, p->Tire_REX1, alpha + p->Tire_RHX1)) /
           cos(p->Tire_RCX1 * shape(Bx, p->Tire_REX1, p->Tire_RHX1));
    const double Fy = Fy0 * cos(p->Tire_RCY1 * shape(By, p->Tire_REY1, kappa)); /* RHY1 = 0: no denominator */

    const double ratio = Kx * kappa / Ky;
    const double equivalent = sign * atan(sqrt(tan_alpha * tan_alpha + ratio * ratio)); /* combined slip */
    const double Bt = p->Tire_QBZ1 / (p->Tire_FrictionY * p->Road_Friction); /* eq. 4.E40: less friction, same shape at less slip */
    const double trail = Fz * p->Tire_QDZ1 * p->Tire_Radius / Fz0 * cos(p->Tire_QCZ1 * shape(Bt, p->Tire_QEZ1, equivalent)) /
                         sqrt(1 + tan_alpha * tan_alpha);
    f.Fy = side * Fy;
    f.Mz = -trail * f.Fy;
    return f;
}

/* Carcass: d(stretch)/dt = -V_s - |V_x| / sigma * stretch, slip = stretch / sigma (Pacejka eq. 7.7-7.9). */
static double stretch_rate(double slip, double limit, double V_slip, double V_x) {
    const double rate = -V_slip - fabs(V_x) * slip;
    return (slip >= limit && rate > 0) || (slip <= -limit && rate < 0) ? 0.0 : rate;
}

/* Carcass damping may not take the pair of forces out of the friction ellipse where the formula's own do not go. */
static void stay_in_ellipse(Tyre *y, const Forces *f) {
    const double used_x = y->Fx / f->peak_x, used_y = y->Fy / f->peak_y, own_x = f->Fx / f->peak_x, own_y = f->Fy / f->peak_y;
    const double usage = sqrt(used_x * used_x + used_y * used_y);
    const double most = fmax(1, sqrt(own_x * own_x + own_y * own_y));
    if (usage > most) y->Fx *= most / usage, y->Fy *= most / usage;
}

void tyre_forces(const Variables *p, const Vehicle *c, const State *x, Work *w, int i) {
    const Contact *t = &w->contact[i];
    const Corner *k = &w->corner[i];
    Tyre *y = &w->tyre[i];
    const double spring = p->Tire_Stiffness * t->deflection, damper = p->Tire_Damping * t->deflection_rate;
    *y = (Tyre){0};
    if (t->deflection <= 0 || spring + damper <= 1.0) { /* off the ground: no force, and the carcass recovers */
        y->rolling_radius = tyre_rolling_radius(p, 0.0, c->radius[i]);
        y->stretch_x_rate = -100 * x->stretch_x[i], y->stretch_y_rate = -100 * x->stretch_y[i];
        return;
    }
    y->Fz = spring + damper;
    y->rolling_radius = tyre_rolling_radius(p, y->Fz, c->radius[i]);
    const double sigma_y = tyre_relaxation_y(p, y->Fz, c->radius[i]);
    const double V_x = dot(k->v, t->forward), V_sx = V_x - y->rolling_radius * x->spin[i];
    const double V_sy = dot(add(k->v, cross(k->rate, t->arm)), t->left);
    y->slip_x = clamp(x->stretch_x[i] / p->Tire_RelaxationX, -MAX_SLIP_X, MAX_SLIP_X);
    y->slip_y = clamp(-x->stretch_y[i] / sigma_y, -MAX_SLIP_Y, MAX_SLIP_Y);
    y->stretch_x_rate = stretch_rate(y->slip_x, MAX_SLIP_X, V_sx, V_x);
    y->stretch_y_rate = stretch_rate(-y->slip_y, MAX_SLIP_Y, V_sy, V_x);

    const Forces f = magic_formula(p, y->Fz, y->slip_x, y->slip_y, t->sine_inclination, c->side[i]);
    const double fade = clamp(1 - fabs(V_x) / p->Tire_StandstillSpeed, 0, 1);
    const double extra = p->Tire_StandstillDamping * fade * fade * (3 - 2 * fade);
    y->Fx = clamp(f.Fx + (p->Tire_CarcassDampingX + extra) * y->stretch_x_rate, -f.peak_x, f.peak_x);
    y->Fy = clamp(f.Fy + (p->Tire_CarcassDampingY + extra) * y->stretch_y_rate, -f.peak_y, f.peak_y);
    stay_in_ellipse(y, &f);
    y->Mz = f.Mz;
    y->My = -p->Tire_QSY1 * c->radius[i] * y->Fz * clamp(x->spin[i] * y->rolling_radius / 0.1, -1, 1);
    /* Rotation about the normal; a cambered wheel's spin has a part in it. */
    const double turn = dot(k->rate, t->normal) + x->spin[i] * t->sine_inclination;
    y->dissipation = damper * t->deflection_rate - y->Fx * V_sx - y->Fy * V_sy - y->My * x->spin[i] - y->Mz * turn;
}
