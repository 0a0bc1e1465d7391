/* An FMU with a parameter, an input and an output of every type; each output follows its input. Compiled with
 * -DFMI2 or -DFMI3. A value reference is 10 * type + place: 0 parameter, 1 input, 2 output,
 * 3 to 5 an array, 6 to 8 parameter, input and output of an enumeration, 9 time. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { PARAMETER, INPUT, OUTPUT, ARRAY, GEAR_INPUT = 7, GEAR_OUTPUT, TIME, PLACES };
enum { FRESH, SETTING, RUNNING, OVER };
static const char token[] = "{0f4d4f5c-2d33-4c1e-9d6c-5d7a31b7c2aa}";

#ifdef FMI2
#include "fmi2Functions.h"
#define FMI(name) fmi2##name
#define TYPES(X) X(Real, 1) X(Integer, 2) X(Boolean, 0)
#else
#include "fmi3Functions.h"
#define FMI(name) fmi3##name
#define TYPES(X) X(Float64, 1) X(Float32, 1) X(Int8, 2) X(UInt8, 2) X(Int16, 2) X(UInt16, 2) X(Int32, 2) X(UInt32, 2) \
    X(Int64, 2) X(UInt64, 2) X(Boolean, 0)
#endif
#define STATUS FMI(Status)
#define OK FMI(OK)
#define REFUSED FMI(Error)

typedef struct {
    int phase, limited;
    double stop;
#define MEMBER(Name, start) FMI(Name) Name##_[PLACES];
    TYPES(MEMBER)
    char text[PLACES][64];
} Instance;

static void start_over(Instance *i)
{
    memset(i, 0, sizeof *i);
#define START(Name, start) for (int p = 0; p < TIME; p++) i->Name##_[p] = start;
    TYPES(START)
    for (int p = 0; p < PLACES; p++)
        strcpy(i->text[p], "a");
}

static void follow(Instance *i)
{
#define FOLLOW(Name, start) i->Name##_[OUTPUT] = i->Name##_[INPUT]; i->Name##_[GEAR_OUTPUT] = i->Name##_[GEAR_INPUT];
    TYPES(FOLLOW)
    strcpy(i->text[OUTPUT], i->text[INPUT]);
}

static void *made(const char *given)
{
    Instance *i = given && strcmp(given, token) == 0 ? malloc(sizeof *i) : NULL;
    if (i)
        start_over(i);
    return i;
}

static int refuses(Instance *i, int from, int to)
{
    if (i->phase != from)
        return 1;
    i->phase = to;
    return 0;
}

static int stepped(Instance *i, double t, double h)
{
    if (i->phase != RUNNING || (i->limited && t + h > i->stop + 1e-9))
        return 1;
#ifdef FMI2
    (void)t;
#else
    i->Float64_[TIME] = t + h;
#endif
    follow(i);
    return 0;
}

#ifdef FMI2
#define ACCESS void *c, const unsigned vr[], size_t n
#define GET(Name, start) STATUS fmi2Get##Name(ACCESS, fmi2##Name v[]) { Instance *i = c; for (size_t k = 0; k < n; k++) \
    v[k] = i->Name##_[vr[k] % 10]; return OK; }
#define SET(Name, start) STATUS fmi2Set##Name(ACCESS, const fmi2##Name v[]) { Instance *i = c; \
    for (size_t k = 0; k < n; k++) i->Name##_[vr[k] % 10] = v[k]; return OK; }
#define MORE
#else
#define ACCESS void *c, const unsigned vr[], size_t n
#define GET(Name, start) STATUS fmi3Get##Name(ACCESS, fmi3##Name v[], size_t m) { Instance *i = c; size_t at = 0; \
    for (size_t k = 0; k < n; k++) for (int j = 0; j < (vr[k] % 10 == ARRAY ? 3 : 1); j++) { if (at == m) return REFUSED; \
    v[at++] = i->Name##_[vr[k] % 10 + j]; } return at == m ? OK : REFUSED; }
#define SET(Name, start) STATUS fmi3Set##Name(ACCESS, const fmi3##Name v[], size_t m) { Instance *i = c; size_t at = 0; \
    for (size_t k = 0; k < n; k++) for (int j = 0; j < (vr[k] % 10 == ARRAY ? 3 : 1); j++) { if (at == m) return REFUSED; \
    i->Name##_[vr[k] % 10 + j] = v[at++]; } return at == m ? OK : REFUSED; }
#define MORE , size_t m
#endif
TYPES(GET)
TYPES(SET)

STATUS FMI(GetString)(ACCESS, FMI(String) v[] MORE)
{
    for (size_t k = 0; k < n; k++)
        v[k] = ((Instance *)c)->text[vr[k] % 10];
    return OK;
}

STATUS FMI(SetString)(ACCESS, const FMI(String) v[] MORE)
{
    for (size_t k = 0; k < n; k++)
        strncpy(((Instance *)c)->text[vr[k] % 10], v[k], 63);
    return OK;
}

#define STATUS_OF(refused) return (refused) ? REFUSED : OK
STATUS FMI(ExitInitializationMode)(void *c) { follow(c); STATUS_OF(refuses(c, SETTING, RUNNING)); }
STATUS FMI(Terminate)(void *c) { STATUS_OF(refuses(c, RUNNING, OVER)); }
STATUS FMI(Reset)(void *c) { start_over(c); return OK; }
void FMI(FreeInstance)(void *c) { free(c); }
const char *FMI(GetVersion)(void) { return FMI(Version); }

#ifdef FMI2
const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
void *fmi2Instantiate(const char *name, fmi2Type type, const char *guid, const char *where,
                      const fmi2CallbackFunctions *functions, int visible, int logging) { return made(guid); }
STATUS fmi2SetupExperiment(void *c, int with, double tolerance, double start, int limited, double stop)
{
    Instance *i = c;
    i->limited = limited;
    i->stop = stop;
    return OK;
}
STATUS fmi2EnterInitializationMode(void *c) { STATUS_OF(refuses(c, FRESH, SETTING)); }
STATUS fmi2DoStep(void *c, double t, double h, int forward) { STATUS_OF(stepped(c, t, h)); }
#else
void *fmi3InstantiateCoSimulation(const char *name, const char *given, const char *where, bool visible, bool logging,
                                  bool events, bool early, const unsigned vr[], size_t n, void *environment,
                                  fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update)
{
    return made(given);
}
STATUS fmi3EnterInitializationMode(void *c, bool with, double tolerance, double start, bool limited, double stop)
{
    Instance *i = c;
    i->limited = limited;
    i->stop = stop;
    i->Float64_[TIME] = start;
    STATUS_OF(refuses(c, FRESH, SETTING));
}
STATUS fmi3DoStep(void *c, double t, double h, bool forward, bool *event, bool *end, bool *early, double *last)
{
    *event = *end = *early = false;
    *last = t + h;
    STATUS_OF(stepped(c, t, h));
}
#endif
