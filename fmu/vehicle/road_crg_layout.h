/* A road as it is asked: private to road_crg.c and road_crg_layout.c. */
#ifndef ROAD_CRG_LAYOUT_H
#define ROAD_CRG_LAYOUT_H

#include "road_crg.h"
#include "road_crg_file.h"

enum { MOST_V_CELLS = 1 << 20 };

typedef struct { /* a point of the reference line */
    double x, y;               /* [m] */
    double tx, ty;             /* unit tangent: direction from the point before to the point after */
    double curvature, heading; /* [1/m], [rad] */
    double inverse_length;     /* of the straight piece to the next point [1/m] */
    double z, banking;         /* [m], [-] */
} Node;

typedef struct { /* a piece of the way across, with one column in it at most */
    double next, column;         /* where that column lies, infinity if there is none; number of the column before it */
    double v, inverse_dv;        /* of the column before: place, and 1 over the way to the next one */
    double inverse_dv_next, gap; /* of the next one */
} Cell;

struct Road {
    Node *node;      /* (rows) */
    float *grid;     /* (rows, columns) elevation relative to the reference line [m]; only until the surface is made */
    double *surface; /* (rows, columns) elevation: line + banking * v + grid, each of them bilinear, and so their sum [m] */
    double *v;       /* (columns) ascending [m] */
    Cell *cell;      /* (cells) of even length, across the road */
    int rows, columns, cells;
    double u_first, du, inverse_du, inverse_cell;
    char notes[NOTES_SIZE];
};

/* Lays the road out: reference line, modifiers, cells that are no number, tables. Takes the grid over from `file`. */
bool crg_layout(Road *road, CrgFile *file);

/* In road_crg.c: the segment at the first node of the whole line that is nearest to (x, y). */
int road_search(const Road *road, double x, double y);

#endif
