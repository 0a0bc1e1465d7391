/* Random calls against an FMU, in any order and with any arguments that a careless importer might pass. Linked with a
 * model's sources and the sanitizers (make sanitize). Arguments: seed, number of calls, and texts that string
 * parameters shall get now and then, such as the path of a road. The same seed gives the same calls. Beyond not
 * crashing, it is checked that
 * - a call that fails says why in a declared category, and one that succeeds does not complain;
 * - a refused call leaves the state as it was, bit for bit;
 * - a step that succeeds leaves finite outputs;
 * - serialised bytes that were damaged are refused. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "chance.h"
#include "face.h"

enum { SLOTS = 3, STATES = 3, MANY = 40 };

typedef struct {
    void *c;
    fmi2CallbackFunctions callbacks;
    bool speaks, logging;
    int heard, worst;
    bool undeclared;
    double time, stop; /* where the next step should begin; INFINITY without a stop time */
} Slot;

typedef struct {
    Byte *bytes;
    size_t size;
} Bytes;

static Slot slots[SLOTS];
static StateHandle states[STATES];
static Bytes saved;
static uint64_t calls;

#define FAIL(...)                                                                                                      \
    do {                                                                                                               \
        fprintf(stderr, "FMI %d, call %llu: ", FACE_FMI, (unsigned long long)calls);                                   \
        fprintf(stderr, __VA_ARGS__);                                                                                  \
        fprintf(stderr, "\n");                                                                                         \
        exit(1);                                                                                                       \
    } while (0)

/* --- what is heard ------------------------------------------------------------------------------------------------ */

static void face_heard(void *env, int status, const char *category, const char *message)
{
    Slot *slot = env;
    bool declared = false;
    for (int i = 0; i < MODEL_CATEGORIES; i++)
        declared = declared || (category && strcmp(category, model_categories[i]) == 0);
    slot->undeclared = slot->undeclared || !declared || !message || !*message;
    slot->heard++;
    slot->worst = status > slot->worst ? status : slot->worst;
}

static void judge(Slot *slot, const char *call, int status)
{
    if (status != STATUS_OK && status != STATUS_WARNING && status != STATUS_ERROR)
        FAIL("%s answered %d", call, status);
    if (slot->undeclared)
        FAIL("%s: a message without text or in a category that is not declared", call);
    if (slot->worst > status)
        FAIL("%s answered %d with a message of status %d", call, status, slot->worst);
    if (slot->speaks && status == STATUS_ERROR && slot->worst != STATUS_ERROR)
        FAIL("%s failed without a word", call);
    if (slot->speaks && !slot->logging && status != STATUS_ERROR && slot->heard)
        FAIL("%s spoke while logging was off", call);
    slot->heard = slot->worst = 0;
}

static Bytes bytes_of(Slot *slot)
{
    StateHandle state = NULL;
    Bytes b = {NULL, 0};
    if (GET_STATE(slot->c, &state) || STATE_SIZE(slot->c, state, &b.size) || !(b.bytes = malloc(b.size))
        || WRITE_STATE(slot->c, state, b.bytes, b.size) || FREE_STATE(slot->c, &state))
        FAIL("a state could not be saved");
    return b;
}

/* --- calls ---------------------------------------------------------------------------------------------------- */

static int use_reals(Slot *slot, bool set)
{
    unsigned vr[MANY];
    double values[MANY];
    const size_t n = chance(3) ? below(MANY) : 1 + below(3), n_values = chance(25) ? below(MANY) : n;
    for (size_t i = 0; i < n; i++) {
        vr[i] = some_reference(KIND_REAL);
        values[i] = vr[i] < MODEL_REALS ? some_value(&model_tables[KIND_REAL].rows[vr[i]]) : nasty();
    }
    const unsigned *references = chance(60) ? NULL : vr;
    double *data = chance(60) ? NULL : values;
    (void)n_values;
    return set ? (int)SET_REALS(slot->c, references, n, data, n_values)
               : (int)GET_REALS(slot->c, references, n, data, n_values);
}

static int use_flags(Slot *slot, bool set)
{
    unsigned vr = some_reference(KIND_BOOLEAN);
    Flag value = chance(2);
    return set ? (int)SET_FLAGS(slot->c, &vr, 1, chance(40) ? NULL : &value, 1)
               : (int)GET_FLAGS(slot->c, chance(40) ? NULL : &vr, 1, &value, 1);
}

