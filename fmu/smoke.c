/* Lives an FMU's life many times over, for the address and undefined-behaviour sanitizers (and their leak check):
 * instantiate, read and write every variable, step, save, serialise, go back, reset, free. Linked with a model's sources by
 * `fmu/build.py --sanitize`; exit code 0 if all went well and going back gave the same bytes. Arguments of the
 * form Name=value set variables. It ends with the sum of the last life's outputs, for comparison between platforms. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "instance.h"

#if SMOKE_FMI == 2
#include "fmi2Functions.h"
#else
#include "fmi3Functions.h"
#endif

enum { LIVES = 50, STEPS = 20 };
static const double H = 0.01;

#define CHECK(condition)                                                                                               \
    do {                                                                                                               \
        if (!(condition)) {                                                                                            \
            fprintf(stderr, "%s:%d: %s\n", __FILE__, __LINE__, #condition);                                            \
            exit(1);                                                                                                   \
        }                                                                                                              \
    } while (0)

/* --- one small face for both versions ------------------------------------------------------------------------- */

#if SMOKE_FMI == 2
typedef fmi2FMUstate StateHandle;

static void logger(void *environment, fmi2String name, fmi2Status status, fmi2String category, fmi2String message, ...)
{
    (void)environment;
    if (status > fmi2Warning)
        fprintf(stderr, "%s %d %s: %s\n", name, status, category, message);
}

static void *instantiate(const char *token, bool with_logger)
{
    static fmi2CallbackFunctions callbacks = {.logger = logger};
    return fmi2Instantiate("smoke", fmi2CoSimulation, token, "file:///no%20where", with_logger ? &callbacks : NULL, 0, 1);
}

static bool initialise(void *c)
{
    return fmi2SetupExperiment(c, 0, 0.0, 0.0, 1, 10.0) <= fmi2Warning && fmi2EnterInitializationMode(c) == fmi2OK;
}

static bool step(void *c, int k) { return fmi2DoStep(c, k * H, H, fmi2False) <= fmi2Warning; }

static bool read_all(void *c, double reals[], int booleans[], const char *strings[], const unsigned *vr[3])
{
    return fmi2GetReal(c, vr[0], model_tables[0].count, reals) <= fmi2Warning
           && fmi2GetBoolean(c, vr[1], model_tables[1].count, booleans) <= fmi2Warning
           && fmi2GetString(c, vr[2], model_tables[2].count, strings) <= fmi2Warning;
}

static bool write_real(void *c, unsigned vr, double value) { return fmi2SetReal(c, &vr, 1, &value) == fmi2OK; }
static bool write_string(void *c, unsigned vr, const char *value) { return fmi2SetString(c, &vr, 1, &value) == fmi2OK; }

#define LEAVE(c) (fmi2ExitInitializationMode(c) <= fmi2Warning)
#define TERMINATE fmi2Terminate
#define RESET fmi2Reset
#define FREE fmi2FreeInstance
#define STATE_GET fmi2GetFMUstate
#define STATE_SET fmi2SetFMUstate
#define STATE_FREE fmi2FreeFMUstate
#define STATE_SIZE fmi2SerializedFMUstateSize
#define STATE_WRITE fmi2SerializeFMUstate
#define STATE_READ fmi2DeSerializeFMUstate
typedef fmi2Byte Byte;
#else
typedef fmi3FMUState StateHandle;

static void logger(void *environment, fmi3Status status, fmi3String category, fmi3String message)
{
    (void)environment;
    if (status > fmi3Warning)
        fprintf(stderr, "%d %s: %s\n", status, category, message);
}

static void *instantiate(const char *token, bool with_logger)
{
    return fmi3InstantiateCoSimulation("smoke", token, "/no where", false, true, false, false, NULL, 0, NULL,
                                       with_logger ? logger : NULL, NULL);
}

static bool initialise(void *c) { return fmi3EnterInitializationMode(c, false, 0.0, 0.0, true, 10.0) <= fmi3Warning; }

static bool step(void *c, int k)
{
    bool event, end, early;
    double last;
    return fmi3DoStep(c, k * H, H, false, &event, &end, &early, &last) <= fmi3Warning && last == k * H + H;
}

static bool read_all(void *c, double reals[], int booleans[], const char *strings[], const unsigned *vr[3])
{
    bool values[MODEL_STRING_SIZE];
    size_t n = model_tables[1].count;
    CHECK(n <= MODEL_STRING_SIZE);
    bool fine = fmi3GetFloat64(c, vr[0], model_tables[0].count, reals, model_tables[0].count) <= fmi3Warning
                && fmi3GetBoolean(c, vr[1], n, values, n) <= fmi3Warning
                && fmi3GetString(c, vr[2], model_tables[2].count, strings, model_tables[2].count) <= fmi3Warning;
    for (size_t i = 0; i < n; i++)
        booleans[i] = fine && values[i];
    return fine;
}

static bool write_real(void *c, unsigned vr, double value) { return fmi3SetFloat64(c, &vr, 1, &value, 1) == fmi3OK; }
static bool write_string(void *c, unsigned vr, const char *v) { return fmi3SetString(c, &vr, 1, &v, 1) == fmi3OK; }

#define LEAVE(c) (fmi3ExitInitializationMode(c) <= fmi3Warning)
#define TERMINATE fmi3Terminate
#define RESET fmi3Reset
#define FREE fmi3FreeInstance
#define STATE_GET fmi3GetFMUState
#define STATE_SET fmi3SetFMUState
#define STATE_FREE fmi3FreeFMUState
#define STATE_SIZE fmi3SerializedFMUStateSize
#define STATE_WRITE fmi3SerializeFMUState
#define STATE_READ fmi3DeserializeFMUState
typedef fmi3Byte Byte;
#endif

