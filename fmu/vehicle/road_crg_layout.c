/* From a file's headings, slopes and modifiers to points of the reference line.
 * Source: ASAM OpenCRG 1.2, "Reference line" and "Modifiers"; the order is scale, fill, move. */
#include "road_crg_layout.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double full_turn = 6.283185307179586;

static double given_or(double value, double otherwise)
{
    return isnan(value) ? otherwise : value;
}

static double heading_at(const CrgFile *file, int i)
{
    double start = file->road[START_PHI], scale = given_or(file->mods[SCALE_CURVATURE], 1.0);

    if (!file->phi || i == 0) /* the channel's first entry is not used: entry i is the heading from i - 1 to i */
        return start;
    return start + scale * (file->phi[i] - start);
}

static void integrate_line(const Road *road, const CrgFile *file)
{
    Node *node = road->node;

    node[0].x = given_or(file->road[START_X], 0.0);
    node[0].y = given_or(file->road[START_Y], 0.0);
    for (int i = 1; i < road->rows; ++i) {
        node[i].x = node[i - 1].x + road->du * cos(heading_at(file, i));
        node[i].y = node[i - 1].y + road->du * sin(heading_at(file, i));
    }
}

/* If the end is given: backward integration from it, blended into the forward one step by step. */
static bool blend_with_end(const Road *road, const CrgFile *file)
{
    const int n = road->rows;
    Node *node = road->node;
    double *back = malloc((size_t)n * 2 * sizeof *back);

    if (!back)
        return false;
    back[2 * n - 2] = file->road[END_X];
    back[2 * n - 1] = file->road[END_Y];
    for (int i = n - 1; i > 0; --i) {
        back[2 * i - 2] = back[2 * i] - road->du * cos(heading_at(file, i));
        back[2 * i - 1] = back[2 * i + 1] - road->du * sin(heading_at(file, i));
    }
    for (int i = 1; i < n; ++i) {
        double share = (double)i / (n - 1);
        double x = node[i - 1].x + road->du * cos(heading_at(file, i));
        double y = node[i - 1].y + road->du * sin(heading_at(file, i));
        node[i].x = (1.0 - share) * x + share * back[2 * i];
        node[i].y = (1.0 - share) * y + share * back[2 * i + 1];
    }
    free(back);
    return true;
}

/* A scaled line no longer ends where the file says: its given end is then left aside. */
static bool scaled(const CrgFile *file, int key)
{
    return !isnan(file->mods[key]) || !isnan(file->mods[SCALE_LENGTH]);
}

static double slope_at(const CrgFile *file, int i)
{
    return file->slope ? file->slope[i] : given_or(file->road[START_SLOPE], 0.0);
}

static void integrate_elevation(const Road *road, const CrgFile *file)
{
    const int n = road->rows;
    double scale = given_or(file->mods[SCALE_SLOPE], 1.0);
    double start = given_or(file->road[START_Z], 0.0), end = file->road[END_Z];
    bool sloped = file->slope || given_or(file->road[START_SLOPE], 0.0) != 0.0;
    Node *node = road->node;

    node[0].z = start;
    for (int i = 1; i < n; ++i)
        node[i].z = node[i - 1].z + (sloped ? road->du * slope_at(file, i) : 0.0);
    if (sloped && !isnan(end) && !scaled(file, SCALE_SLOPE)) { /* as blend_with_end(), but with the standard reader's weight (i - 1) / (n - 1) */
        double behind = end - node[n - 1].z; /* backward minus forward integration, the same everywhere */
        double blended = start;
        for (int i = 1; i < n - 1; ++i) {
            double share = (double)(i - 1) / (n - 1), forward = node[i].z;
            blended = (1.0 - share) * (blended + road->du * slope_at(file, i)) + share * (forward + behind);
            node[i].z = blended;
        }
        node[n - 1].z = end;
    }
    for (int i = 1; i < n; ++i)
        node[i].z = start + scale * (node[i].z - start);
    for (int i = 0; i < n; ++i)
        node[i].banking = given_or(file->mods[SCALE_BANKING], 1.0) *
                          (file->banking ? file->banking[i] : given_or(file->road[START_BANKING], 0.0));
}

