/* OpenCRG roads: a reference line with heading, slope and banking, and a grid of elevations along and across it.
 *
 * Conventions are those of ASAM OpenCRG 1.2 (its C API is the oracle of the tests): u runs along the reference
 * line, v to its left, heading counter-clockwise from the x axis, z up, banking positive when the left side is
 * higher; SI units. Reads ASCII (LRFI, LDFI) and binary (KRBI, KDBI) files, evenly and unevenly spaced
 * columns, and applies every modifier of $ROAD_CRG_MODS. A file without that section is moved so that its
 * start lies at x = y = z = 0 with heading 0, as the standard asks; an empty section leaves it where it is.
 *
 * Outside the grid the elevation, slope-free, keeps its edge value in u and in v (border mode 2) and the
 * reference line goes straight on. Cells that are not a number take their neighbour's value.
 *
 * A Road is read-only once loaded: any number of threads may ask it at the same time. Nothing is
 * allocated after road_load(). */
#ifndef ROAD_CRG_H
#define ROAD_CRG_H

#include <stddef.h>

typedef struct Road Road;

typedef struct {
    double u;       /* along the reference line, in the file's own count [m] */
    double v;       /* to the left of it [m] */
    double heading; /* of the reference line at u, continuous along the road (not wrapped) [rad] */
    double tx, ty;  /* unit vector of that heading */
    double stretch; /* du/ds along the local heading = 1 / (1 - curvature * v), 20 at most [-] */
} RoadPosition;

/* NULL on failure, with one sentence in `error`: the file, the line if there is one, what is wrong and what to do. */
Road *road_load(const char *path, char *error, size_t error_size);
void road_free(Road *road);

/* What the file asks for and this reader does otherwise (border modes, closed reference line), as one
 * sentence each, separated by newlines; "" if there is nothing to say. */
const char *road_notes(const Road *road);

/* First and last u of the file. */
void road_range(const Road *road, double *u_first, double *u_last);

/* Inertial x, y to the road's u, v. *hint is the segment of the last answer, or -1 for a search over the whole
 * line (of equally near places the first, so that a circuit which overlaps its own start begins at its start).
 * With a hint the search walks from there, which keeps the lap. */
void road_locate(const Road *road, double x, double y, int *hint, RoadPosition *out);

/* Inertial z of the surface: reference line + banking * v + grid, linear between its points. */
double road_elevation(const Road *road, double u, double v);

/* Curvature of the reference line, positive to the left; measured over half a metre [1/m]. */
double road_curvature(const Road *road, double u);

/* The inverse of road_locate(). */
void road_point(const Road *road, double u, double v, double *x, double *y);

#endif