static int use_texts(Slot *slot, bool set)
{
    unsigned vr = some_reference(KIND_STRING);
    const char *value = some_text();
    return set ? (int)SET_TEXTS(slot->c, &vr, 1, chance(40) ? NULL : &value, 1)
               : (int)GET_TEXTS(slot->c, &vr, 1, &value, 1);
}

static int use_absent(Slot *slot)
{
    const unsigned vr = some_reference(KIND_REAL);
    const size_t n = below(3);
#if FACE_FMI == 2
    fmi2Integer number = 0;
    switch (below(5)) {
    case 0: return fmi2GetInteger(slot->c, &vr, n, &number);
    case 1: return fmi2SetInteger(slot->c, &vr, n, &number);
    case 2: return fmi2CancelStep(slot->c);
    case 3: return fmi2GetRealOutputDerivatives(slot->c, &vr, n, NULL, NULL);
    default: return fmi2SetTime(slot->c, nasty());
    }
#else
    switch (below(5)) {
    case 0: return fmi3GetInt32(slot->c, &vr, n, NULL, n);
    case 1: return fmi3SetUInt64(slot->c, &vr, n, NULL, n);
    case 2: return fmi3EnterConfigurationMode(slot->c);
    case 3: return fmi3GetClock(slot->c, &vr, n, NULL);
    default: return fmi3SetTime(slot->c, nasty());
    }
#endif
}

static int use_logging(Slot *slot)
{
    static const char *const unknown[] = {"logEverything"};
    const bool on = chance(2);
    if (chance(3))
        return FMI(SetDebugLogging)(slot->c, on, 1, chance(4) ? NULL : unknown);
    slot->logging = on;
    return FMI(SetDebugLogging)(slot->c, on, 0, NULL);
}

/* Large steps are long runs and no fault: only those that a stop time forbids are tried. */
static double some_step(const Slot *slot)
{
    static const double steps[] = {0.01, 0.01, 0.01, 0.001, 0.0037, 1e-9};
    if (chance(12))
        return chance(2) ? -0.01 : 0.0 * nasty(); /* 0 or NaN */
    const bool forbidden = fabs(slot->stop) < 1e3 && fabs(slot->time) < 1e3;
    return chance(8) && forbidden ? 1e6 : steps[below(sizeof steps / sizeof *steps)];
}

static void finite_outputs(Slot *slot)
{
    for (unsigned vr = MODEL_OUTPUTS_BEGIN; vr < MODEL_OUTPUTS_END; vr++) {
        double value = NAN;
        if (GET_REALS(slot->c, &vr, 1, &value, 1) || !isfinite(value))
            FAIL("%s is %g after a step", model_tables[KIND_REAL].rows[vr].name, value);
    }
}

static int use_step(Slot *slot)
{
    const double t = chance(15) ? nasty() : slot->time, h = some_step(slot);
    double reached = slot->time;
    const int status = face_step(slot->c, t, h, &reached);
    if (status <= STATUS_WARNING) {
        slot->time = reached;
        finite_outputs(slot);
    }
    return status;
}

static int use_enter(Slot *slot)
{
    const bool ends = chance(2);
    const double start = chance(8) ? nasty() : 0.0, stop = chance(8) ? nasty() : start + 0.3;
    const int status = face_enter(slot->c, start, ends, stop);
    if (status == STATUS_OK) {
        slot->time = start;
        slot->stop = ends ? stop : INFINITY;
    }
    return status;
}

static int use_set_state(Slot *slot, StateHandle state)
{
    const int status = SET_STATE(slot->c, state);
    const unsigned vr = TIME_REFERENCE;
    if (status <= STATUS_WARNING && GET_REALS(slot->c, &vr, 1, &slot->time, 1) == STATUS_OK)
        slot->stop = INFINITY; /* not known here */
    return status;
}

static void keep_bytes(Slot *slot)
{
    free(saved.bytes);
    saved = bytes_of(slot);
}

static int use_bytes(Slot *slot, StateHandle *state)
{
    if (!saved.bytes)
        keep_bytes(slot);
    const size_t place = below(saved.size), size = chance(4) ? below(saved.size) : saved.size;
    const bool whole = chance(3);
    const Byte before = saved.bytes[place];
    if (!whole)
        saved.bytes[place] = (Byte)(before + 1 + below(255));
    const int status = READ_STATE(slot->c, chance(40) ? NULL : saved.bytes, whole ? saved.size : size, state);
    saved.bytes[place] = before;
    if (!whole && status <= STATUS_WARNING && strlen((char *)saved.bytes) > place)
        FAIL("bytes with a damaged token were taken for a state");
    if (!whole && status <= STATUS_WARNING && place >= 64)
        FAIL("bytes damaged at %zu were taken for a state", place);
    return status;
}

