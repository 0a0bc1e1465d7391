/* Parameters -> constants: sprung mass properties, hub positions, spring preloads, damper curves, the road. */
#include <stdio.h>
#include <string.h>
#include "vehicle.h"

static const char OWN_ROAD[] = "road.crg"; /* in the FMU's resources */
static const double FULL_SPEEDS[] = {0.05, 0.1, 0.25, 0.5, 1.0, 2.0}; /* m/s, of the damper tables */

static void damper_curves(const Variables *p, Vehicle *c) {
    curve_damper(&c->passive, 6, FULL_SPEEDS, &p->Damp_PassiveRebound1, &p->Damp_PassiveCompression1);
    curve_damper(&c->soft, 5, FULL_SPEEDS, &p->Damp_SoftRebound1, &p->Damp_SoftCompression1);
    curve_damper(&c->hard, 5, FULL_SPEEDS, &p->Damp_HardRebound1, &p->Damp_HardCompression1);
}

/* Wheel centres from the whole vehicle's centre of gravity, and spring forces that hold the car level at q = 0. */
static void corners(const Variables *p, Vehicle *c) {
    const double wheelbase = p->Body_CogToFront + p->Body_CogToRear, track = p->Body_CogToLeft + p->Body_CogToRight;
    const double weight = p->Body_Mass * p->Env_Gravity;
    c->carrier_mass = p->Body_UnsprungMass / CORNERS;
    c->track = track;
    for (int i = 0; i < CORNERS; ++i) {
        const int front = i == FL || i == FR, left = i == FL || i == RL;
        const double load = weight * (front ? p->Body_CogToRear : p->Body_CogToFront) / wheelbase *
                            (left ? p->Body_CogToRight : p->Body_CogToLeft) / track;
        c->side[i] = left ? 1.0 : -1.0;
        c->radius[i] = p->Tire_Radius * p->Wheel_RadiusScale[i];
        const double loaded = c->radius[i] - load / p->Tire_Stiffness;
        c->hub.x[i] = front ? p->Body_CogToFront : -p->Body_CogToRear;
        c->hub.y[i] = left ? p->Body_CogToLeft : -p->Body_CogToRight;
        c->hub.z[i] = loaded - p->Body_CogHeight;
        /* The contact point's lateral slope is 2 h_rc / track; the camber gain brings part of it. */
        c->lateral_slope[i] = c->side[i] * (2 * p->Kin_RollCentre[i] / track - loaded * p->Kin_Camber[i]);
        c->preload[i] = load - c->carrier_mass * p->Env_Gravity;
        c->brake_share[i] = (front ? p->Brake_FrontShare : 1 - p->Brake_FrontShare) / 2;
        const double largest = fmax(p->PT_RearShare, 1 - p->PT_RearShare);
        c->drive_share[i] = (front ? 1 - p->PT_RearShare : p->PT_RearShare) / largest;
        c->bar_rate[i] = (front ? p->Susp_AntiRollFront : p->Susp_AntiRollRear) / (track * track);
        c->steered[i] = front ? 1.0 : 0.0;
        c->ackermann_gain[i] = c->steered[i] * c->side[i] * p->Steer_Ackermann * track / (2 * wheelbase);
        c->sine_caster[i] = sin(p->Kin_Caster[i]), c->cosine_caster[i] = cos(p->Kin_Caster[i]);
        c->is_imbalanced |= p->Wheel_Imbalance[i] > 0;
    }
}

/* A load on the body of the empty vehicle: common centre of gravity and inertia (parallel axes; products of inertia are
 * left out, as the empty vehicle's are). The springs keep their preload, so the car sinks. */
static void carry_load(const Variables *p, double *mass, Vec *centre, Vec *inertia) {
    const Vec apart = sub(vec(p->Load_X, p->Load_Y, p->Load_Z), *centre);
    const double whole = *mass + p->Load_Mass, reduced = *mass * p->Load_Mass / whole;
    inertia->x += p->Load_InertiaRoll + reduced * (apart.y * apart.y + apart.z * apart.z);
    inertia->y += p->Load_InertiaPitch + reduced * (apart.x * apart.x + apart.z * apart.z);
    inertia->z += p->Load_InertiaYaw + reduced * (apart.x * apart.x + apart.y * apart.y);
    *centre = axpy(p->Load_Mass / whole, apart, *centre);
    *mass = whole;
}

