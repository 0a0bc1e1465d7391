/* One face for both FMI versions, for the programs that test a model from C: define FACE_FMI as 2 or 3. Statuses are
 * plain numbers, the same in both versions; `env` comes back in face_heard with each message. */
#ifndef FACE_H
#define FACE_H

#include <stdbool.h>
#include <stddef.h>
#include <string.h>
#include "instance.h"

#define STATUS_OK 0
#define STATUS_WARNING 1
#define STATUS_ERROR 3

/* What `--resources=` and `--token=` of the command line say, taken out of the arguments; without them a folder that
 * does not exist, and the token that is compiled in. */
static const char *face_resources = "/no where", *face_token;

static void face_arguments(int *argc, char **argv)
{
    int kept = 1;
    face_token = model_token;
    for (int i = 1; i < *argc; i++) {
        if (strncmp(argv[i], "--resources=", 12) == 0)
            face_resources = argv[i] + 12;
        else if (strncmp(argv[i], "--token=", 8) == 0)
            face_token = argv[i] + 8;
        else
            argv[kept++] = argv[i];
    }
    *argc = kept;
}

/* Provided by the program. */
static void face_heard(void *env, int status, const char *category, const char *message);

#if FACE_FMI == 2
#include "fmi2Functions.h"
typedef fmi2FMUstate StateHandle;
typedef fmi2Byte Byte;
typedef fmi2Boolean Flag;
#define FMI(name) fmi2##name
#define GET_REALS(c, vr, n, values, nValues) fmi2GetReal(c, vr, n, values)
#define SET_REALS(c, vr, n, values, nValues) fmi2SetReal(c, vr, n, values)
#define GET_FLAGS(c, vr, n, values, nValues) fmi2GetBoolean(c, vr, n, values)
#define SET_FLAGS(c, vr, n, values, nValues) fmi2SetBoolean(c, vr, n, values)
#define GET_TEXTS(c, vr, n, values, nValues) fmi2GetString(c, vr, n, values)
#define SET_TEXTS(c, vr, n, values, nValues) fmi2SetString(c, vr, n, values)
#define GET_STATE fmi2GetFMUstate
#define SET_STATE fmi2SetFMUstate
#define FREE_STATE fmi2FreeFMUstate
#define STATE_SIZE fmi2SerializedFMUstateSize
#define WRITE_STATE fmi2SerializeFMUstate
#define READ_STATE fmi2DeSerializeFMUstate

static void face_logger(void *env, fmi2String name, fmi2Status status, fmi2String category, fmi2String message, ...)
{
    (void)name;
    face_heard(env, status, category, message);
}

/* The callbacks have to outlive the instance. */
static void *face_instantiate(const char *name, const char *token, const char *resources, bool logger, bool logging,
                              void *env, fmi2CallbackFunctions *callbacks)
{
    *callbacks = (fmi2CallbackFunctions){.logger = logger ? face_logger : NULL, .componentEnvironment = env};
    return fmi2Instantiate(name, fmi2CoSimulation, token, resources, callbacks, 0, logging);
}

static int face_enter(void *c, double start, bool stop_defined, double stop)
{
    int status = fmi2SetupExperiment(c, 0, 0.0, start, stop_defined, stop);
    return status ? status : (int)fmi2EnterInitializationMode(c);
}

static int face_step(void *c, double t, double h, double *reached)
{
    int status = fmi2DoStep(c, t, h, fmi2False);
    int asked = fmi2GetRealStatus(c, fmi2LastSuccessfulTime, reached);
    return asked > status ? asked : status;
}
#else
#include "fmi3Functions.h"
typedef fmi3FMUState StateHandle;
typedef fmi3Byte Byte;
typedef fmi3Boolean Flag;
typedef int fmi2CallbackFunctions; /* nothing has to outlive an instance of FMI 3 */
#define FMI(name) fmi3##name
#define GET_REALS fmi3GetFloat64
#define SET_REALS fmi3SetFloat64
#define GET_FLAGS fmi3GetBoolean
#define SET_FLAGS fmi3SetBoolean
#define GET_TEXTS fmi3GetString
#define SET_TEXTS fmi3SetString
#define GET_STATE fmi3GetFMUState
#define SET_STATE fmi3SetFMUState
#define FREE_STATE fmi3FreeFMUState
#define STATE_SIZE fmi3SerializedFMUStateSize
#define WRITE_STATE fmi3SerializeFMUState
#define READ_STATE fmi3DeserializeFMUState

static void face_logger(void *env, fmi3Status status, fmi3String category, fmi3String message)
{
    face_heard(env, status, category, message);
}

static void *face_instantiate(const char *name, const char *token, const char *resources, bool logger, bool logging,
                              void *env, fmi2CallbackFunctions *callbacks)
{
    (void)callbacks;
    return fmi3InstantiateCoSimulation(name, token, resources, false, logging, false, false, NULL, 0, env,
                                       logger ? face_logger : NULL, NULL);
}

static int face_enter(void *c, double start, bool stop_defined, double stop)
{
    return fmi3EnterInitializationMode(c, false, 0.0, start, stop_defined, stop);
}

static int face_step(void *c, double t, double h, double *reached)
{
    bool event, end, early;
    int status = fmi3DoStep(c, t, h, false, &event, &end, &early, reached);
    return event || end || early ? STATUS_ERROR : status;
}
#endif

#endif