/* Unit tangents, headings without jumps, curvature over half a metre. */
static void derive_line(const Road *road)
{
    const int n = road->rows, reach = (int)fmax(1.0, floor(0.25 * road->inverse_du + 0.5));
    Node *node = road->node;

    for (int i = 0; i < n; ++i) {
        const Node *a = &node[i > 0 ? i - 1 : 0], *b = &node[i < n - 1 ? i + 1 : n - 1];
        double dx = b->x - a->x, dy = b->y - a->y, size = hypot(dx, dy);
        node[i].tx = dx / size;
        node[i].ty = dy / size;
        node[i].heading = atan2(dy, dx);
        node[i].inverse_length = i < n - 1 ? 1.0 / hypot(b->x - node[i].x, b->y - node[i].y) : 0.0;
        if (i > 0) {
            double turn = node[i].heading - node[i - 1].heading;
            node[i].heading -= full_turn * floor(turn / full_turn + 0.5);
        }
    }
    for (int i = 0; i < n; ++i) {
        int a = i > reach ? i - reach : 0, b = i < n - 1 - reach ? i + reach : n - 1;
        node[i].curvature = (node[b].heading - node[a].heading) / ((b - a) * road->du);
    }
}

static bool check_line(const Road *road, CrgFile *file)
{
    for (int i = 0; i < road->rows; ++i) {
        const Node *p = &road->node[i], *before = &road->node[i > 0 ? i - 1 : 0];
        double step = hypot(p->x - before->x, p->y - before->y);
        if (!isfinite(p->x + p->y + p->z + p->banking))
            return crg_fail(file, "the reference line runs off to infinity; check start, increment and slope.");
        if (i > 0 && fabs(step - road->du) > 0.5 * road->du)
            return crg_fail(file, "the reference line's end (reference_line_end_x, _y) does not fit its headings; "
                            "correct it or leave it out.");
    }
    return true;
}

/* Numbers for the cells that have none: across first, from the right and then from the left; then the row before. */
static bool fill_cells(const Road *road, CrgFile *file)
{
    const int n = road->rows, m = road->columns;
    double mode = given_or(file->mods[NAN_MODE], 2.0), offset = given_or(file->mods[NAN_OFFSET], 0.0);
    int good = -1;

    for (int i = 0; i < n; ++i) {
        float *z = road->grid + (size_t)i * (size_t)m;
        bool gap = false;
        for (int j = 0; j < m; ++j)
            gap = gap || isnan(z[j]);
        if (gap && mode != 1.0 && offset != 0.0)
            return crg_fail(file, "grid_nan_offset = %g would put steps into the surface; use grid_nan_mode = 2 without "
                            "an offset.", offset);
        for (int j = 0; gap && j < m; ++j)
            if (isnan(z[j]))
                z[j] = mode == 1.0 ? (float)offset : j > 0 ? z[j - 1] : NAN;
        for (int j = m - 2; gap && j >= 0; --j)
            if (isnan(z[j]))
                z[j] = z[j + 1];
        if (isnan(z[0]) && good >= 0)
            memcpy(z, z - m, (size_t)m * sizeof *z);
        else if (!isnan(z[0]) && good < 0)
            good = i;
    }
    if (good < 0)
        return crg_fail(file, "not one elevation is a number.");
    for (int i = good - 1; i >= 0; --i)
        memcpy(road->grid + (size_t)i * (size_t)m, road->grid + (size_t)good * (size_t)m, (size_t)m * sizeof(float));
    if (mode == 0.0)
        crg_note(file, "grid_nan_mode = 0 is not followed: a cell without a number takes its neighbour's.");
    return true;
}

/* Turns the line by `turn` about (cx, cy) and then moves it. */
static void move_line(const Road *road, double turn, double cx, double cy, const double shift[3])
{
    double c = cos(turn), s = sin(turn);

    for (int i = 0; i < road->rows; ++i) {
        Node *p = &road->node[i];
        double x = p->x - cx, y = p->y - cy;
        p->x = cx + c * x - s * y + shift[0];
        p->y = cy + s * x + c * y + shift[1];
        p->z += shift[2];
    }
}

