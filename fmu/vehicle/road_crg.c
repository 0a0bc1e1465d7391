/* Where is a point on the road, and how high is the road there. */
#include "road_crg.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "road_crg_layout.h"

/* Of places whose distance differs by less, a search over the whole line takes the first [m]. */
static const double equally_near = 0.02;

/* Near the centre of a bend u runs away; 1 - curvature * v is not let below this [-]. */
static const double closest_to_centre = 0.05;

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
    free(road->v);
    free(road->inverse_dv);
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

/* First node of the whole line that is nearest to (x, y). */
static int nearest_node(const Road *road, double x, double y)
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
    return best;
}

/* How far (x, y) lies beyond the cross section through a node, along the line [m]. */
static inline double beyond(const Node *p, double x, double y)
{
    return (x - p->x) * p->tx + (y - p->y) * p->ty;
}

/* Walks from segment i to the one whose two cross sections enclose (x, y). */
static inline int walk(const Road *road, int i, double x, double y, double *behind, double *ahead)
{
    const Node *node = road->node;
    const int last = road->rows - 2;

    *ahead = beyond(&node[i + 1], x, y);
    while (*ahead > 0.0 && i < last)
        *ahead = beyond(&node[++i + 1], x, y);
    *behind = beyond(&node[i], x, y);
    while (*behind < 0.0 && i > 0) {
        *ahead = *behind;
        *behind = beyond(&node[--i], x, y);
    }
    return i;
}

/* Beyond the road's start or end: straight on. */
static void locate_outside(const Road *road, const Node *end, double x, double y, RoadPosition *out)
{
    double dx = x - end->x, dy = y - end->y;

    out->u = road->u_first + (double)(end - road->node) * road->du + dx * end->tx + dy * end->ty;
    out->v = dy * end->tx - dx * end->ty;
    out->heading = end->heading;
    out->tx = end->tx;
    out->ty = end->ty;
    out->stretch = 1.0;
}

void road_locate(const Road *road, double x, double y, int *hint, RoadPosition *out)
{
    const Node *node = road->node, *a, *b;
    double behind, ahead, share, dx, dy, curvature, length;
    int i = *hint >= 0 && *hint <= road->rows - 2 ? *hint : nearest_node(road, x, y);

    i = i <= road->rows - 2 ? i : road->rows - 2;
    *hint = i = walk(road, i, x, y, &behind, &ahead);
    a = &node[i];
    b = &node[i + 1];
    if ((i == 0 && behind < 0.0) || (i == road->rows - 2 && ahead > 0.0)) {
        locate_outside(road, behind < 0.0 ? a : b, x, y, out);
        return;
    }
    /* A parallel to the segment through (x, y) is cut by the cross sections through a and b; the share of the way
     * between the two cuts is the share of u (OpenCRG: "evaluation xy to uv"). */
    dx = b->x - a->x;
    dy = b->y - a->y;
    behind *= dx * b->tx + dy * b->ty;
    ahead *= dx * a->tx + dy * a->ty;
    share = behind / (behind - ahead);
    out->u = road->u_first + (i + share) * road->du;
    out->v = ((y - a->y) * dx - (x - a->x) * dy) / sqrt(dx * dx + dy * dy);
    out->heading = a->heading + share * (b->heading - a->heading);
    out->tx = a->tx + share * (b->tx - a->tx);
    out->ty = a->ty + share * (b->ty - a->ty);
    length = 1.0 / sqrt(out->tx * out->tx + out->ty * out->ty);
    out->tx *= length;
    out->ty *= length;
    curvature = a->curvature + share * (b->curvature - a->curvature);
    curvature = 1.0 - curvature * out->v;
    out->stretch = 1.0 / (curvature > closest_to_centre ? curvature : closest_to_centre);
}

double road_elevation(const Road *road, double u, double v)
{
    const int last = road->columns - 1;
    double share, across, z0, z1, line;
    int i = segment_at(road, u, &share), j;
    const Node *a = &road->node[i], *b = a + 1;
    const float *z;

    v = v > road->v[0] ? v : road->v[0];
    v = v < road->v[last] ? v : road->v[last];
    j = road->cell[(int)((v - road->v[0]) * road->inverse_cell)];
    j += (v >= road->v[j + 1]) & (j < last - 1); /* a cell spans one edge at most; no branch to mispredict */
    across = (v - road->v[j]) * road->inverse_dv[j];
    z = road->grid + (size_t)i * (size_t)road->columns + j;
    z0 = z[0] + across * ((double)z[1] - z[0]);
    z += road->columns;
    z1 = z[0] + across * ((double)z[1] - z[0]);
    line = a->z + v * a->banking + share * (b->z - a->z + v * (b->banking - a->banking));
    return line + z0 + share * (z1 - z0);
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
