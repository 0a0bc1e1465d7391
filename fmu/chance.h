/* What fuzz.c draws: numbers, values near and far from a variable's range, references, texts. */
#ifndef CHANCE_H
#define CHANCE_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include "table.h"

static uint64_t random_state; /* never 0 */
static int texts_given;       /* by the command line, beside those of the pool below */
static char **texts;

static uint64_t draw(void) /* xorshift64* */
{
    random_state ^= random_state >> 12;
    random_state ^= random_state << 25;
    random_state ^= random_state >> 27;
    return random_state * 2685821657736338717u;
}

static size_t below(size_t n) { return (size_t)(draw() >> 33) % n; }
static bool chance(size_t one_in) { return below(one_in) == 0; }
static double unit_interval(void) { return (double)(draw() >> 11) / 9007199254740992.0; }

static double nasty(void)
{
    static const double values[] = {0.0, -0.0, 1.0, -1.0, 1e-320, 1e-12, 1e6, 1e18, -1e18, 1e308, -1e308};
    if (chance(4))
        return chance(2) ? NAN : chance(2) ? INFINITY : -INFINITY;
    return values[below(sizeof values / sizeof *values)];
}

/* Mostly near the start value or anywhere in the range, sometimes nonsense. */
static double some_value(const VariableInfo *info)
{
    const double start = *(const double *)((const char *)&model_start + info->offset);
    if (chance(12))
        return nasty();
    if (chance(3) && isfinite(info->min) && isfinite(info->max))
        return info->min + unit_interval() * (info->max - info->min);
    if (chance(6))
        return start * pow(10.0, 4.0 * unit_interval() - 2.0);
    return start * (0.9 + 0.2 * unit_interval()) + (chance(4) ? 0.2 * unit_interval() - 0.1 : 0.0);
}

static unsigned some_reference(Kind kind)
{
    const VariableTable *table = &model_tables[kind];
    if (chance(30))
        return (unsigned)draw();
    if (chance(30))
        return TIME_REFERENCE;
    const size_t n = table->count + (chance(20) ? 2 : 0);
    return table->first + (unsigned)(n ? below(n) : 0);
}

static const char *some_text(void)
{
    static char longer[4096];
    static const char *const pool[] = {
        "", "none.crg", "\xff\xfe\x01", "%s%n%n #1# %d", "../..", "/dev/null", "/", "file:///a%20b%zz%0", "file://",
    };
    if (texts_given && chance(3))
        return texts[below((size_t)texts_given)];
    if (chance(8)) {
        memset(longer, 'x', sizeof longer - 1);
        longer[chance(2) ? MODEL_STRING_SIZE - 1 : below(sizeof longer - 1)] = '\0';
        return longer;
    }
    return chance(10) ? NULL : pool[below(sizeof pool / sizeof *pool)];
}

#endif
