/* The header of an OpenCRG file: blocks that start with $NAME and end with $, keywords, channel definitions.
 * Source of the grammar: ASAM OpenCRG 1.2, "File format". */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "road_crg_file.h"

typedef enum { BLOCK_NONE, BLOCK_SKIPPED, BLOCK_ROAD, BLOCK_MODS, BLOCK_OPTS, BLOCK_FILE, BLOCK_CHANNELS } Block;

static const char *const road_keys[ROAD_KEYS] = {
    "reference_line_start_u", "reference_line_end_u", "reference_line_increment", "long_section_v_right",
    "long_section_v_left", "long_section_v_increment", "reference_line_start_x", "reference_line_start_y",
    "reference_line_start_z", "reference_line_start_phi", "reference_line_start_b", "reference_line_start_s",
    "reference_line_end_x", "reference_line_end_y", "reference_line_end_z", "reference_line_end_phi",
};

static const char *const mod_keys[MOD_KEYS] = {
    "scale_z_grid", "scale_slope", "scale_banking", "scale_length", "scale_width", "scale_curvature", "grid_nan_mode",
    "grid_nan_offset", "refline_rotcenter_x", "refline_rotcenter_y", "refline_offset_phi", "refline_offset_x",
    "refline_offset_y", "refline_offset_z", "refpoint_u_fraction", "refpoint_u_offset", "refpoint_u",
    "refpoint_v_fraction", "refpoint_v_offset", "refpoint_v", "refpoint_x", "refpoint_y", "refpoint_z", "refpoint_phi",
};

/* Options that would change what lies outside the grid, and the value at which they change nothing here. */
static const struct {
    const char *key;
    double value;
} outside_options[] = {
    {"border_mode_u", 2}, {"border_mode_v", 2}, {"border_offset_u", 0}, {"border_offset_v", 0},
    {"border_smooth_ubeg", 0}, {"border_smooth_uend", 0}, {"refline_continuation", 0},
};

static char lower(char c)
{
    return c >= 'A' && c <= 'Z' ? (char)(c - 'A' + 'a') : c;
}

/* The rest of `text` after `start`, blanks skipped, or NULL; case does not matter. */
static const char *after(const char *text, const char *start)
{
    for (; *start; ++text, ++start)
        if (lower(*text) != lower(*start))
            return NULL;
    return text + strspn(text, " \t");
}

/* As after(), wherever `word` stands in the text. */
static const char *after_word(const char *text, const char *word)
{
    for (; *text; ++text) {
        const char *rest = after(text, word);
        if (rest)
            return rest;
    }
    return NULL;
}

/* Position of `line`'s keyword in keys, or -1; *value points behind the equals sign. */
static int find_key(const char *line, const char *const *keys, int count, const char **value)
{
    for (int i = 0; i < count; ++i) {
        const char *rest = after(line, keys[i]);
        if (rest && *rest == '=') {
            *value = rest + 1;
            return i;
        }
    }
    return -1;
}

static bool read_value(CrgFile *file, const char *line, const char *text, double *value)
{
    if (crg_number(text, strlen(text), value))
        return true;
    return crg_fail(file, "'%s' does not give a number; write it as keyword = 1.25.", line);
}

static bool read_keyword(CrgFile *file, const char *line, const char *const *keys, int count, double *values)
{
    const char *text;
    int i = find_key(line, keys, count, &text);
    return i < 0 || read_value(file, line, text, &values[i]); /* unknown keywords: map projection, other tools' */
}

static bool read_option(CrgFile *file, const char *line)
{
    for (size_t i = 0; i < sizeof outside_options / sizeof *outside_options; ++i) {
        const char *text = after(line, outside_options[i].key);
        double value;
        if (!text || *text != '=')
            continue;
        if (!read_value(file, line, text + 1, &value))
            return false;
        if (value != outside_options[i].value)
            crg_note(file, "option %s = %g is not followed: outside the grid the road keeps its edge value and goes "
                     "straight on.", outside_options[i].key, value);
    }
    return true;
}

static bool add_column(CrgFile *file, const char *line, const char *text)
{
    const char *position = after(text, "at v");
    size_t size;
    Column *grown;
    double v;

    if (position && *position != '=')
        return crg_fail(file, "'%s' lacks its position; write D:long section at v = 1.25,m.", line);
    text = position ? position + 1 : text;
    size = strcspn(text, ",");
    if (!crg_number(text, size, &v) || !after_word(text + size, "m"))
        return crg_fail(file, "'%s' is no column; write D:long section 1,m or D:long section at v = 1.25,m.", line);
    if (file->columns && file->by_number != !position)
        return crg_fail(file, "columns are partly numbered and partly given by v; use one of the two.");
    file->by_number = !position;

    grown = realloc(file->column, (size_t)(file->columns + 1) * sizeof *grown);
    if (!grown)
        return crg_fail(file, "not enough memory for the columns.");
    file->column = grown;
    file->column[file->columns++] = (Column){.v = v, .channel = file->channels};
    return true;
}

static bool add_channel(CrgFile *file, const char *line, const char *text)
{
    const char *rest;

    if ((rest = after_word(text, "long section"))) {
        if (!add_column(file, line, rest))
            return false;
    } else if ((rest = after_word(text, "reference line"))) {
        if (after(rest, "phi"))
            file->phi_channel = file->channels;
        else if (after(rest, "slope"))
            file->slope_channel = file->channels;
        else if (after(rest, "banking"))
            file->banking_channel = file->channels;
        else if (after(rest, "x") || after(rest, "y"))
            file->x_channel = file->channels;
        else if (after(rest, "u"))
            file->u_channel = file->channels;
        else
            return crg_fail(file, "'%s' is not a reference line channel; known are phi, slope, banking, u, x, y.", line);
    }
    file->channels++; /* channels of other kinds are carried along and skipped */
    return true;
}

