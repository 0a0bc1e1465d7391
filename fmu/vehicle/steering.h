/* Massless rack with compliance, Ackermann geometry, and the bushings' lateral-force steer. */
#ifndef STEERING_H
#define STEERING_H

#include "vehicle.h"

static const double LARGEST_RACK = 0.6; /* mean road-wheel angle at the stops, rad */

/* Road-wheel angles over the mean angle `rack`. The inner wheel gains a share of full Ackermann, delta^2 track /
 * wheelbase between the two (second order in delta); the rear wheels are not steered. */
INLINE Four ackermann(const Vehicle *c, double rack) { return rack * (c->steered + c->ackermann_gain * rack); }
INLINE Four ackermann_gradient(const Vehicle *c, double rack) { return c->steered + 2 * c->ackermann_gain * rack; }

/* Rack: damping * d(rack)/dt = stiffness * (hand wheel / ratio - rack) + kingpin moments. The rotational inertia of the
 * knuckles about the kingpin is left out against that damping (about 1.5 kg m2 each). */
INLINE void steering_rates(const Variables *p, const Vehicle *c, const State *x, double hand_wheel, Work *w) {
    Corners *k = &w->corner;
    const Four gradient = ackermann_gradient(c, x->rack);
    const double moment = sum(gradient * dot(k->kingpin, w->moment));
    const double demand = clamp(hand_wheel / p->Steer_Ratio, -LARGEST_RACK, LARGEST_RACK);
    w->compliance_rate = (FOUR(p->Kin_LateralForceSteer) * w->tyre.Fy - x->compliance) * (1 / p->Kin_ComplianceLag);
    w->rack_rate = (p->Steer_Stiffness * (demand - x->rack) + moment) / p->Steer_Damping;
    k->steer_rate = gradient * w->rack_rate + w->compliance_rate;
    k->rate = axpy(k->steer_rate, k->kingpin, k->rate);
}

#endif
