/* A road as it is asked: private to road_crg.c and road_crg_layout.c. */
#ifndef ROAD_CRG_LAYOUT_H
#define ROAD_CRG_LAYOUT_H

#include "road_crg.h"
#include "road_crg_file.h"

enum { MOST_V_CELLS = 1 << 20 };

typedef struct {              /* a point of the reference line; 64 bytes, one cache line */
    double x, y;              /* [m] */
    double tx, ty;            /* unit tangent: direction from the point before to the point after */
    double heading, curvature; /* [rad], [1/m] */
    double z, banking;        /* [m], [-] */
} Node;

struct Road {
    Node *node;       /* (rows) */
    float *grid;      /* (rows, columns) elevation relative to the reference line [m] */
    double *v;        /* (columns) ascending [m] */
    double *inverse_dv; /* (columns - 1) [1/m] */
    int *cell;        /* (cells) even cells across v -> column interval at the cell's right-hand edge */
    int rows, columns, cells;
    double u_first, du, inverse_du, inverse_cell;
    char notes[NOTES_SIZE];
};

/* Lays the road out: reference line, modifiers, cells that are no number, tables. Takes the grid over from `file`. */
bool crg_layout(Road *road, CrgFile *file);

/* In road_crg.c: the segment at the first node of the whole line that is nearest to (x, y). */
int road_search(const Road *road, double x, double y);

#endif
