/* Reading an OpenCRG file: bytes, header, records; messages and numbers. */
#include "road_crg_file.h"

#include <limits.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#ifdef _WIN32
#include <windows.h>
#endif

enum { DEEPEST_REFERENCE = 4 };

bool crg_fail(CrgFile *file, const char *format, ...)
{
    char sentence[512];
    va_list arguments;

    va_start(arguments, format);
    vsnprintf(sentence, sizeof sentence, format, arguments);
    va_end(arguments);
    for (char *c = sentence; *c; ++c) /* quoted pieces of a damaged file must not damage the log */
        if ((unsigned char)*c < ' ' || (unsigned char)*c > '~')
            *c = '?';
    if (file->line > 0)
        snprintf(file->error, file->error_size, "%s:%d: %s", file->path, file->line, sentence);
    else
        snprintf(file->error, file->error_size, "%s: %s", file->path, sentence);
    return false;
}

void crg_note(CrgFile *file, const char *format, ...)
{
    size_t used = strlen(file->notes);
    va_list arguments;

    if (used > 0 && used + 1 < sizeof file->notes) {
        file->notes[used++] = '\n';
        file->notes[used] = '\0';
    }
    va_start(arguments, format);
    vsnprintf(file->notes + used, sizeof file->notes - used, format, arguments);
    va_end(arguments);
}

static double power_of_ten(int exponent)
{
    static const double exact[] = {1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11,
                                   1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};
    return exponent <= 22 ? exact[exponent] : pow(10.0, exponent);
}

/* Digits at text[*at..size), into *mantissa as long as it holds them; returns how many there were. */
static int take_digits(const char *text, size_t size, size_t *at, double *mantissa, int *dropped)
{
    int count = 0;
    for (; *at < size && text[*at] >= '0' && text[*at] <= '9'; ++*at, ++count) {
        if (*mantissa < 1e15)
            *mantissa = *mantissa * 10.0 + (text[*at] - '0'); /* exact: below 2^53 */
        else
            ++*dropped;
    }
    return count;
}

static bool take_exponent(const char *text, size_t size, size_t *at, int *exponent)
{
    double digits = 0.0;
    int dropped = 0;
    bool negative;

    if (*at >= size || !strchr("eEdD", text[*at]) || text[*at] == '\0')
        return true;
    ++*at;
    negative = *at < size && text[*at] == '-';
    if (*at < size && (text[*at] == '-' || text[*at] == '+'))
        ++*at;
    if (!take_digits(text, size, at, &digits, &dropped) || digits > 400.0)
        return false;
    *exponent += negative ? -(int)digits : (int)digits;
    return true;
}

bool crg_number(const char *text, size_t size, double *value)
{
    double mantissa = 0.0;
    int dropped = 0, digits, exponent = 0;
    size_t at = 0;
    bool negative;

    while (at < size && (text[at] == ' ' || text[at] == '\t'))
        ++at;
    negative = at < size && text[at] == '-';
    if (at < size && (text[at] == '-' || text[at] == '+'))
        ++at;
    digits = take_digits(text, size, &at, &mantissa, &dropped);
    exponent = dropped;
    if (at < size && text[at] == '.') {
        int fraction;
        ++at;
        dropped = 0;
        fraction = take_digits(text, size, &at, &mantissa, &dropped);
        exponent -= fraction - dropped;
        digits += fraction;
    }
    if (!digits || !take_exponent(text, size, &at, &exponent))
        return false;
    while (at < size && strchr(" \t\r", text[at]) && text[at] != '\0')
        ++at;
    if (at < size)
        return false;
    mantissa = exponent < 0 ? mantissa / power_of_ten(-exponent) : mantissa * power_of_ten(exponent);
    *value = negative ? -mantissa : mantissa;
    return isfinite(*value);
}

/* `path` is UTF-8, as FMI has it. */
static FILE *open_file(const char *path)
{
#ifdef _WIN32
    wchar_t wide[PATH_SIZE];
    return MultiByteToWideChar(CP_UTF8, 0, path, -1, wide, PATH_SIZE) ? _wfopen(wide, L"rb") : NULL;
#else
    return fopen(path, "rb");
#endif
}

static char *read_bytes(CrgFile *file, const char *path, size_t *size)
{
    FILE *stream = open_file(path);
    char *bytes = NULL;
    long length = -1;

    if (!stream) {
        crg_fail(file, "cannot be opened; check the path and the permissions.");
        return NULL;
    }
    if (fseek(stream, 0, SEEK_END) == 0)
        length = ftell(stream);
    if (length >= 0 && length < LONG_MAX && fseek(stream, 0, SEEK_SET) == 0)
        bytes = malloc((size_t)length + 1);
    if (bytes && fread(bytes, 1, (size_t)length, stream) != (size_t)length) {
        free(bytes);
        bytes = NULL;
    }
    fclose(stream);
    if (!bytes)
        crg_fail(file, "cannot be read; it must be a regular file that fits into memory.");
    *size = (size_t)length;
    return bytes;
}

static int by_position(const void *a, const void *b)
{
    double d = ((const Column *)a)->v - ((const Column *)b)->v;
    return d < 0 ? -1 : d > 0;
}

