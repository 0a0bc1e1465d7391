/* Lives an FMU's life many times over: instantiate, read and write every variable, step, save, serialise, go back,
 * reset, free. Linked with a model's sources, with the sanitizers (make sanitize) or for another platform (make
 * cross); exit code 0 if all went well and going back gave the same bytes. Arguments: --lives=n, --instances=n that
 * are made and freed besides, Name=value for start values, and those of face.h. It ends with the sum of the last life's
 * outputs, for comparison. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "face.h"

enum { STEPS = 20 };
static const double H = 0.01;

#define CHECK(condition)                                                                                               \
    do {                                                                                                               \
        if (!(condition)) {                                                                                            \
            fprintf(stderr, "%s:%d: %s\n", __FILE__, __LINE__, #condition);                                            \
            exit(1);                                                                                                   \
        }                                                                                                              \
    } while (0)

static void face_heard(void *env, int status, const char *category, const char *message)
{
    (void)env;
    if (status > STATUS_WARNING)
        fprintf(stderr, "%d %s: %s\n", status, category, message);
}

/* Values of all variables, by kind. */
typedef struct {
    unsigned *vr[3];
    double *reals;
    Flag *flags;
    const char **texts;
} Buffers;

static Buffers buffers_new(void)
{
    Buffers b;
    for (int kind = 0; kind < 3; kind++) {
        b.vr[kind] = calloc(model_tables[kind].count + 1, sizeof(unsigned));
        for (size_t i = 0; i < model_tables[kind].count; i++)
            b.vr[kind][i] = model_tables[kind].first + (unsigned)i;
    }
    b.reals = calloc(model_tables[KIND_REAL].count + 1, sizeof *b.reals);
    b.flags = calloc(model_tables[KIND_BOOLEAN].count + 1, sizeof *b.flags);
    b.texts = calloc(model_tables[KIND_STRING].count + 1, sizeof *b.texts);
    return b;
}

static void buffers_free(Buffers *b)
{
    for (int kind = 0; kind < 3; kind++)
        free(b->vr[kind]);
    free(b->reals);
    free(b->flags);
    free(b->texts);
}

static bool read_all(void *c, Buffers *b)
{
    const size_t reals = model_tables[KIND_REAL].count, flags = model_tables[KIND_BOOLEAN].count;
    const size_t texts = model_tables[KIND_STRING].count;
    (void)reals, (void)flags, (void)texts; /* FMI 2 names each only once */
    return GET_REALS(c, b->vr[KIND_REAL], reals, b->reals, reals) <= STATUS_WARNING
           && GET_FLAGS(c, b->vr[KIND_BOOLEAN], flags, b->flags, flags) <= STATUS_WARNING
           && GET_TEXTS(c, b->vr[KIND_STRING], texts, b->texts, texts) <= STATUS_WARNING;
}

static const char *setting(const char *name, int n, char **settings)
{
    size_t length = strlen(name);
    for (int i = 1; i < n; i++)
        if (strncmp(settings[i], name, length) == 0 && settings[i][length] == '=')
            return settings[i] + length + 1;
    return NULL;
}

/* Every variable that may be set gets its start value, or the one of the command line. */
static void write_starts(void *c, int n, char **settings)
{
    for (int kind = KIND_REAL; kind <= KIND_STRING; kind++)
        for (size_t i = 0; i < model_tables[kind].count; i++) {
            const VariableInfo *info = &model_tables[kind].rows[i];
            const unsigned vr = model_tables[kind].first + (unsigned)i;
            const char *at = (const char *)&model_start + info->offset, *given = setting(info->name, n, settings);
            const char *text = given ? given : at;
            if (info->role == OUTPUT)
                continue;
            const double real = given && kind == KIND_REAL ? strtod(given, NULL) : 0.0;
            if (kind == KIND_REAL)
                CHECK(SET_REALS(c, &vr, 1, given ? &real : (const double *)at, 1) == STATUS_OK);
            if (kind == KIND_BOOLEAN)
                CHECK(SET_FLAGS(c, &vr, 1, &(Flag){*(const int *)at != 0}, 1) == STATUS_OK);
            if (kind == KIND_STRING)
                CHECK(SET_TEXTS(c, &vr, 1, &text, 1) == STATUS_OK);
        }
}

static bool step(void *c, int k)
{
    double reached;
    return face_step(c, k * H, H, &reached) <= STATUS_WARNING && reached == k * H + H;
}

