/* The vehicle model: its state, what is derived from its parameters, and what one evaluation works out.
 *
 * Reference point of the body: the centre of gravity of the sprung mass. Body axes ISO 8855 (x forward, y left, z up).
 * Corner order FL FR RL RR. A corner's wheel travel q is positive in compression. Everything is SI. */
#ifndef VEHICLE_H
#define VEHICLE_H

#include "curve.h"
#include "model.h"
#include "road_crg.h"
#include "vector.h"

enum { FL, FR, RL, RR, CORNERS };

/* Doubles only: the integrator treats it as one array. */
typedef struct {
    Vec position;         /* inertial, m */
    double quaternion[4]; /* body -> inertial (w, x, y, z) */
    Vec velocity, rate;   /* of the reference point and of the body, body axes, m/s and rad/s */
    double travel[CORNERS], travel_rate[CORNERS];
    double spin[CORNERS];         /* absolute angular velocity of the wheel about its axis, rad/s */
    double angle[CORNERS];        /* wheel rotation against the knuckle, rad */
    double stretch_x[CORNERS];    /* longitudinal carcass deflection, positive when it drives, m */
    double stretch_y[CORNERS];    /* lateral carcass deflection, positive when the force points left, m */
    double valve[CORNERS];        /* damper command behind the valve lag */
    double compliance[CORNERS];   /* compliance steer, rad */
    double rack;                  /* mean road-wheel angle behind the rack compliance, rad */
    double motor_torque[CORNERS]; /* at the motor shaft, N m */
    double motor_speed[CORNERS];  /* referred to the wheel, rad/s */
    double windup[CORNERS];       /* half-shaft twist, rad */
    double brake_torque[CORNERS]; /* capacity behind the pressure lag, N m */
    double brake_windup[CORNERS]; /* elastic twist of the sticking brake, rad */
    double imu[6], imu_rate[6];   /* low-passed IMU readings and their derivatives */
    double dissipated, supplied;  /* energies since the start, J */
} State;

enum { STATES = sizeof(State) / sizeof(double) };

typedef struct {
    State x;
    double steer, gas, brake; /* the inputs that the last step held */
    int hint[CORNERS + 1];    /* last road segment of each wheel and of the body */
} Memory;

/* Constant for one parameterisation. */
typedef struct {
    Road *road;       /* NULL: flat */
    double body_mass; /* sprung, with its load */
    Vec body_inertia; /* sprung, principal, about its own centre of gravity */
    double carrier_mass;
    Vec hub[CORNERS]; /* wheel centre at q = 0, from the reference point */
    double side[CORNERS];
    double lateral_slope[CORNERS]; /* dy/dq of the wheel centre that gives the roll centre height */
    double preload[CORNERS];       /* spring force at q = 0, N */
    double track;
    Vec cog, seat, imu; /* of the whole vehicle; mounts; all from the reference point */
    double imu_axes[9]; /* IMU axes -> body axes */
    Curve passive, soft, hard;
    double drive_share[CORNERS], brake_share[CORNERS]; /* of one motor's torque; of the total brake torque */
    double radius[CORNERS];
} Vehicle;

/* One corner's kinematics at the present travel and steer angle, body axes. */
typedef struct {
    Vec r;              /* wheel centre from the reference point */
    Vec path, path2;    /* dr/dq, d2r/dq2 */
    Vec turn, turn2;    /* carrier rotation per travel and its derivative, rad/m, rad/m2 */
    Vec axle;           /* unit wheel axis, to the left */
    Vec kingpin;        /* unit steering axis, upwards */
    double steer, steer_rate;
    Vec v, rate;        /* wheel-centre velocity; angular velocity of the carrier (wheel rotation excluded) */
} Corner;

/* The road under a wheel and the contact axes, body axes. */
typedef struct {
    double height;           /* patch-averaged elevation, inertial */
    Vec normal, forward, left;
    double sine_inclination; /* of the wheel axis against the road plane */
    double loaded_radius, deflection, deflection_rate;
    Vec arm;                 /* wheel centre -> contact point */
} Contact;

typedef struct {
    double Fx, Fy, Fz, Mz, My;
    double slip_x, slip_y;                   /* practical slips after relaxation: kappa, tan(alpha) */
    double rolling_radius;
    double stretch_x_rate, stretch_y_rate;
    double dissipation;                      /* power that does not come back, W */
} Tyre;

/* What one evaluation works out on the way from the state to its derivative. */
typedef struct {
    double R[9];
    Vec gravity; /* body axes */
    Corner corner[CORNERS];
    Contact contact[CORNERS];
    Tyre tyre[CORNERS];
    double spring_force[CORNERS], damper_force[CORNERS]; /* on the travel, positive in compression */
    double axle_torque[CORNERS];                         /* half-shaft on the wheel */
    double brake_reaction[CORNERS];                      /* brake on the wheel */
    Vec force[CORNERS], moment[CORNERS];                 /* on carrier and wheel, at the wheel centre */
    double axial_moment[CORNERS];                        /* the tyre's moment about the wheel axis */
    Vec body_force, body_moment;                         /* on the sprung body, about the reference point */
    Vec acceleration, angular_acceleration;              /* of the body, inertial, in body axes */
    double travel_acceleration[CORNERS];
    double rack_rate, compliance_rate[CORNERS];
} Work;

/* vehicle.c */
void vehicle_derivative(const Variables *p, const Vehicle *c, Memory *m, const State *x, Work *w, State *dx);
/* parameters.c */
ModelStatus vehicle_constants(Model *m, Vehicle *c);
/* suspension.c */
void corner_kinematics(const Variables *p, const Vehicle *c, const State *x, int i, Corner *k);
void corner_steer(const Variables *p, const Vehicle *c, const State *x, int i, Corner *k);
void suspension_forces(const Variables *p, const Vehicle *c, const State *x, Work *w);
double suspension_energy(const Variables *p, const Vehicle *c, const State *x);
/* steering.c */
double ackermann(const Variables *p, const Vehicle *c, double rack, int i, double *gradient);
void steering_rates(const Variables *p, const Vehicle *c, const State *x, double hand_wheel, Work *w);
/* contact.c */
void contact_patch(const Variables *p, const Vehicle *c, const State *x, Work *w, int *hint, int i);
/* tyre.c */
void tyre_forces(const Variables *p, const Vehicle *c, const State *x, Work *w, int i);
double tyre_relaxation_y(const Variables *p, double Fz, double radius);
double tyre_rolling_radius(const Variables *p, double Fz, double radius);
/* powertrain.c */
void powertrain(const Variables *p, const Vehicle *c, const State *x, Work *w, State *dx);
double brake_demand(const Variables *p, const Vehicle *c, int i);
/* multibody.c */
void multibody_accelerations(const Variables *p, const Vehicle *c, const State *x, Work *w);
double kinetic_energy(const Variables *p, const Vehicle *c, const State *x, const Work *w);
/* equilibrium.c */
ModelStatus equilibrium(Model *m, const Vehicle *c, Memory *memory);
/* outputs.c */
void imu_reading(const Vehicle *c, const State *x, const Work *w, double reading[6]);
void vehicle_outputs(Variables *v, const Vehicle *c, Memory *m, const Work *w);

#endif