/* "U:reference line u,m,<start>,<increment>" stands in for the two keywords if they are missing. */
static bool read_independent(CrgFile *file, const char *line, const char *text)
{
    const int target[] = {START_U, INCREMENT};
    const char *rest = after_word(text, "reference line u");

    rest = rest ? strchr(rest, ',') : NULL; /* before the unit */
    rest = rest ? strchr(rest + 1, ',') : NULL;
    for (int i = 0; rest && i < 2; ++i) {
        const char *field = rest + 1;
        double value;
        if (!crg_number(field, strcspn(field, ","), &value))
            return crg_fail(file, "'%s' is no u axis; write U:reference line u,m,0,0.01.", line);
        if (isnan(file->road[target[i]]))
            file->road[target[i]] = value;
        rest = strchr(field, ',');
    }
    return true;
}

static bool read_format(CrgFile *file, const char *line, const char *text)
{
    static const struct {
        const char *name;
        bool binary, wide;
    } formats[] = {{"KRBI", true, false}, {"KDBI", true, true}, {"LRFI", false, false}, {"LDFI", false, true}};

    for (size_t i = 0; i < sizeof formats / sizeof *formats; ++i)
        if (after(text, formats[i].name)) {
            file->binary = formats[i].binary;
            file->wide = formats[i].wide;
            file->has_format = true;
            return true;
        }
    return crg_fail(file, "data format '%s' is not known; use KRBI, KDBI, LRFI or LDFI.", line);
}

static bool read_channel_line(CrgFile *file, const char *line)
{
    const char *text;

    if ((text = after(line, "#:")))
        return read_format(file, line, text);
    if ((text = after(line, "D:")))
        return add_channel(file, line, text);
    if ((text = after(line, "U:")))
        return read_independent(file, line, text);
    return true;
}

static bool read_reference(CrgFile *file, const char *line)
{
    size_t have = strlen(file->reference), more = strcspn(line, " \t");

    if (strchr(line, '$'))
        return crg_fail(file, "'%s' names its file through an environment variable; write the path itself.", line);
    if (have + more >= sizeof file->reference)
        return crg_fail(file, "the path in $ROAD_CRG_FILE is longer than %d characters.", PATH_SIZE - 1);
    memcpy(file->reference + have, line, more);
    file->reference[have + more] = '\0';
    return true;
}

static Block open_block(CrgFile *file, const char *line)
{
    if (after(line, "$ROAD_CRG_MODS")) {
        file->has_mods = file->has_mods || !file->mods_closed;
        return file->mods_closed ? BLOCK_SKIPPED : BLOCK_MODS;
    }
    if (after(line, "$ROAD_CRG_OPTS")) {
        file->has_opts = file->has_opts || !file->opts_closed;
        return file->opts_closed ? BLOCK_SKIPPED : BLOCK_OPTS;
    }
    if (after(line, "$ROAD_CRG_FILE"))
        return BLOCK_FILE;
    if (after(line, "$ROAD_CRG_MPRO"))
        return BLOCK_SKIPPED;
    if (after(line, "$ROAD_CRG"))
        return BLOCK_ROAD;
    if (after(line, "$KD_DEFINITION"))
        return BLOCK_CHANNELS;
    return line[1] == '\0' || line[1] == ' ' || line[1] == '!' ? BLOCK_NONE : BLOCK_SKIPPED;
}

static bool read_line(CrgFile *file, Block block, const char *line)
{
    switch (block) {
    case BLOCK_ROAD:
        return read_keyword(file, line, road_keys, ROAD_KEYS, file->road);
    case BLOCK_MODS:
        return read_keyword(file, line, mod_keys, MOD_KEYS, file->mods);
    case BLOCK_OPTS:
        return read_option(file, line);
    case BLOCK_FILE:
        return read_reference(file, line);
    case BLOCK_CHANNELS:
        return read_channel_line(file, line);
    case BLOCK_NONE:
    case BLOCK_SKIPPED:
        break;
    }
    return true;
}

/* Copies the line without comment and outer blanks; returns its length in the text, line end included. */
static size_t take_line(const char *text, size_t size, char *line, size_t line_size)
{
    const char *end = memchr(text, '\n', size);
    size_t length = end ? (size_t)(end - text) : size, used = length < line_size - 1 ? length : line_size - 1;

    memcpy(line, text, used);
    line[used] = '\0';
    line[strcspn(line, line[0] == '$' ? "\r" : "!\r")] = '\0';
    used = strlen(line);
    while (used > 0 && (line[used - 1] == ' ' || line[used - 1] == '\t'))
        line[--used] = '\0';
    return length + (end != NULL);
}

bool crg_header_read(CrgFile *file, const char *text, size_t size, size_t *data_offset)
{
    char line[1024];
    Block block = BLOCK_NONE;

    file->line = 0;
    for (size_t at = 0; at < size;) {
        at += take_line(text + at, size - at, line, sizeof line);
        file->line++;
        if (after(line, "$$$$")) {
            *data_offset = at;
            return true;
        }
        if (line[0] == '$')
            block = open_block(file, line);
        else if (line[0] != '*' && !read_line(file, block, line + strspn(line, " \t")))
            return false;
    }
    *data_offset = size;
    return true;
}
