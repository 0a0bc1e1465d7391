/* Four on-board motors with half-shafts, and brakes that can hold a wheel still. */
#ifndef POWERTRAIN_H
#define POWERTRAIN_H

#include "vehicle.h"

/* 1 below Start, 0 above End: what the slip controller leaves of a torque. It acts on the tyre's own slip, where a
 * production controller has an estimate. */
INLINE Four slip_share(const Variables *p, Four slip) {
    if (!p->SlipControl_Active) return splat(1.0);
    return 1 - within((slip - p->SlipControl_Start) * (1 / (p->SlipControl_End - p->SlipControl_Start)), splat(0.0), splat(1.0));
}

INLINE Four brake_demand(const Variables *p, const Vehicle *c) { return p->DM_Brake * p->Brake_MaxTorque * c->brake_share; }

INLINE void powertrain(const Variables *p, const Vehicle *c, const State *x, Work *w, State *dx) {
    const Vec4 axle = w->corner.axle;
    const Four shaft_speed = x->spin - dot(spread(x->rate), axle);    /* wheel against the body */
    const Four brake_speed = x->spin - dot(w->corner.rate, axle);     /* wheel against the knuckle */

    const Four motor_speed = larger(p->PT_GearRatio * magnitude(x->motor_speed), splat(1.0));
    const Four available = smaller(splat(p->PT_MotorTorque), p->PT_MotorPower / motor_speed);
    const Four demand = p->DM_Gas * c->drive_share * available * slip_share(p, w->tyre.slip_x);
    /* Coulomb friction with an elastic stick phase: a wheel that stands does not creep. Slip control lets go of
     * the brake only while the car rolls, else it would release the parked car. */
    const Mask rolls = magnitude(dot(w->corner.v, w->contact.forward)) > 2.0;
    const Four slip = choose(rolls, -w->tyre.slip_x, splat(0.0)), capacity = x->brake_torque;
    const Four brake = within(p->Brake_Stiffness * x->brake_windup + p->Brake_Damping * brake_speed, -capacity, capacity);
    dx->brake_torque = (brake_demand(p, c) * slip_share(p, slip) - capacity) * (1 / p->Brake_Lag);
    dx->brake_windup = brake_speed;

    const double rotor = p->PT_RotorInertia * p->PT_GearRatio * p->PT_GearRatio;
    const Four geared = p->PT_GearRatio * x->motor_torque;
    Four slack = x->motor_speed - shaft_speed, shaft = FOUR(p->PT_ShaftStiffness) * x->windup + p->PT_ShaftDamping * slack;
    if (p->PT_RigidShafts) { /* wheel and rotor gain speed alike */
        shaft = (p->Wheel_Inertia * geared + rotor * (brake - w->axial_moment)) * (1 / (p->Wheel_Inertia + rotor));
        slack = splat(0.0);
    }
    dx->motor_torque = (demand - x->motor_torque) * (1 / p->PT_TorqueLag);
    dx->motor_speed = (geared - shaft) * (1 / rotor);
    dx->windup = slack;

    dx->spin = (shaft - brake + w->axial_moment) * (1 / p->Wheel_Inertia);
    dx->angle = brake_speed;
    w->moment = axpy(brake, axle, w->moment);
    /* Reactions: half-shaft on the body; motor housing against the rotor's angular acceleration. */
    w->body_moment = add(w->body_moment, total(scale(-shaft - (geared - shaft) * (1 / p->PT_GearRatio), axle)));
    dx->dissipated += sum(brake * brake_speed + p->PT_ShaftDamping * slack * slack);
    dx->supplied = sum(geared * x->motor_speed);
}

#endif
