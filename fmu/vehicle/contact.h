/* Road contact: the patch averages the road, and the tyre stands on the plane of that average.
 *
 * A follower of the single point under the wheel would feel wavelengths that a tyre swallows. The mean height and the
 * least-squares slopes over the patch are what a tandem-cam enveloping model yields for short-wave unevenness
 * (Pacejka, Tire and Vehicle Dynamics, 3rd ed., section 10.1). */
#ifndef CONTACT_H
#define CONTACT_H

#include "road_crg_points.h"
#include "vehicle.h"

enum { PATCH_POINTS = 4 };

typedef struct { Four height, slope_forward, slope_left; } Patch;

INLINE Patch sample_patch(const Variables *p, const Road *road, Vec4 ground, Four fx, Four fy, int hint[CORNERS]) {
    RoadPoints at;
    road_segments(road, ground.x, ground.y, hint);
    road_points(road, hint, ground.x, ground.y, &at);
    const Four along = fx * at.tx + fy * at.ty, across = fy * at.tx - fx * at.ty; /* wheel heading on the road */
    const double step = p->Road_PatchLength / PATCH_POINTS, half = p->Road_PatchWidth / 2;
    Four total[2] = {splat(0.0), splat(0.0)}, moment = splat(0.0);
    double weight = 0;
    for (int line = 0; line < 2; ++line) {
        const double t = line ? -half : half;
        for (int k = 0; k < PATCH_POINTS; ++k) {
            const double s = (k - (PATCH_POINTS - 1) / 2.0) * step;
            const Four z = road_elevations(road, at.u + at.stretch * (s * along - t * across), at.v + s * across + t * along);
            total[line] += z, moment += s * z, weight += s * s;
        }
    }
    const Four mean_left = total[0] / PATCH_POINTS, mean_right = total[1] / PATCH_POINTS;
    const double per_weight = weight > 0 ? 1 / weight : 0.0;
    return (Patch){(mean_left + mean_right) / 2, moment * per_weight, (mean_left - mean_right) / (2 * half)};
}

INLINE void contact_patches(const Variables *p, const Vehicle *c, const State *x, Work *w, int hint[CORNERS]) {
    Contact *t = &w->contact;
    const Corners *k = &w->corner;
    const double *R = w->R;
    const Vec4 hub = add(spread(x->position), to_inertial(R, k->r));
    Vec4 n = {splat(0.0), splat(0.0), splat(1.0)};
    t->height = splat(0.0);
    if (c->road) {
        const Vec4 axle = to_inertial(R, k->axle);
        const Four level = 1 / root(axle.x * axle.x + axle.y * axle.y), fx = axle.y * level, fy = -axle.x * level;
        /* The foot of the wheel lies below the hub along the body's z axis, not along the plumb line. */
        const Vec4 down = scale(-c->radius, spread(vec(R[2], R[5], R[8])));
        const Patch patch = sample_patch(p, c->road, add(hub, down), fx, fy, hint);
        /* `height` is the plane's elevation straight below the hub. */
        t->height = patch.height - (patch.slope_forward * (fx * down.x + fy * down.y) + patch.slope_left * (fx * down.y - fy * down.x));
        n = unit4(vec4(patch.slope_left * fy - patch.slope_forward * fx, -patch.slope_forward * fy - patch.slope_left * fx, splat(1.0)));
    }
    t->normal = to_body(R, n);
    t->sine_inclination = dot(k->axle, t->normal);
    const Four per_cosine = 1 / root(1 - t->sine_inclination * t->sine_inclination);
    t->forward = scale(per_cosine, cross(k->axle, t->normal));
    t->left = cross(t->normal, t->forward);
    t->loaded_radius = (hub.z - t->height) * n.z * per_cosine;
    t->deflection = c->radius - t->loaded_radius;
    t->deflection_rate = -dot(k->v, t->normal);
    t->arm = scale(-t->loaded_radius * per_cosine, axpy(-t->sine_inclination, k->axle, t->normal));
}

#endif