static int use_state(Slot *slot)
{
    StateHandle *state = &states[below(STATES)];
    size_t size = 0;
    switch (below(6)) {
    case 0: return GET_STATE(slot->c, chance(30) ? NULL : state);
    case 1: return use_set_state(slot, *state);
    case 2: return FREE_STATE(slot->c, chance(30) ? NULL : state);
    case 3: return STATE_SIZE(slot->c, *state, chance(30) ? NULL : &size);
    case 4: return use_bytes(slot, state);
    default: return WRITE_STATE(slot->c, *state, NULL, below(100));
    }
}

/* One call on an instance. Sets `changes` if even a failing call may change the state: the model was at work. */
static int call(Slot *slot, const char **name, bool *changes)
{
    *changes = false;
    switch (below(16)) {
    case 0: case 1: *name = "get reals"; *changes = true; return use_reals(slot, false);
    case 2: case 3: *name = "set reals"; return use_reals(slot, true);
    case 4: *name = "get Booleans"; *changes = true; return use_flags(slot, false);
    case 5: *name = "set Booleans"; return use_flags(slot, true);
    case 6: *name = "strings"; *changes = true; return use_texts(slot, chance(2));
    case 7: *name = "state"; *changes = true; return use_state(slot);
    case 8: *name = "absent"; return use_absent(slot);
    case 9: *name = "logging"; return use_logging(slot);
    case 10: *name = "enter"; *changes = FACE_FMI == 2; return use_enter(slot); /* two calls there */
    case 11: *name = "exit"; *changes = true; return FMI(ExitInitializationMode)(slot->c);
    case 12:
        if (!chance(6))
            return *name = "step", *changes = true, use_step(slot);
        *name = "terminate";
        return FMI(Terminate)(slot->c);
    case 13:
        if (!chance(4))
            return *name = "step", *changes = true, use_step(slot);
        *name = "reset";
        return FMI(Reset)(slot->c);
    default: *name = "step"; *changes = true; return use_step(slot);
    }
}

static void renew(Slot *slot)
{
    FMI(FreeInstance)(slot->c);
    *slot = (Slot){.speaks = !chance(5), .logging = !chance(3), .stop = INFINITY};
    const char *name = chance(20) ? "" : "fuzz", *token = chance(20) ? "{}" : face_token;
    const char *resources = chance(3) ? some_text() : face_resources;
    slot->c = face_instantiate(name, token, resources, slot->speaks, slot->logging, slot, &slot->callbacks);
    judge(slot, "instantiate", slot->c ? STATUS_OK : STATUS_ERROR);
    if (slot->c && (!*name || token != face_token))
        FAIL("an instance without a name or of another token was made");
}

static void one_call(void)
{
    Slot *slot = &slots[below(SLOTS)];
    if (!slot->c || chance(150)) {
        renew(slot);
        return;
    }
    const bool compare = chance(8);
    Bytes before = compare ? bytes_of(slot) : (Bytes){NULL, 0};
    const char *name;
    bool changes;
    const int status = call(slot, &name, &changes);
    judge(slot, name, status);
    if (compare && status == STATUS_ERROR && !changes) {
        Bytes after = bytes_of(slot);
        if (memcmp(before.bytes, after.bytes, before.size) != 0)
            FAIL("%s was refused and changed the state", name);
        free(after.bytes);
    }
    free(before.bytes);
    if (chance(50))
        keep_bytes(slot);
}

int main(int argc, char **argv)
{
    face_arguments(&argc, argv);
    const uint64_t wanted = argc > 2 ? strtoull(argv[2], NULL, 10) : 100000;
    random_state = (argc > 1 ? strtoull(argv[1], NULL, 10) : 1) * 0x9E3779B97F4A7C15u + 1;
    texts_given = argc > 3 ? argc - 3 : 0;
    texts = argv + 3;
    while (calls < wanted) {
        calls++;
        one_call();
    }
    while (!slots[0].c)
        renew(&slots[0]);
    for (int i = 0; i < STATES; i++)
        FREE_STATE(slots[0].c, &states[i]);
    for (int i = 0; i < SLOTS; i++)
        FMI(FreeInstance)(slots[i].c);
    free(saved.bytes);
    printf("FMI %d: %llu random calls of " MODEL_NAME ", no fault\n", FACE_FMI, (unsigned long long)calls);
    return 0;
}
