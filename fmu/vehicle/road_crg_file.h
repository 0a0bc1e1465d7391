/* What an OpenCRG file says, before the road is laid out. Private to road_crg*.c. */
#ifndef ROAD_CRG_FILE_H
#define ROAD_CRG_FILE_H

#include <stdbool.h>
#include <stddef.h>

enum { /* keywords of $ROAD_CRG that matter to the geometry; NAN in `road` means not given */
    START_U, END_U, INCREMENT, V_RIGHT, V_LEFT, V_INCREMENT, START_X, START_Y, START_Z, START_PHI, START_BANKING,
    START_SLOPE, END_X, END_Y, END_Z, END_PHI, ROAD_KEYS
};

enum { /* keywords of $ROAD_CRG_MODS; NAN in `mods` means not given */
    SCALE_GRID, SCALE_SLOPE, SCALE_BANKING, SCALE_LENGTH, SCALE_WIDTH, SCALE_CURVATURE, NAN_MODE, NAN_OFFSET,
    ROTCENTER_X, ROTCENTER_Y, OFFSET_PHI, OFFSET_X, OFFSET_Y, OFFSET_Z, POINT_U_FRACTION, POINT_U_OFFSET, POINT_U,
    POINT_V_FRACTION, POINT_V_OFFSET, POINT_V, POINT_X, POINT_Y, POINT_Z, POINT_PHI, MOD_KEYS
};

enum { NO_CHANNEL = -1, NOTES_SIZE = 1024, PATH_SIZE = 1024 };

typedef struct {
    double v;    /* position [m], or its number when columns are numbered */
    int channel; /* its place in a record */
} Column;

typedef struct {
    const char *path; /* for messages */
    char *error;
    size_t error_size;
    int line;

    double road[ROAD_KEYS];
    double mods[MOD_KEYS];
    bool has_mods, mods_closed; /* closed: set by an outer file, which wins */
    bool has_opts, opts_closed;
    char reference[PATH_SIZE]; /* file named in $ROAD_CRG_FILE */
    char notes[NOTES_SIZE];

    bool binary, wide; /* wide: double precision, 20 characters or 8 bytes */
    bool has_format;
    int channels;
    int phi_channel, slope_channel, banking_channel, x_channel, u_channel;
    bool by_number; /* columns given as "long section 1" instead of "at v = ..." */

    int rows, columns;
    Column *column; /* (columns), ascending */
    float *grid;    /* (rows, columns) */
    double *phi, *slope, *banking; /* (rows) each, NULL if the file has no such channel */
} CrgFile;

/* false on failure, with the sentence in file->error. `file` is initialised here; free it in either case. */
bool crg_file_read(CrgFile *file, const char *path, char *error, size_t error_size);
void crg_file_free(CrgFile *file);

/* Writes "path:line: sentence" and returns false. */
bool crg_fail(CrgFile *file, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* Adds a sentence to the notes. */
void crg_note(CrgFile *file, const char *format, ...) __attribute__((format(printf, 2, 3)));

/* A decimal number in text[0..size), blanks around it allowed, whatever the locale; false if it is anything else. */
bool crg_number(const char *text, size_t size, double *value);

/* In road_crg_header.c and road_crg_data.c. */
bool crg_header_read(CrgFile *file, const char *text, size_t size, size_t *data_offset); /* *data_offset = size: none */
bool crg_data_read(CrgFile *file, const char *data, size_t size);

#endif
