/* The records of an OpenCRG file: one per cross section, as fixed-width text or big-endian binary. */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "road_crg_file.h"

static float big_endian_float(const unsigned char *b)
{
    uint32_t bits = 0;
    float value;
    for (int i = 0; i < 4; ++i)
        bits = bits << 8 | b[i];
    memcpy(&value, &bits, sizeof value);
    return value;
}

static double big_endian_double(const unsigned char *b)
{
    uint64_t bits = 0;
    double value;
    for (int i = 0; i < 8; ++i)
        bits = bits << 8 | b[i];
    memcpy(&value, &bits, sizeof value);
    return value;
}

static void binary_record(const CrgFile *file, const char *record, double *value)
{
    const unsigned char *b = (const unsigned char *)record;
    for (int i = 0; i < file->channels; ++i)
        value[i] = file->wide ? big_endian_double(b + (size_t)i * 8) : (double)big_endian_float(b + (size_t)i * 4);
}

/* One field of text: a number; NAN if it is stars or words; 0 for "**unused**" (first entries of phi and slope). */
static bool text_field(CrgFile *file, const char *field, size_t size, double *value)
{
    if (crg_number(field, size, value))
        return true;
    if (size == 0 || strspn(field, " \t") >= size)
        return crg_fail(file, "the line ends before its values do; each value takes %d characters and 80 fill a line.",
                        file->wide ? 20 : 10);
    *value = size >= 10 && memcmp(field, "**unused**", 10) == 0 ? 0.0 : NAN;
    return true;
}

static size_t line_length(const char *text, size_t size)
{
    const char *end = memchr(text, '\n', size);
    return end ? (size_t)(end - text) : size;
}

/* Reads one record of text at *at and moves *at behind it. */
static bool text_record(CrgFile *file, const char *data, size_t size, size_t *at, double *value)
{
    const int width = file->wide ? 20 : 10, per_line = 80 / width;

    for (int first = 0; first < file->channels; first += per_line) {
        size_t length = *at < size ? line_length(data + *at, size - *at) : 0, used = length;
        const char *line = data + *at;

        file->line++;
        if (used > 0 && line[used - 1] == '\r')
            used--;
        for (int i = first; i < file->channels && i < first + per_line; ++i) {
            size_t start = (size_t)(i - first) * (size_t)width, left = used > start ? used - start : 0;
            const char *field = left ? line + start : "";
            if (!text_field(file, field, left < (size_t)width ? left : (size_t)width, &value[i]))
                return false;
        }
        *at += *at < size ? length + 1 : 0;
    }
    return true;
}

/* Records that the header announces, or -1 if it does not say. */
static double announced_rows(const CrgFile *file)
{
    if (isnan(file->road[END_U]))
        return -1;
    return floor((file->road[END_U] - file->road[START_U]) / file->road[INCREMENT] + 1.5);
}

static bool count_binary(CrgFile *file, size_t size, int *rows)
{
    size_t record = (size_t)file->channels * (file->wide ? 8 : 4);
    double announced = announced_rows(file), held = floor((double)size / (double)record);

    if (announced < 0)
        announced = held;
    if (announced > held)
        return crg_fail(file, "the header announces %.0f cross sections but the file holds %.0f; it is cut short.",
                        announced, held);
    if (announced < 2 || announced > 1e8)
        return crg_fail(file, "%.0f cross sections make no road; check reference_line_end_u and _increment.", announced);
    *rows = (int)announced;
    return true;
}

static bool count_text(CrgFile *file, const char *data, size_t *size, int *rows)
{
    const int per_line = file->wide ? 4 : 8, lines_per_record = (file->channels + per_line - 1) / per_line;
    double announced = announced_rows(file);
    size_t lines = 0;

    while (*size > 0 && strchr(" \t\r\n", data[*size - 1])) /* an empty tail is no record */
        --*size;
    for (size_t at = 0; at < *size; at += line_length(data + at, *size - at) + 1)
        lines++;
    if (lines % (size_t)lines_per_record)
        return crg_fail(file, "%zu lines of data do not make whole cross sections of %d lines; the file is cut short.",
                        lines, lines_per_record);
    lines /= (size_t)lines_per_record;
    if ((double)lines < announced)
        return crg_fail(file, "the header announces %.0f cross sections but the file holds %zu; it is cut short.",
                        announced, lines);
    if (lines < 2 || lines > 100000000)
        return crg_fail(file, "%zu cross sections make no road; at least two are needed.", lines);
    *rows = (int)lines;
    return true;
}

static bool store_channel(CrgFile *file, double *target, int row, double value, const char *name)
{
    if (!isfinite(value) && row > 0)
        return crg_fail(file, "the %s of cross section %d is not a number; repair the file.", name, row + 1);
    target[row] = isfinite(value) ? value : 0.0; /* the first phi and slope are never used */
    return true;
}

static bool store_record(CrgFile *file, int row, const double *value)
{
    float *z = file->grid + (size_t)row * (size_t)file->columns;

    for (int j = 0; j < file->columns; ++j) {
        double cell = value[file->column[j].channel];
        z[j] = isfinite(cell) ? (float)cell : NAN;
    }
    if (file->phi && !store_channel(file, file->phi, row, value[file->phi_channel], "heading"))
        return false;
    if (file->slope && !store_channel(file, file->slope, row, value[file->slope_channel], "slope"))
        return false;
    return !file->banking || store_channel(file, file->banking, row, value[file->banking_channel], "banking");
}

static bool allocate(CrgFile *file)
{
    size_t n = (size_t)file->rows;

    file->grid = calloc(n * (size_t)file->columns, sizeof *file->grid);
    file->phi = file->phi_channel != NO_CHANNEL ? calloc(n, sizeof *file->phi) : NULL;
    file->slope = file->slope_channel != NO_CHANNEL ? calloc(n, sizeof *file->slope) : NULL;
    file->banking = file->banking_channel != NO_CHANNEL ? calloc(n, sizeof *file->banking) : NULL;
    if (!file->grid || (file->phi_channel != NO_CHANNEL && !file->phi) ||
        (file->slope_channel != NO_CHANNEL && !file->slope) || (file->banking_channel != NO_CHANNEL && !file->banking))
        return crg_fail(file, "not enough memory for %d cross sections of %d columns.", file->rows, file->columns);
    return true;
}

static bool read_records(CrgFile *file, const char *data, size_t size, double *value)
{
    size_t record = (size_t)file->channels * (file->wide ? 8 : 4);

    for (size_t at = 0, row = 0; row < (size_t)file->rows; ++row) {
        if (file->binary)
            binary_record(file, data + row * record, value);
        else if (!text_record(file, data, size, &at, value))
            return false;
        if (!store_record(file, (int)row, value))
            return false;
    }
    return true;
}

bool crg_data_read(CrgFile *file, const char *data, size_t size)
{
    int header_lines = file->line;
    double *value;
    bool good;

    if (!(file->binary ? count_binary(file, size, &file->rows) : count_text(file, data, &size, &file->rows)) ||
        !allocate(file))
        return false;
    value = calloc((size_t)file->channels, sizeof *value);
    if (!value)
        return crg_fail(file, "not enough memory.");
    file->line = file->binary ? 0 : header_lines;
    good = read_records(file, data, size, value);
    free(value);
    file->line = 0;
    return good;
}
