/* An FMU that says what it was told, and misbehaves on demand: for what no well-behaved FMU can show.
 *
 * Value references: 0.. inputs, 100.. outputs (100 + i is i + 1 + number of steps), 200.. echoes of the inputs, 300 the
 * last communication point, 301 the last step size, 400.. orders. Orders that name a step count from 1; 0 is never. */
#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>

enum { FIRST_DAMPER = 3, OUTPUT = 100, ECHO = 200, TIME = 300, STEP = 301, VALUES = 500 };
enum { BAD_AT = 400, BAD_OUTPUT, BAD_VALUE, FAIL_AT, FAIL_STATUS, FAIL_WORDS, STOP_AT, CHATTER };
enum { ABORT_AT = 408, SEGFAULT_AT, HANG_AT, EXIT_AT, HANG_AT_START, ONLY_SOFT };

typedef struct {
    double value[VALUES];
    int steps;
    void *environment, *logger;
} Parrot;

#ifdef FMI2
typedef struct {
    void (*logger)(void *, const char *, int, const char *, const char *, ...);
    void *allocate, *release, *finished, *environment;
} Callbacks;

static void say(Parrot *p, int status, const char *words)
{
    ((void (*)(void *, const char *, int, const char *, const char *, ...))p->logger)(p->environment, "parrot", status,
                                                                                     "all", "%s", words);
}
#else
static void say(Parrot *p, int status, const char *words)
{
    ((void (*)(void *, int, const char *, const char *))p->logger)(p->environment, status, "all", words);
}
#endif

static Parrot *hatch(void *environment, void *logger)
{
    Parrot *p = calloc(1, sizeof *p);
    p->environment = environment;
    p->logger = logger;
    return p;
}

static int get(const Parrot *p, const unsigned vr[], size_t n, double out[])
{
    const double bad[] = {NAN, INFINITY, -INFINITY};
    for (size_t i = 0; i < n; i++) {
        unsigned r = vr[i];
        out[i] = r >= OUTPUT && r < ECHO ? r - OUTPUT + 1.0 + p->steps
                 : r >= ECHO && r < TIME ? p->value[r - ECHO]
                                         : p->value[r];
        if (p->value[BAD_AT] && p->steps >= p->value[BAD_AT] && r == p->value[BAD_OUTPUT])
            out[i] = bad[(int)p->value[BAD_VALUE]];
        if (p->value[BAD_AT] && p->value[BAD_VALUE] == 1 && p->steps >= p->value[BAD_AT] && r == p->value[BAD_OUTPUT] + 1)
            out[i] = -INFINITY; /* so that the sum of all is no number either */
    }
    return 0;
}

static int set(Parrot *p, const unsigned vr[], size_t n, const double in[])
{
    for (size_t i = 0; i < n; i++)
        p->value[vr[i]] = in[i];
    return 0;
}

static void hang(void)
{
    for (volatile int on = 1; on;)
        ;
}

static void die(const Parrot *p)
{
    if (p->value[ONLY_SOFT] && p->value[FIRST_DAMPER])
        return;
    if (p->steps == p->value[ABORT_AT]) {
        fprintf(stderr, "parrot.c: assertion failed: it is only resting\n");
        abort();
    }
    if (p->steps == p->value[SEGFAULT_AT])
        *(volatile int *)(size_t)p->steps = 0;
    if (p->steps == p->value[HANG_AT])
        hang();
    if (p->steps == p->value[EXIT_AT])
        exit(0);
}

static int step(Parrot *p, double t, double h)
{
    p->value[TIME] = t;
    p->value[STEP] = h;
    p->steps++;
    die(p);
    if (p->steps != p->value[FAIL_AT])
        return 0;
    if (p->value[FAIL_WORDS])
        say(p, (int)p->value[FAIL_STATUS], "the parrot fell off its perch");
    return (int)p->value[FAIL_STATUS];
}

static int begin(Parrot *p)
{
    if (p->value[HANG_AT_START])
        hang();
    if (p->value[CHATTER])
        say(p, 0, "the parrot has woken up");
    return 0;
}

#ifdef FMI2
void *fmi2Instantiate(const char *name, int kind, const char *guid, const char *resources, const Callbacks *c, int visible,
                      int logging)
{
    (void)name, (void)kind, (void)guid, (void)resources, (void)visible, (void)logging;
    return hatch(c->environment, (void *)c->logger);
}
void fmi2FreeInstance(void *p) { free(p); }
int fmi2SetupExperiment(void *p, int known, double tolerance, double start, int limited, double stop)
{
    (void)p, (void)known, (void)tolerance, (void)start, (void)limited, (void)stop;
    return 0;
}
int fmi2EnterInitializationMode(void *p) { return (void)p, 0; }
int fmi2ExitInitializationMode(void *p) { return begin(p); }
int fmi2GetReal(void *p, const unsigned vr[], size_t n, double v[]) { return get(p, vr, n, v); }
int fmi2SetReal(void *p, const unsigned vr[], size_t n, const double v[]) { return set(p, vr, n, v); }
int fmi2DoStep(void *p, double t, double h, int forget) { return (void)forget, step(p, t, h); }
#else
void *fmi3InstantiateCoSimulation(const char *name, const char *token, const char *resources, bool visible, bool logging,
                                  bool events, bool early, const unsigned vr[], size_t n, void *environment, void *logger,
                                  void *update)
{
    (void)name, (void)token, (void)resources, (void)visible, (void)logging, (void)events, (void)early, (void)vr, (void)n;
    (void)update;
    return hatch(environment, logger);
}
void fmi3FreeInstance(void *p) { free(p); }
int fmi3EnterInitializationMode(void *p, bool known, double tolerance, double start, bool limited, double stop)
{
    (void)p, (void)known, (void)tolerance, (void)start, (void)limited, (void)stop;
    return 0;
}
int fmi3ExitInitializationMode(void *p) { return begin(p); }
int fmi3GetFloat64(void *p, const unsigned vr[], size_t n, double v[], size_t m) { return (void)m, get(p, vr, n, v); }
int fmi3SetFloat64(void *p, const unsigned vr[], size_t n, const double v[], size_t m)
{
    return (void)m, set(p, vr, n, v);
}
int fmi3DoStep(void *instance, double t, double h, bool forget, bool *event, bool *terminate, bool *early, double *last)
{
    Parrot *p = instance;
    (void)forget;
    int status = step(p, t, h);
    *event = *early = false;
    *terminate = p->steps == p->value[STOP_AT];
    *last = t + h;
    return status;
}
#endif
