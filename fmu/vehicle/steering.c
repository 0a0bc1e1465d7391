/* Massless rack with compliance, Ackermann geometry, and the bushings' lateral-force steer. */
#include "vehicle.h"

static const double LARGEST_RACK = 0.6; /* mean road-wheel angle at the stops, rad */

/* Road-wheel angle of corner i over the mean angle `rack`. The inner wheel gains a share of
 * full Ackermann, delta^2 track / wheelbase between the two (second order in delta). */
double ackermann(const Variables *p, const Vehicle *c, double rack, int i, double *gradient) {
    *gradient = 0.0;
    if (i == RL || i == RR) return 0.0;
    const double wheelbase = p->Body_CogToFront + p->Body_CogToRear;
    const double gain = c->side[i] * p->Steer_Ackermann * c->track / (2 * wheelbase);
    *gradient = 1 + 2 * gain * rack;
    return rack * (1 + gain * rack);
}

/* Rack: damping * d(rack)/dt = stiffness * (hand wheel / ratio - rack) + kingpin moments. The rotational inertia of the
 * knuckles about the kingpin is left out against that damping (about 1.5 kg m2 each). */
void steering_rates(const Variables *p, const Vehicle *c, const State *x, double hand_wheel, Work *w) {
    double gradient[CORNERS], moment = 0.0;
    for (int i = 0; i < CORNERS; ++i) {
        ackermann(p, c, x->rack, i, &gradient[i]);
        moment += gradient[i] * dot(w->corner[i].kingpin, w->moment[i]);
        w->compliance_rate[i] =
            (p->Kin_LateralForceSteer[i] * w->tyre[i].Fy - x->compliance[i]) / p->Kin_ComplianceLag;
    }
    const double demand = clamp(hand_wheel / p->Steer_Ratio, -LARGEST_RACK, LARGEST_RACK);
    w->rack_rate = (p->Steer_Stiffness * (demand - x->rack) + moment) / p->Steer_Damping;
    for (int i = 0; i < CORNERS; ++i) {
        Corner *k = &w->corner[i];
        k->steer_rate = gradient[i] * w->rack_rate + w->compliance_rate[i];
        k->rate = axpy(k->steer_rate, k->kingpin, k->rate);
    }
}
