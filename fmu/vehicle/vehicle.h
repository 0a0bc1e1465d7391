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
    Four travel, travel_rate;
    Four spin;         /* absolute angular velocity of the wheel about its axis, rad/s */
    Four angle;        /* wheel rotation against the knuckle, rad */
    Four stretch_x;    /* longitudinal carcass deflection, positive when it drives, m */
    Four stretch_y;    /* lateral carcass deflection, positive when the force points left, m */
    Four valve;        /* damper command behind the valve lag */
    Four compliance;   /* compliance steer, rad */
    double rack;       /* mean road-wheel angle behind the rack compliance, rad */
    Four motor_torque; /* at the motor shaft, N m */
    Four motor_speed;  /* referred to the wheel, rad/s */
    Four windup;       /* half-shaft twist, rad */
    Four brake_torque; /* capacity behind the pressure lag, N m */
    Four brake_windup; /* elastic twist of the sticking brake, rad */
    double imu[6], imu_rate[6];   /* low-passed IMU readings and their derivatives */
    double dissipated, supplied;  /* energies since the start, J */
} State;

enum { STATES = sizeof(State) / sizeof(double) };

typedef struct {
    State x;
    double steer;          /* the steering-wheel angle that the last step held */
    double edge[CORNERS], edge_age[CORNERS];      /* of the wheel-speed sensors: last edge passed, and how long ago, s */
    double used_edge[CORNERS], used_age[CORNERS]; /* the edge that the last reading ended with */
    double edge_speed[CORNERS];                   /* the last reading, rad/s */
    int hint[CORNERS + 1]; /* last road segment of each wheel and of the body */
} Memory;

/* Constant for one parameterisation. */
typedef struct {
    Road *road;       /* NULL: flat */
    double body_mass; /* sprung, with its load */
    Vec body_inertia; /* sprung, principal, about its own centre of gravity */
    double carrier_mass;
    Vec4 hub; /* wheel centre at q = 0, from the reference point */
    Four side;
    Four lateral_slope; /* dy/dq of the wheel centre that gives the roll centre height */
    Four preload;       /* spring force at q = 0, N */
    Four bar_rate;      /* anti-roll bar force at the wheel per difference of the axle's travels, N/m */
    Four steered, ackermann_gain;
    Four sine_caster, cosine_caster;
    double track;
    Vec cog, seat, imu; /* of the whole vehicle; mounts; all from the reference point */
    double imu_axes[9]; /* IMU axes -> body axes */
    Curve passive, soft, hard;
    Four drive_share, brake_share; /* of one motor's torque; of the total brake torque */
    Four radius;
    int is_imbalanced;
} Vehicle;

/* The corners' kinematics at the present travels and steer angles, body axes. */
typedef struct {
    Vec4 r;              /* wheel centre from the reference point */
    Vec4 path;           /* dr/dq; its z is 1 */
    Four path2_x;        /* d2r/dq2, which has no y and z */
    Vec4 turn, turn2;    /* carrier rotation per travel and its derivative, rad/m, rad/m2 */
    Vec4 axle;           /* unit wheel axis, to the left */
    Vec4 kingpin;        /* unit steering axis, upwards */
    Four steer, steer_rate;
    Vec4 v, rate;        /* wheel-centre velocity; angular velocity of the carrier (wheel rotation excluded) */
} Corners;

/* The road under the wheels and the contact axes, body axes. */
typedef struct {
    Four height;           /* patch-averaged elevation, inertial */
    Vec4 normal, forward, left;
    Four sine_inclination; /* of the wheel axis against the road plane */
    Four loaded_radius, deflection, deflection_rate;
    Vec4 arm;              /* wheel centre -> contact point */
} Contact;

typedef struct {
    Four Fx, Fy, Fz, Mz, My;
    Four slip_x, slip_y;                   /* practical slips after relaxation: kappa, tan(alpha) */
    Four rolling_radius;
    Four stretch_x_rate, stretch_y_rate;
    Four grip_share;                       /* of the friction ellipse that the force takes up */
    Four dissipation;                      /* power that does not come back, W */
} Tyre;

/* What one evaluation works out on the way from the state to its derivative. */
typedef struct {
    double R[9];
    Vec gravity; /* body axes */
    Corners corner;
    Contact contact;
    Tyre tyre;
    Four spring_force, damper_force;        /* on the travel, positive in compression */
    Vec4 force, moment;                     /* on carrier and wheel, at the wheel centre */
    Four axial_moment;                      /* the tyre's moment about the wheel axis */
    Vec body_force, body_moment;            /* on the sprung body, about the reference point */
    Vec acceleration, angular_acceleration; /* of the body, inertial, in body axes */
    Four travel_acceleration;
    double rack_rate;
    Four compliance_rate;
} Work;

/* derivative.c */
void vehicle_derivative(const Variables *p, const Vehicle *c, Memory *m, const State *x, Work *w, State *dx);
void vehicle_integrate(const Variables *p, const Vehicle *c, Memory *m, double h, int steps, Work *w);
/* parameters.c */
ModelStatus vehicle_constants(Model *m, Vehicle *c);
/* encoder.c */
INLINE int encoder_is_on(const Variables *p) { return p->Sensor_WheelSpd_Teeth > 0; }
void encoder_start(const Variables *p, Memory *m, const double spin[CORNERS]);
/* One internal step of length h, over which the wheel turns evenly: which edge came last, and how long ago. */
void encoder_step(const Variables *p, Memory *m, const double angle_before[CORNERS], double h);
/* Speeds at a communication point, rad/s. */
void encoder_read(const Variables *p, Memory *m, double speed[CORNERS]);
/* equilibrium.c */
ModelStatus equilibrium(Model *m, const Vehicle *c, Memory *memory);
/* outputs.c */
void imu_reading(const Vehicle *c, const State *x, const Work *w, double reading[6]);
void vehicle_outputs(Variables *v, const Vehicle *c, Memory *m, const Work *w);

#endif