/* --- the life ---------------------------------------------------------------------------------------------------- */

typedef struct {
    unsigned *vr[3];
    double *reals;
    int *booleans;
    const char **strings;
} Buffers;

static Buffers buffers_new(void)
{
    Buffers b;
    for (int kind = 0; kind < 3; kind++) {
        b.vr[kind] = calloc(model_tables[kind].count + 1, sizeof(unsigned));
        for (size_t i = 0; i < model_tables[kind].count; i++)
            b.vr[kind][i] = model_tables[kind].first + (unsigned)i;
    }
    b.reals = calloc(model_tables[0].count + 1, sizeof *b.reals);
    b.booleans = calloc(model_tables[1].count + 1, sizeof *b.booleans);
    b.strings = calloc(model_tables[2].count + 1, sizeof *b.strings);
    return b;
}

static void buffers_free(Buffers *b)
{
    for (int kind = 0; kind < 3; kind++)
        free(b->vr[kind]);
    free(b->reals);
    free(b->booleans);
    free(b->strings);
}

static bool read_into(void *c, Buffers *b)
{
    return read_all(c, b->reals, b->booleans, b->strings, (const unsigned **)b->vr);
}

static const char *setting(const VariableInfo *info, int n, char **settings)
{
    size_t length = strlen(info->name);
    for (int i = 1; i < n; i++)
        if (strncmp(settings[i], info->name, length) == 0 && settings[i][length] == '=')
            return settings[i] + length + 1;
    return NULL;
}

/* Every variable that may be set gets its start value. */
static void write_starts(void *c, int n, char **settings)
{
    for (size_t i = 0; i < model_tables[KIND_REAL].count; i++) {
        const VariableInfo *info = &model_tables[KIND_REAL].rows[i];
        unsigned vr = model_tables[KIND_REAL].first + (unsigned)i;
        const char *given = setting(info, n, settings);
        const double start = *(const double *)((const char *)&model_start + info->offset);
        if (info->role != OUTPUT)
            CHECK(write_real(c, vr, given ? strtod(given, NULL) : start));
    }
    for (size_t i = 0; i < model_tables[KIND_STRING].count; i++) {
        const VariableInfo *info = &model_tables[KIND_STRING].rows[i];
        const char *given = setting(info, n, settings);
        if (info->role != OUTPUT)
            CHECK(write_string(c, model_tables[KIND_STRING].first + (unsigned)i,
                               given ? given : (const char *)&model_start + info->offset));
    }
}

static void wrong_calls(void *c)
{
    double value = 0.0;
    CHECK(!write_real(c, 123456789u, value)); /* no such variable */
    CHECK(!write_real(c, 0, NAN));
    CHECK(!step(c, 1000)); /* not where the instance stands */
    CHECK(!initialise(c));
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
    CHECK(STATE_SIZE(c, state, &size) == 0);
    Byte *bytes = malloc(size);
    CHECK(bytes && STATE_WRITE(c, state, bytes, size) == 0);
    CHECK(STATE_READ(c, bytes, size, &copy) == 0);
    free(bytes);
    return copy;
}

static void live(bool with_logger, Buffers *now, Buffers *again, int n, char **settings)
{
    void *c = instantiate(model_token, with_logger);
    CHECK(c);
    write_starts(c, n, settings);
    CHECK(initialise(c) && read_into(c, now)); /* outputs on demand, before the mode is left */
    write_starts(c, n, settings);
    CHECK(LEAVE(c));
    if (!with_logger)
        wrong_calls(c);
    run(c, 0, STEPS);
    StateHandle saved = NULL;
    CHECK(STATE_GET(c, &saved) == 0);
    StateHandle copy = through_bytes(c, saved);
    run(c, STEPS, 2 * STEPS);
    CHECK(read_into(c, now));

    void *other = instantiate(model_token, with_logger); /* the state moves into an instance that has never run */
    CHECK(other && STATE_SET(other, copy) == 0);
    run(other, STEPS, 2 * STEPS);
    CHECK(read_into(other, again));
    CHECK(memcmp(now->reals, again->reals, model_tables[0].count * sizeof(double)) == 0);
    FREE(other); /* without termination */

    CHECK(STATE_SET(c, saved) == 0 && STATE_GET(c, &saved) == 0);
    CHECK(TERMINATE(c) == 0 && RESET(c) == 0 && initialise(c) && LEAVE(c));
    run(c, 0, 1);
    CHECK(STATE_FREE(c, &saved) == 0 && STATE_FREE(c, &copy) == 0 && STATE_FREE(c, &copy) == 0);
    FREE(c);
}

int main(int argc, char **argv)
{
    Buffers now = buffers_new(), again = buffers_new();
    CHECK(!instantiate("not the token", false));
    for (int i = 0; i < LIVES; i++)
        live(i != 1, &now, &again, argc, argv);
    double sum = 0.0;
    for (size_t i = 0; i < model_tables[KIND_REAL].count; i++)
        if (model_tables[KIND_REAL].rows[i].role == OUTPUT)
            sum += again.reals[i];
    buffers_free(&now);
    buffers_free(&again);
    printf("FMI %d: %d lives of " MODEL_NAME ", no fault; outputs add up to %.10g\n", SMOKE_FMI, LIVES, sum);
    return 0;
}