static bool any_given(const double *mods, const int *keys, int count)
{
    for (int i = 0; i < count; ++i)
        if (!isnan(mods[keys[i]]))
            return true;
    return false;
}

/* Heading that the reference point turns to: the file's own at both ends, else that of its segment. */
static double point_heading(const Road *road, const CrgFile *file, double u)
{
    double place = (u - road->u_first) * road->inverse_du;
    int i = place <= 0 ? 0 : place >= road->rows - 2 ? road->rows - 2 : (int)place;
    int reach = (int)fmax(1.0, floor(0.5 * road->inverse_du));

    if (i < reach)
        return heading_at(file, 0);
    if (i + reach >= road->rows)
        return heading_at(file, road->rows - 1);
    return heading_at(file, i + 1);
}

static double fraction_or(const double *mods, int at, int fraction, int offset, double first, double last)
{
    double place = isnan(mods[at]) ? isnan(mods[fraction]) ? NAN : first + mods[fraction] * (last - first) : mods[at];
    return place + given_or(mods[offset], 0.0);
}

/* The point (u, v) of the surface goes to refpoint_x, _y, _z with heading refpoint_phi. */
static void move_point(const Road *road, const CrgFile *file)
{
    const double *mods = file->mods;
    double u_last = road->u_first + (road->rows - 1) * road->du, x, y;
    double u = fraction_or(mods, POINT_U, POINT_U_FRACTION, POINT_U_OFFSET, road->u_first, u_last);
    double v = fraction_or(mods, POINT_V, POINT_V_FRACTION, POINT_V_OFFSET, road->v[0], road->v[road->columns - 1]);

    u = given_or(u, road->u_first + given_or(mods[POINT_U_OFFSET], 0.0));
    v = given_or(v, given_or(mods[POINT_V_OFFSET], 0.0));
    road_point(road, u, v, &x, &y);
    move_line(road, given_or(mods[POINT_PHI], 0.0) - point_heading(road, file, u), x, y,
              (double[3]){given_or(mods[POINT_X], 0.0) - x, given_or(mods[POINT_Y], 0.0) - y,
                          given_or(mods[POINT_Z], 0.0) - road_elevation(road, u, v)});
}

static void move_road(const Road *road, const CrgFile *file)
{
    static const int points[] = {POINT_U_FRACTION, POINT_U, POINT_V_FRACTION, POINT_V, POINT_X, POINT_Y, POINT_Z,
                                 POINT_PHI, POINT_U_OFFSET, POINT_V_OFFSET};
    static const int offsets[] = {OFFSET_PHI, OFFSET_X, OFFSET_Y, OFFSET_Z};
    const double *mods = file->mods;

    if (!file->has_mods || any_given(mods, points, sizeof points / sizeof *points))
        move_point(road, file);
    else if (any_given(mods, offsets, sizeof offsets / sizeof *offsets))
        move_line(road, given_or(mods[OFFSET_PHI], 0.0), given_or(mods[ROTCENTER_X], road->node[0].x),
                  given_or(mods[ROTCENTER_Y], road->node[0].y),
                  (double[3]){given_or(mods[OFFSET_X], 0.0), given_or(mods[OFFSET_Y], 0.0),
                              given_or(mods[OFFSET_Z], 0.0)});
}

