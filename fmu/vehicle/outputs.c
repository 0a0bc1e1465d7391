/* What the tool outside sees: CarMaker's names, from the work of the last evaluation. */
#include "multibody.h"
#include "suspension.h"
#include "vehicle.h"

static Vec point_acceleration(const Work *w, const State *x, Vec r) {
    return add(w->acceleration, add(cross(w->angular_acceleration, r), cross(x->rate, cross(x->rate, r))));
}

void imu_reading(const Vehicle *c, const State *x, const Work *w, double reading[6]) {
    const Vec force = to_body(c->imu_axes, sub(point_acceleration(w, x, c->imu), w->gravity));
    const Vec rate = to_body(c->imu_axes, x->rate);
    reading[0] = force.x, reading[1] = force.y, reading[2] = force.z - 9.81; /* the sensor's constant, not the site's g */
    reading[3] = rate.x, reading[4] = rate.y, reading[5] = rate.z;
}

static void body_outputs(Variables *v, const Vehicle *c, const State *x, const Work *w) {
    const Vec a = point_acceleration(w, x, c->cog), seat = point_acceleration(w, x, c->seat);
    const Vec velocity = add(x->velocity, cross(x->rate, c->cog));
    const Vec position = add(x->position, to_inertial(w->R, c->cog));
    v->Car_ax = a.x, v->Car_ay = a.y, v->Car_az = a.z;
    v->Car_Seat_ax = seat.x, v->Car_Seat_ay = seat.y, v->Car_Seat_az = seat.z;
    v->Car_RollVel = x->rate.x, v->Car_PitchVel = x->rate.y, v->Car_YawRate = x->rate.z;
    v->Car_vx = velocity.x, v->Car_vy = velocity.y, v->Car_vz = velocity.z;
    v->Car_tx = position.x, v->Car_ty = position.y, v->Car_tz = position.z;
    v->Car_Roll = atan2(w->R[7], w->R[8]);
    v->Car_Pitch = asin(clamp(-w->R[6], -1, 1));
    v->Car_Yaw = atan2(w->R[3], w->R[0]);
    v->Car_SideSlipAngle = atan2(velocity.y, fmax(fabs(velocity.x), 0.1));
}

static void store(double target[CORNERS], Four values) { *(Four *)target = values; }

static void corner_outputs(Variables *v, const State *x, const Work *w) {
    const Corners *k = &w->corner;
    const Tyre *t = &w->tyre;
    const Four inclination = w->contact.sine_inclination;
    const Four spin = x->spin - dot(k->rate, k->axle), ratio = FOUR(v->Damp_MotionRatio);
    store(v->Car_SteerAngle, k->steer);
    store(v->Car_WheelSpd, spin);
    store(v->Car_v, v->Wheel_KinematicRadius * spin);
    store(v->Car_C_q0, x->travel);
    store(v->Car_C_q0p, x->travel_rate);
    store(v->Car_Damp_v, -ratio * x->travel_rate);
    store(v->Car_Damp_l, -ratio * x->travel);
    store(v->Car_Damp_Frc, w->damper_force / ratio);
    store(v->Car_Damp_Ctrl, x->valve);
    store(v->Car_PaperRelVel, v->Car_vx * sin(v->Body_PaperTilt) - x->travel_rate);
    store(v->Car_Fx, t->Fx), store(v->Car_Fy, t->Fy), store(v->Car_Fz, t->Fz);
    store(v->Car_LongSlip, t->slip_x);
    store(v->Car_SlipAngle, arctangent(t->slip_y));
    store(v->Car_GripShare, t->grip_share);
    store(v->Car_Camber, arctangent(inclination / root(1 - inclination * inclination)));
    store(v->Car_zRoad, w->contact.height);
    store(v->PT_Motor_Trq, x->motor_torque);
    store(v->Brake_Trq, x->brake_torque);
}

/* Mean of the middle two wheel speeds: neither a locking nor a spinning wheel gets in. */
static double middle_speed(const double v[CORNERS]) {
    double low = v[0], high = v[0], sum = 0;
    for (int i = 0; i < CORNERS; ++i) low = fmin(low, v[i]), high = fmax(high, v[i]), sum += v[i];
    return (sum - low - high) / 2;
}

static void sensor_outputs(Variables *v, const Vehicle *c, Memory *m, const Work *w) {
    const State *x = &m->x;
    double reading[6];
    imu_reading(c, x, w, reading);
    const double *r = v->Sensor_Imu_Cutoff > 0 ? x->imu : reading;
    v->Sensor_Imu_ax = r[0], v->Sensor_Imu_ay = r[1], v->Sensor_Imu_az = r[2];
    v->Sensor_Imu_RollVel = r[3], v->Sensor_Imu_PitchVel = r[4], v->Sensor_Imu_YawRate = r[5];
    store(v->Sensor_WheelSpd, FOUR(v->Car_WheelSpd));
    if (encoder_is_on(v)) encoder_read(v, m, v->Sensor_WheelSpd);
    store(v->Sensor_v, v->Wheel_KinematicRadius * FOUR(v->Sensor_WheelSpd));
    v->Sensor_Esc_vx = middle_speed(v->Sensor_v);
}

static void energy_outputs(Variables *v, const Vehicle *c, const State *x, const Work *w) {
    const double g = v->Env_Gravity;
    double stored = kinetic_energy(v, c, x, w) + suspension_energy(v, c, x) + c->body_mass * g * x->position.z;
    const Vec4 hub = add(spread(x->position), to_inertial(w->R, w->corner.r));
    const Four deflection = larger(w->contact.deflection, splat(0.0));
    stored += sum(c->carrier_mass * g * hub.z + v->Tire_Stiffness * deflection * deflection / 2 +
                  FOUR(v->PT_ShaftStiffness) * x->windup * x->windup / 2); /* the brakes' counts as dissipated */
    v->Energy_Stored = stored;
    v->Energy_Dissipated = x->dissipated;
    v->Energy_Supplied = x->supplied;
}

void vehicle_outputs(Variables *v, const Vehicle *c, Memory *m, const Work *w) {
    const State *x = &m->x;
    body_outputs(v, c, x, w);
    corner_outputs(v, x, w);
    sensor_outputs(v, c, m, w);
    energy_outputs(v, c, x, w);
    v->Steer_WhlAng = m->steer;
    v->Car_Road_sRoad = v->Car_tx, v->Car_Road_tRoad = v->Car_ty;
    if (c->road) {
        RoadPosition at;
        road_locate(c->road, v->Car_tx, v->Car_ty, &m->hint[CORNERS], &at);
        v->Car_Road_sRoad = at.u, v->Car_Road_tRoad = at.v;
    }
}
