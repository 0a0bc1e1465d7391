/* Road contact: the patch averages the road, and the tyre stands on the plane of that average.
 *
 * A follower of the single point under the wheel would feel wavelengths that a tyre swallows. The mean height and the
 * least-squares slopes over the patch are what a tandem-cam enveloping model yields for short-wave unevenness
 * (Pacejka, Tire and Vehicle Dynamics, 3rd ed., section 10.1). */
#include "vehicle.h"

enum { PATCH_POINTS = 4 };

typedef struct { double height, slope_forward, slope_left; } Patch;

static Patch sample_patch(const Variables *p, const Road *road, Vec ground, double fx, double fy, int *hint) {
    RoadPosition at;
    road_locate(road, ground.x, ground.y, hint, &at);
    const double along = fx * at.tx + fy * at.ty, across = fy * at.tx - fx * at.ty; /* wheel heading on the road */
    const double step = p->Road_PatchLength / PATCH_POINTS, half = p->Road_PatchWidth / 2;
    double sum[2] = {0, 0}, moment = 0, weight = 0;
    for (int line = 0; line < 2; ++line) {
        const double t = line ? -half : half;
        for (int k = 0; k < PATCH_POINTS; ++k) {
            const double s = (k - (PATCH_POINTS - 1) / 2.0) * step;
            const double z = road_elevation(road, at.u + at.stretch * (s * along - t * across), at.v + s * across + t * along);
            sum[line] += z, moment += s * z, weight += s * s;
        }
    }
    const double mean_left = sum[0] / PATCH_POINTS, mean_right = sum[1] / PATCH_POINTS;
    return (Patch){(mean_left + mean_right) / 2, weight > 0 ? moment / weight : 0.0, (mean_left - mean_right) / (2 * half)};
}

void contact_patch(const Variables *p, const Vehicle *c, const State *x, Work *w, int *hint, int i) {
    Contact *t = &w->contact[i];
    const Corner *k = &w->corner[i];
    const Vec hub = add(x->position, to_inertial(w->R, k->r)), axle = to_inertial(w->R, k->axle);
    Patch patch = {0, 0, 0};
    double fx = 1, fy = 0;
    if (c->road) {
        const double level = 1 / sqrt(axle.x * axle.x + axle.y * axle.y);
        fx = axle.y * level, fy = -axle.x * level;
        /* The foot of the wheel lies below the hub along the body's z axis, not along the plumb line. */
        const Vec down = scale(-c->radius[i], vec(w->R[2], w->R[5], w->R[8]));
        patch = sample_patch(p, c->road, add(hub, down), fx, fy, hint);
        patch.height -= patch.slope_forward * (fx * down.x + fy * down.y) + patch.slope_left * (fx * down.y - fy * down.x);
    }
    /* `height` is now the plane's elevation straight below the hub. */
    const Vec n = unit(vec(-patch.slope_forward * fx + patch.slope_left * fy, -patch.slope_forward * fy - patch.slope_left * fx, 1));
    t->height = patch.height;
    t->normal = to_body(w->R, n);
    t->forward = unit(cross(k->axle, t->normal));
    t->left = cross(t->normal, t->forward);
    t->sine_inclination = dot(k->axle, t->normal);
    const double cosine = sqrt(1 - t->sine_inclination * t->sine_inclination);
    t->loaded_radius = (hub.z - patch.height) * n.z / cosine;
    t->deflection = c->radius[i] - t->loaded_radius;
    t->deflection_rate = -dot(k->v, t->normal);
    t->arm = scale(-t->loaded_radius / cosine, axpy(-t->sine_inclination, k->axle, t->normal));
}