/* Columns that are numbered instead of placed: from v_right on, v_increment apart. */
static bool place_numbered(CrgFile *file)
{
    double *road = file->road;

    for (int j = 0; j < file->columns; ++j)
        if (file->column[j].v != j + 1)
            return crg_fail(file, "columns are numbered but number %d is missing or doubled.", j + 1);
    if (isnan(road[V_INCREMENT]))
        road[V_INCREMENT] = isnan(road[V_RIGHT]) || isnan(road[V_LEFT])
            ? 0.01 : (road[V_LEFT] - road[V_RIGHT]) / (file->columns - 1);
    if (isnan(road[V_RIGHT])) {
        road[V_RIGHT] = isnan(road[V_LEFT]) ? -0.5 * road[V_INCREMENT] * (file->columns - 1)
                                            : road[V_LEFT] - road[V_INCREMENT] * (file->columns - 1);
        crg_note(file, "long_section_v_right is not given; the columns start at v = %g m.", road[V_RIGHT]);
    }
    if (!(road[V_INCREMENT] > 0))
        return crg_fail(file, "long_section_v_increment is %g m; it must be positive.", road[V_INCREMENT]);
    for (int j = 0; j < file->columns; ++j)
        file->column[j].v = road[V_RIGHT] + j * road[V_INCREMENT];
    return true;
}

/* What must hold before the records are read. */
static bool check_header(CrgFile *file)
{
    double *road = file->road;

    file->line = 0;
    if (!file->has_format || file->columns < 2)
        return crg_fail(file, "$KD_DEFINITION names %s; is this an OpenCRG file?",
                        file->has_format ? "fewer than two columns (D:long section ...)" : "no data format (#:KRBI)");
    if (file->x_channel != NO_CHANNEL && file->phi_channel == NO_CHANNEL)
        return crg_fail(file, "the reference line is given by x, y channels, which the standard's reader does not use "
                        "either; give its heading (D:reference line phi,rad).");
    if (isnan(road[START_U]))
        road[START_U] = 0.0;
    if (isnan(road[INCREMENT]))
        road[INCREMENT] = 0.01; /* the standard's default */
    if (!(road[INCREMENT] > 1e-6))
        return crg_fail(file, "reference_line_increment is %g m; it must be positive.", road[INCREMENT]);
    qsort(file->column, (size_t)file->columns, sizeof *file->column, by_position);
    if (file->by_number && !place_numbered(file))
        return false;
    for (int j = 1; j < file->columns; ++j)
        if (!(file->column[j].v - file->column[j - 1].v > 1e-6))
            return crg_fail(file, "two columns lie at v = %g m; remove one.", file->column[j].v);
    return true;
}

static bool read_level(CrgFile *file, const char *path, int depth);

/* $ROAD_CRG_FILE: the road of another file, under the modifiers and options of this one. */
static bool read_referenced(CrgFile *file, const char *path, int depth)
{
    char inner[2 * PATH_SIZE];
    const char *slash = strrchr(path, '/');
    int folder = slash && file->reference[0] != '/' ? (int)(slash - path) + 1 : 0;

    if (!file->reference[0])
        return crg_fail(file, "there is no data section (a line $$$$ before it); is this an OpenCRG file?");
    if (depth >= DEEPEST_REFERENCE)
        return crg_fail(file, "$ROAD_CRG_FILE leads from file to file more than %d times.", DEEPEST_REFERENCE);
    if (folder > PATH_SIZE)
        return crg_fail(file, "its folder's path is longer than %d characters.", PATH_SIZE);
    snprintf(inner, sizeof inner, "%.*s%s", folder, path, file->reference);
    file->reference[0] = '\0';
    file->mods_closed = file->has_mods;
    file->opts_closed = file->has_opts;
    return read_level(file, inner, depth + 1);
}

static bool read_level(CrgFile *file, const char *path, int depth)
{
    size_t size = 0, data = 0;
    char *bytes;
    bool good;

    file->path = path;
    file->line = 0;
    bytes = read_bytes(file, path, &size);
    if (!bytes)
        return false;
    good = crg_header_read(file, bytes, size, &data);
    if (good && data == size) {
        file->line = 0;
        good = read_referenced(file, path, depth);
    } else if (good) {
        int header_lines = file->line;
        good = check_header(file);
        file->line = header_lines;
        good = good && crg_data_read(file, bytes + data, size - data);
    }
    free(bytes);
    return good;
}

bool crg_file_read(CrgFile *file, const char *path, char *error, size_t error_size)
{
    memset(file, 0, sizeof *file);
    file->error = error;
    file->error_size = error_size;
    file->phi_channel = file->slope_channel = file->banking_channel = NO_CHANNEL;
    file->x_channel = file->u_channel = NO_CHANNEL;
    for (int i = 0; i < ROAD_KEYS; ++i)
        file->road[i] = NAN;
    for (int i = 0; i < MOD_KEYS; ++i)
        file->mods[i] = NAN;
    if (!read_level(file, path, 0))
        return false;
    file->path = path;
    return true;
}

void crg_file_free(CrgFile *file)
{
    free(file->column);
    free(file->grid);
    free(file->phi);
    free(file->slope);
    free(file->banking);
}