/* The table's centre of gravity and inertias are the whole vehicle's: take the carriers and wheels out of them. */
static void sprung_mass(const Variables *p, Vehicle *c) {
    c->body_mass = p->Body_Mass - p->Body_UnsprungMass;
    Vec moment = vec(0, 0, 0);
    Vec inertia = vec(p->Body_InertiaRoll, p->Body_InertiaPitch, p->Body_InertiaYaw);
    for (int i = 0; i < CORNERS; ++i) {
        const Vec r = corner_of(c->hub, i);
        moment = axpy(c->carrier_mass, r, moment);
        inertia.x -= c->carrier_mass * (r.y * r.y + r.z * r.z) + p->Wheel_CarrierInertiaX;
        inertia.y -= c->carrier_mass * (r.x * r.x + r.z * r.z) + p->Wheel_CarrierInertiaY + p->Wheel_Inertia;
        inertia.z -= c->carrier_mass * (r.x * r.x + r.y * r.y) + p->Wheel_CarrierInertiaX;
    }
    Vec o = scale(-1 / c->body_mass, moment); /* sprung centre of gravity from the whole vehicle's */
    inertia.x -= c->body_mass * (o.y * o.y + o.z * o.z);
    inertia.y -= c->body_mass * (o.x * o.x + o.z * o.z);
    inertia.z -= c->body_mass * (o.x * o.x + o.y * o.y);
    if (p->Load_Mass > 0) carry_load(p, &c->body_mass, &o, &inertia);
    c->body_inertia = inertia;
    c->cog = scale(-1, o);
    c->hub = sub(c->hub, spread(o));
    c->seat = sub(vec(p->Body_SeatX, p->Body_SeatY, p->Body_SeatZ), o);
    c->imu = sub(vec(p->Sensor_Imu_X, p->Sensor_Imu_Y, p->Sensor_Imu_Z), o);
}

static void imu_axes(const Variables *p, double R[9]) {
    const double cx = cos(p->Sensor_Imu_Roll), sx = sin(p->Sensor_Imu_Roll), cy = cos(p->Sensor_Imu_Pitch);
    const double sy = sin(p->Sensor_Imu_Pitch), cz = cos(p->Sensor_Imu_Yaw), sz = sin(p->Sensor_Imu_Yaw);
    R[0] = cz * cy, R[1] = cz * sy * sx - sz * cx, R[2] = cz * sy * cx + sz * sx;
    R[3] = sz * cy, R[4] = sz * sy * sx + cz * cx, R[5] = sz * sy * cx - cz * sx;
    R[6] = -sy, R[7] = cy * sx, R[8] = cy * cx;
}

static ModelStatus check(const Model *m, const Vehicle *c) {
    const Vec I = c->body_inertia;
    if (c->body_mass <= 0) {
        model_log(m, MODEL_ERROR, "logStatusError", "Body.UnsprungMass = %g kg leaves no sprung mass of Body.Mass = %g kg: lower it",
                  m->v.Body_UnsprungMass, m->v.Body_Mass);
        return MODEL_ERROR;
    }
    if (I.x <= 0 || I.y <= 0 || I.z <= 0) {
        model_log(m, MODEL_ERROR, "logStatusError",
                  "the sprung body's inertia would be (%g, %g, %g) kg m2 once the wheels are taken out: raise Body.Inertia%s",
                  I.x, I.y, I.z, I.x <= 0 ? "Roll" : I.y <= 0 ? "Pitch" : "Yaw");
        return MODEL_ERROR;
    }
    if (m->v.SlipControl_End <= m->v.SlipControl_Start) {
        model_log(m, MODEL_ERROR, "logStatusError", "SlipControl.End = %g must lie above SlipControl.Start = %g", m->v.SlipControl_End,
                  m->v.SlipControl_Start);
        return MODEL_ERROR;
    }
    return MODEL_OK;
}

/* Without Road.File the road that lies in the FMU's resources, if one was put there; else it is flat. */
static int own_road(const Model *m, const char *path) {
    FILE *file = m->resources[0] ? fopen(path, "rb") : NULL;
    if (file) fclose(file);
    return file != NULL;
}

static ModelStatus load_road(const Model *m, Vehicle *c) {
    const char *file = m->v.Road_File[0] ? m->v.Road_File : OWN_ROAD;
    const int absolute = file[0] == '/' || file[0] == '\\' || file[1] == ':';
    char path[2 * MODEL_STRING_SIZE], error[512] = "";
    snprintf(path, sizeof path, "%s%s%s", absolute ? "" : m->resources, absolute ? "" : "/", file);
    if (!m->v.Road_File[0] && !own_road(m, path)) return MODEL_OK;
    c->road = road_load(path, error, sizeof error);
    if (c->road) return MODEL_OK;
    model_log(m, MODEL_ERROR, "logRoad", "Road.File: %s", error);
    return MODEL_ERROR;
}

ModelStatus vehicle_constants(Model *m, Vehicle *c) {
    const Variables *p = &m->v;
    corners(p, c);
    sprung_mass(p, c);
    imu_axes(p, c->imu_axes);
    damper_curves(p, c);
    const ModelStatus status = check(m, c);
    return status == MODEL_OK ? load_road(m, c) : status;
}