static void wrong_calls(void *c)
{
    const unsigned none = 123456789u, output = MODEL_OUTPUTS_BEGIN;
    double value = NAN;
    CHECK(GET_REALS(c, &none, 1, &value, 1) == STATUS_ERROR);
    CHECK(SET_REALS(c, &output, 1, &value, 1) == STATUS_ERROR);
    CHECK(!step(c, 1000)); /* not where the instance stands */
    CHECK(face_enter(c, 0.0, false, 0.0) == STATUS_ERROR);
}

static void run(void *c, int from, int to)
{
    for (int k = from; k < to; k++)
        CHECK(step(c, k));
}

static StateHandle through_bytes(void *c, StateHandle state)
{
    size_t size = 0;
    StateHandle copy = NULL;
    CHECK(STATE_SIZE(c, state, &size) == STATUS_OK);
    Byte *bytes = malloc(size);
    CHECK(bytes && WRITE_STATE(c, state, bytes, size) == STATUS_OK);
    CHECK(READ_STATE(c, bytes, size, &copy) == STATUS_OK);
    free(bytes);
    return copy;
}

static void *instance(bool logger, fmi2CallbackFunctions *callbacks)
{
    return face_instantiate("smoke", face_token, face_resources, logger, true, NULL, callbacks);
}

static void live(bool logger, Buffers *now, Buffers *again, int n, char **settings)
{
    fmi2CallbackFunctions callbacks[2];
    void *c = instance(logger, &callbacks[0]);
    CHECK(c);
    write_starts(c, n, settings);
    CHECK(face_enter(c, 0.0, true, 10.0) == STATUS_OK && read_all(c, now)); /* on demand, before the mode is left */
    write_starts(c, n, settings);
    CHECK(FMI(ExitInitializationMode)(c) <= STATUS_WARNING);
    if (!logger)
        wrong_calls(c);
    run(c, 0, STEPS);
    StateHandle saved = NULL;
    CHECK(GET_STATE(c, &saved) == STATUS_OK);
    StateHandle copy = through_bytes(c, saved);
    run(c, STEPS, 2 * STEPS);
    CHECK(read_all(c, now));

    void *other = instance(logger, &callbacks[1]); /* the state moves into an instance that has never run */
    CHECK(other && SET_STATE(other, copy) <= STATUS_WARNING);
    run(other, STEPS, 2 * STEPS);
    CHECK(read_all(other, again));
    CHECK(memcmp(now->reals, again->reals, model_tables[KIND_REAL].count * sizeof(double)) == 0);
    FMI(FreeInstance)(other); /* without termination */

    CHECK(SET_STATE(c, saved) <= STATUS_WARNING && GET_STATE(c, &saved) == STATUS_OK);
    CHECK(FMI(Terminate)(c) == STATUS_OK && FMI(Reset)(c) == STATUS_OK);
    CHECK(face_enter(c, 0.0, true, 10.0) == STATUS_OK && FMI(ExitInitializationMode)(c) <= STATUS_WARNING);
    run(c, 0, 1);
    for (int i = 0; i < 2; i++) /* the second time with NULL */
        CHECK(FREE_STATE(c, &saved) == STATUS_OK && FREE_STATE(c, &copy) == STATUS_OK);
    FMI(FreeInstance)(c);
}

static double sum_of_outputs(const Buffers *b)
{
    double sum = 0.0;
    for (size_t i = MODEL_OUTPUTS_BEGIN; i < MODEL_OUTPUTS_END; i++)
        sum += b->reals[i];
    return sum;
}

int main(int argc, char **argv)
{
    face_arguments(&argc, argv);
    const char *asked = setting("--lives", argc, argv), *more = setting("--instances", argc, argv);
    const int lives = asked ? atoi(asked) : 50, instances = more ? atoi(more) : 0;
    Buffers now = buffers_new(), again = buffers_new();
    fmi2CallbackFunctions callbacks;
    CHECK(!face_instantiate("smoke", "not the token", face_resources, false, false, NULL, &callbacks));
    for (int i = 0; i < lives; i++)
        live(i != 1, &now, &again, argc, argv);
    for (int i = 0; i < instances; i++) {
        void *c = instance(false, &callbacks);
        CHECK(c && !read_all(c, &now)); /* outputs have no value yet */
        FMI(FreeInstance)(c);
    }
    printf("FMI %d: %d lives of " MODEL_NAME " and %d instances more, no fault; outputs add up to %.10g\n", FACE_FMI,
           lives, instances, sum_of_outputs(&again));
    buffers_free(&now);
    buffers_free(&again);
    return 0;
}
