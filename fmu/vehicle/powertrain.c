/* Four on-board motors with half-shafts, and brakes that can hold a wheel still. */
#include "vehicle.h"

/* 1 below Start, 0 above End: what the slip controller leaves of a torque. It acts on the tyre's own slip, where a
 * production controller has an estimate. */
static double slip_share(const Variables *p, double slip) {
    if (!p->SlipControl_Active) return 1.0;
    return 1 - clamp((slip - p->SlipControl_Start) / (p->SlipControl_End - p->SlipControl_Start), 0, 1);
}

double brake_demand(const Variables *p, const Vehicle *c, int i) {
    return p->DM_Brake * p->Brake_MaxTorque * c->brake_share[i];
}

void powertrain(const Variables *p, const Vehicle *c, const State *x, Work *w, State *dx) {
    for (int i = 0; i < CORNERS; ++i) {
        const Vec axle = w->corner[i].axle;
        const double shaft_speed = x->spin[i] - dot(x->rate, axle);            /* wheel against the body */
        const double brake_speed = x->spin[i] - dot(w->corner[i].rate, axle);  /* wheel against the knuckle */

        const double motor_speed = p->PT_GearRatio * fabs(x->motor_speed[i]);
        const double available = fmin(p->PT_MotorTorque, p->PT_MotorPower / fmax(motor_speed, 1.0));
        const double demand = p->DM_Gas * c->drive_share[i] * available * slip_share(p, w->tyre[i].slip_x);
        const double slack = x->motor_speed[i] - shaft_speed;
        const double shaft = p->PT_ShaftStiffness[i] * x->windup[i] + p->PT_ShaftDamping * slack;
        const double geared = p->PT_GearRatio * x->motor_torque[i];
        dx->motor_torque[i] = (demand - x->motor_torque[i]) / p->PT_TorqueLag;
        dx->motor_speed[i] = (geared - shaft) / (p->PT_RotorInertia * p->PT_GearRatio * p->PT_GearRatio);
        dx->windup[i] = slack;

        /* Coulomb friction with an elastic stick phase: a wheel that stands does not creep. Slip control lets go of
         * the brake only while the car rolls, else it would release the parked car. */
        const double slip = fabs(dot(w->corner[i].v, w->contact[i].forward)) > 2.0 ? -w->tyre[i].slip_x : 0.0;
        const double capacity = x->brake_torque[i];
        const double brake = clamp(p->Brake_Stiffness * x->brake_windup[i] + p->Brake_Damping * brake_speed, -capacity, capacity);
        dx->brake_torque[i] = (brake_demand(p, c, i) * slip_share(p, slip) - capacity) / p->Brake_Lag;
        dx->brake_windup[i] = brake_speed;

        dx->spin[i] = (shaft - brake + w->axial_moment[i]) / p->Wheel_Inertia;
        dx->angle[i] = brake_speed;
        w->axle_torque[i] = shaft;
        w->brake_reaction[i] = brake;
        w->moment[i] = axpy(brake, axle, w->moment[i]);
        /* Reactions: half-shaft on the body; motor housing against the rotor's angular acceleration. */
        w->body_moment = axpy(-shaft - (geared - shaft) / p->PT_GearRatio, axle, w->body_moment);
        dx->dissipated += brake * brake_speed + p->PT_ShaftDamping * slack * slack;
        dx->supplied += geared * x->motor_speed[i];
    }
}
