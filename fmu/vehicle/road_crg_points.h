/* The road asked at four points at once, without a call: for the wheels, and behind road_locate and road_elevation.
 * Private to the road and to the contact patches. */
#ifndef ROAD_CRG_POINTS_H
#define ROAD_CRG_POINTS_H

#include "four.h"
#include "road_crg_layout.h"

typedef double Two __attribute__((vector_size(16), aligned(8), may_alias));

typedef struct { Four u, v, tx, ty, stretch, share; } RoadPoints; /* as in RoadPosition; share of the way along the segment */

/* Near the centre of a bend u runs away; 1 - curvature * v is not let below this [-]. */
static const double closest_to_centre = 0.05;

/* How far (x, y) lies beyond the cross section through a node, along the line [m]. */
INLINE double beyond(const Node *p, double x, double y) { return (x - p->x) * p->tx + (y - p->y) * p->ty; }

/* Walks from segment i to the one whose two cross sections enclose (x, y). */
INLINE int walk(const Road *road, int i, double x, double y)
{
    const Node *node = road->node;
    const int last = road->rows - 2;

    while (i < last && beyond(&node[i + 1], x, y) > 0.0)
        ++i;
    while (i > 0 && beyond(&node[i], x, y) < 0.0)
        --i;
    return i;
}

/* Brings the hints up to date; -1 asks for a search over the whole line. */
INLINE void road_segments(const Road *road, Four x, Four y, int hint[4])
{
    for (int k = 0; k < 4; ++k) {
        if (hint[k] < 0 || hint[k] > road->rows - 2)
            hint[k] = road_search(road, x[k], y[k]);
        hint[k] = walk(road, hint[k], x[k], y[k]);
    }
}

/* Beyond the road's start or end: straight on. */
INLINE void point_outside(const Road *road, const Node *end, double x, double y, RoadPoints *out, int k)
{
    double dx = x - end->x, dy = y - end->y;

    out->u[k] = road->u_first + (double)(end - road->node) * road->du + dx * end->tx + dy * end->ty;
    out->v[k] = dy * end->tx - dx * end->ty;
    out->tx[k] = end->tx;
    out->ty[k] = end->ty;
    out->stretch[k] = 1.0;
    out->share[k] = end == road->node ? 0.0 : 1.0;
}

/* Inertial x, y to u, v within the segments found. */
INLINE void road_points(const Road *road, const int segment[4], Four x, Four y, RoadPoints *out)
{
    const Node *n0 = &road->node[segment[0]], *n1 = &road->node[segment[1]], *n2 = &road->node[segment[2]], *n3 = &road->node[segment[3]];
#define OF_A(field) ((Four){n0[0].field, n1[0].field, n2[0].field, n3[0].field})
#define OF_B(field) ((Four){n0[1].field, n1[1].field, n2[1].field, n3[1].field})
    const Four ax = OF_A(x), ay = OF_A(y), atx = OF_A(tx), aty = OF_A(ty), curvature = OF_A(curvature);
    const Four bx = OF_B(x), by = OF_B(y), btx = OF_B(tx), bty = OF_B(ty);
    const Four dx = bx - ax, dy = by - ay;
    const Four behind = (x - ax) * atx + (y - ay) * aty, ahead = (x - bx) * btx + (y - by) * bty;
    /* A parallel to the segment through (x, y) is cut by the cross sections through a and b; the share of the way
     * between the two cuts is the share of u (OpenCRG: "evaluation xy to uv"). */
    const Four cut_a = behind * (dx * btx + dy * bty), cut_b = ahead * (dx * atx + dy * aty);
    const Four share = cut_a / (cut_a - cut_b);
    const Four index = {segment[0], segment[1], segment[2], segment[3]};
    const Four tx = atx + share * (btx - atx), ty = aty + share * (bty - aty), length = 1.0 / root(tx * tx + ty * ty);
    out->share = share;
    out->u = road->u_first + (index + share) * road->du;
    out->v = ((y - ay) * dx - (x - ax) * dy) * OF_A(inverse_length);
    out->tx = tx * length;
    out->ty = ty * length;
    out->stretch = 1.0 / larger(1.0 - (curvature + share * (OF_B(curvature) - curvature)) * out->v, splat(closest_to_centre));
#undef OF_A
#undef OF_B
    for (int k = 0; k < 4; ++k) {
        const Node *a = &road->node[segment[k]];
        if (segment[k] == 0 && behind[k] < 0.0)
            point_outside(road, a, x[k], y[k], out, k);
        else if (segment[k] == road->rows - 2 && ahead[k] > 0.0)
            point_outside(road, a + 1, x[k], y[k], out, k);
    }
}

typedef struct { Four first, second; } Pairs;

/* Two neighbouring doubles at each of four places, turned into two Fours. */
INLINE Pairs load_pairs(const double *a, const double *b, const double *c, const double *d)
{
#ifdef HAS_SHUFFLE
    const Four ac = SHUFFLE(*(const Two *)a, *(const Two *)c, 0, 1, 2, 3), bd = SHUFFLE(*(const Two *)b, *(const Two *)d, 0, 1, 2, 3);
    return (Pairs){SHUFFLE(ac, bd, 0, 4, 2, 6), SHUFFLE(ac, bd, 1, 5, 3, 7)};
#else
    return (Pairs){{a[0], b[0], c[0], d[0]}, {a[1], b[1], c[1], d[1]}};
#endif
}

/* Whole numbers from 0 on, as array indices. */
INLINE void indices(Four whole, long long index[4])
{
    const Mask bits = (Mask)(whole + 4503599627370496.0) & 0xfffffffffffff; /* 2^52: the mantissa is the number */
    for (int k = 0; k < 4; ++k)
        index[k] = bits[k];
}

/* Rounded down, but a whole number may also count as the end of the interval below. */
INLINE Four interval(Four place, double last) { return smaller(place - 0.5, splat(last)) + ROUNDER - ROUNDER; }

/* Inertial z of the surface; what is not a number counts as the road's start or right-hand edge. */
INLINE Four road_elevations(const Road *road, Four u, Four v)
{
    const Four place = within((u - road->u_first) * road->inverse_du, splat(0.0), splat(road->rows - 1));
    const Four i = interval(place, road->rows - 2), share = place - i;
    v = within(v, splat(road->v[0]), splat(road->v[road->columns - 1]));
    long long at[4];
    indices(interval((v - road->v[0]) * road->inverse_cell, road->cells - 1), at);
    const Cell *a = &road->cell[at[0]], *b = &road->cell[at[1]], *c = &road->cell[at[2]], *d = &road->cell[at[3]];
    const Pairs ahead = load_pairs(&a->next, &b->next, &c->next, &d->next);
    const Pairs before = load_pairs(&a->v, &b->v, &c->v, &d->v);
    const Four inverse_next = {a->inverse_dv_next, b->inverse_dv_next, c->inverse_dv_next, d->inverse_dv_next};
    const Mask passed = v >= ahead.first;
    const Four left = (v - choose(passed, ahead.first, before.first)) * choose(passed, inverse_next, before.second);

    indices(i * road->columns + (ahead.second + if_so(passed, splat(1.0))), at);
    const double *za = road->surface + at[0], *zb = road->surface + at[1], *zc = road->surface + at[2], *zd = road->surface + at[3];
    const size_t row = (size_t)road->columns;
    const Pairs here = load_pairs(za, zb, zc, zd), there = load_pairs(za + row, zb + row, zc + row, zd + row);
    const Four z0 = here.first + left * (here.second - here.first), z1 = there.first + left * (there.second - there.first);
    return z0 + share * (z1 - z0);
}

#endif