/* Columns, and a table of even cells, none wider than half the narrowest column, to find them at once. */
static bool make_columns(Road *road, CrgFile *file)
{
    const int m = road->columns;
    double width = given_or(file->mods[SCALE_WIDTH], 1.0), narrowest = INFINITY, span;

    road->v = malloc((size_t)m * sizeof *road->v);
    if (!road->v)
        return crg_fail(file, "not enough memory for %d columns.", m);
    for (int j = 0; j < m; ++j)
        road->v[j] = width * file->column[j].v;
    for (int j = 0; j < m - 1; ++j)
        narrowest = fmin(narrowest, road->v[j + 1] - road->v[j]);
    span = road->v[m - 1] - road->v[0];
    if (!(2.0 * span / narrowest < MOST_V_CELLS))
        return crg_fail(file, "two columns lie %g m apart in a road %g m wide; drop one.", narrowest, span);
    road->cells = (int)ceil(2.0 * span / narrowest) + 1;
    road->inverse_cell = (road->cells - 1) / span;
    road->cell = malloc((size_t)road->cells * sizeof *road->cell);
    if (!road->cell)
        return crg_fail(file, "not enough memory for %d columns.", m);
    for (int k = 0, j = 0; k < road->cells; ++k) {
        while (j < m - 2 && (road->v[j + 1] - road->v[0]) * road->inverse_cell <= k)
            ++j;
        bool last = j == m - 2;
        road->cell[k] = (Cell){last ? INFINITY : road->v[j + 1], j, road->v[j], 1.0 / (road->v[j + 1] - road->v[j]),
                               last ? 0.0 : 1.0 / (road->v[j + 2] - road->v[j + 1]), 0.0};
    }
    return true;
}

static void lay_surface(const Road *road)
{
    const int m = road->columns;

    for (int i = 0; i < road->rows; ++i)
        for (int j = 0; j < m; ++j) {
            size_t at = (size_t)i * (size_t)m + (size_t)j;
            road->surface[at] = road->node[i].z + road->v[j] * road->node[i].banking + (double)road->grid[at];
        }
}

static bool check_mods(CrgFile *file)
{
    const double *mods = file->mods;
    double mode = given_or(mods[NAN_MODE], 2.0);

    if (!(given_or(mods[SCALE_LENGTH], 1.0) > 1e-6) || !(given_or(mods[SCALE_WIDTH], 1.0) > 1e-6))
        return crg_fail(file, "scale_length and scale_width must be positive.");
    if (mode != 0.0 && mode != 1.0 && mode != 2.0)
        return crg_fail(file, "grid_nan_mode is %g; it must be 0, 1 or 2.", mode);
    if ((!isnan(mods[POINT_U]) && !isnan(mods[POINT_U_FRACTION])) ||
        (!isnan(mods[POINT_V]) && !isnan(mods[POINT_V_FRACTION])))
        return crg_fail(file, "a reference point is given both by place and by fraction; keep one of the two.");
    return true;
}

bool crg_layout(Road *road, CrgFile *file)
{
    bool ended = !isnan(file->road[END_X]) && !isnan(file->road[END_Y]) && !scaled(file, SCALE_CURVATURE);

    if (!check_mods(file))
        return false;
    file->road[START_PHI] = given_or(file->road[START_PHI], 0.0);
    road->rows = file->rows;
    road->columns = file->columns;
    road->u_first = file->road[START_U];
    road->du = file->road[INCREMENT] * given_or(file->mods[SCALE_LENGTH], 1.0);
    road->inverse_du = 1.0 / road->du;
    road->grid = file->grid;
    file->grid = NULL;
    road->node = calloc((size_t)road->rows, sizeof *road->node);
    road->surface = malloc((size_t)road->rows * (size_t)road->columns * sizeof *road->surface);
    if (!road->node || !road->surface)
        return crg_fail(file, "not enough memory for %d cross sections.", road->rows);
    if (!make_columns(road, file))
        return false;
    for (size_t i = 0; i < (size_t)road->rows * (size_t)road->columns && !isnan(file->mods[SCALE_GRID]); ++i)
        road->grid[i] *= (float)file->mods[SCALE_GRID];
    if (!fill_cells(road, file))
        return false;
    integrate_line(road, file);
    if (ended && file->phi && !blend_with_end(road, file))
        return crg_fail(file, "not enough memory for %d cross sections.", road->rows);
    integrate_elevation(road, file);
    if (!check_line(road, file))
        return false;
    derive_line(road);
    lay_surface(road);
    move_road(road, file);
    if (!check_line(road, file))
        return false;
    derive_line(road);
    lay_surface(road);
    free(road->grid);
    road->grid = NULL;
    memcpy(road->notes, file->notes, sizeof road->notes);
    return true;
}
