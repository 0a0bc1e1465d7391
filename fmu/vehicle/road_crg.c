/* Where is a point on the road, and how high is the road there. */
#include "road_crg.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "road_crg_layout.h"
#include "road_crg_points.h"

/* Of places whose distance differs by less, a search over the whole line takes the first [m]. */
static const double equally_near = 0.02;

Road *road_load(const char *path, char *error, size_t error_size)
{
    Road *road = calloc(1, sizeof *road);
    CrgFile file;
    bool good;

    if (!road) {
        snprintf(error, error_size, "%s: not enough memory.", path);
        return NULL;
    }
    good = crg_file_read(&file, path, error, error_size) && crg_layout(road, &file);
    crg_file_free(&file);
    if (good)
        return road;
    road_free(road);
    return NULL;
}

void road_free(Road *road)
{
    if (!road)
        return;
    free(road->node);
    free(road->grid);
    free(road->surface);
    free(road->v);
    free(road->cell);
    free(road);
}

const char *road_notes(const Road *road)
{
    return road->notes;
}

void road_range(const Road *road, double *u_first, double *u_last)
{
    *u_first = road->u_first;
    *u_last = road->u_first + (road->rows - 1) * road->du;
}

/* Segment of u (clamped to the road; what is not a number counts as its start) and the share of the way along it. */
static inline int segment_at(const Road *road, double u, double *share)
{
    double place = (u - road->u_first) * road->inverse_du;
    int i;

    place = place > 0.0 ? place : 0.0;
    place = place < road->rows - 1 ? place : road->rows - 1;
    i = (int)place;
    i = i < road->rows - 2 ? i : road->rows - 2;
    *share = place - i;
    return i;
}

int road_search(const Road *road, double x, double y)
{
    double nearest = INFINITY, limit = INFINITY;
    int best = 0;

    for (int i = 0; i < road->rows; ++i) {
        double dx = x - road->node[i].x, dy = y - road->node[i].y, square = dx * dx + dy * dy;
        if (square < limit) {
            best = i;
            nearest = sqrt(square);
            limit = nearest > equally_near ? (nearest - equally_near) * (nearest - equally_near) : 0.0;
        }
    }
    return best < road->rows - 1 ? best : road->rows - 2;
}

void road_locate(const Road *road, double x, double y, int *hint, RoadPosition *out)
{
    int segment[4];
    RoadPoints at;
    const Node *a;

    segment[0] = walk(road, *hint >= 0 && *hint <= road->rows - 2 ? *hint : road_search(road, x, y), x, y);
    segment[1] = segment[2] = segment[3] = *hint = segment[0];
    road_points(road, segment, splat(x), splat(y), &at);
    a = &road->node[segment[0]];
    *out = (RoadPosition){at.u[0], at.v[0], a[0].heading + at.share[0] * (a[1].heading - a[0].heading), at.tx[0], at.ty[0],
                          at.stretch[0]};
}

double road_elevation(const Road *road, double u, double v)
{
    return road_elevations(road, splat(u), splat(v))[0];
}

double road_curvature(const Road *road, double u)
{
    double share, first, last;
    int i = segment_at(road, u, &share);

    road_range(road, &first, &last);
    if (!(u >= first && u <= last))
        return 0.0;
    return road->node[i].curvature + share * (road->node[i + 1].curvature - road->node[i].curvature);
}

void road_point(const Road *road, double u, double v, double *x, double *y)
{
    double share, first, last, dx, dy, size, along_a, along_b;
    int i = segment_at(road, u, &share);
    const Node *a = &road->node[i], *b = a + 1;

    road_range(road, &first, &last);
    if (u < first || u > last) {
        const Node *end = u < first ? a : b;
        double over = u < first ? u - first : u - last;
        *x = end->x + over * end->tx - v * end->ty;
        *y = end->y + over * end->ty + v * end->tx;
        return;
    }
    dx = b->x - a->x;
    dy = b->y - a->y;
    size = sqrt(dx * dx + dy * dy);
    along_a = v * size / (dx * a->tx + dy * a->ty); /* cross sections are drawn out so that v is kept in between */
    along_b = v * size / (dx * b->tx + dy * b->ty);
    *x = (1.0 - share) * (a->x - along_a * a->ty) + share * (b->x - along_b * b->ty);
    *y = (1.0 - share) * (a->y + along_a * a->tx) + share * (b->y + along_b * b->tx);
}
