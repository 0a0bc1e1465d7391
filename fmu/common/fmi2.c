/* FMI 2.0 for Co-Simulation: the standard's names and types for what instance.h does. */
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"
#include "instance.h"

/* Each entry point is one expression of a checked instance `i` and its own name. */
#define ENTRY(expression)                                                                                              \
    do {                                                                                                               \
        Instance *i = c;                                                                                               \
        return i ? (fmi2Status)(expression) : fmi2Error;                                                               \
    } while (0)

const char message_escapes[] = "%#"; /* FMI 2 reads a message as a printf format with #r1# for variable references */

void deliver(const Instance *instance, ModelStatus status, const char *category, const char *message)
{
    fmi2CallbackLogger logger = (fmi2CallbackLogger)instance->logger;
    logger(instance->environment, instance->name, (fmi2Status)status, category, message);
}

const char *fmi2GetTypesPlatform(void) { return fmi2TypesPlatform; }
const char *fmi2GetVersion(void) { return fmi2Version; }

static int hex_digit(char c)
{
    if (c >= '0' && c <= '9') return c - '0';
    if (c >= 'a' && c <= 'f') return c - 'a' + 10;
    if (c >= 'A' && c <= 'F') return c - 'A' + 10;
    return -1;
}

/* "file:///a%20b" or "file:/a%20b" -> "/a b"; a plain path stays as it is. In place. */
static void uri_to_path(char *text)
{
    if (strncmp(text, "file:", 5) != 0)
        return;
    const char *from = text + 5;
    if (strncmp(from, "//", 2) == 0) { /* the authority: empty or localhost */
        from = strchr(from + 2, '/');
        if (!from)
            from = "";
    }
#ifdef _WIN32
    if (from[0] == '/' && from[1] && from[2] == ':')
        from++; /* /C:/dir */
#endif
    char *to = text;
    for (; *from; from++) {
        int high = *from == '%' ? hex_digit(from[1]) : -1;
        int low = high >= 0 ? hex_digit(from[2]) : -1;
        *to++ = low >= 0 ? (char)(16 * high + low) : *from;
        from += low >= 0 ? 2 : 0;
    }
    *to = '\0';
}

fmi2Component fmi2Instantiate(fmi2String instanceName, fmi2Type fmuType, fmi2String fmuGUID,
                              fmi2String fmuResourceLocation, const fmi2CallbackFunctions *functions,
                              fmi2Boolean visible, fmi2Boolean loggingOn)
{
    (void)visible;
    fmi2CallbackLogger logger = functions ? functions->logger : NULL;
    Instance *i = instance_new(instanceName, fmuResourceLocation, (void (*)(void))logger,
                               functions ? functions->componentEnvironment : NULL, loggingOn);
    if (!i)
        return NULL;
    uri_to_path(i->resources);
    strip_separator(i->resources);
    ModelStatus status = instance_load(i);
    if (status != MODEL_ERROR)
        status = check_identity(i, instanceName, fmuGUID);
    if (status == MODEL_OK && fmuType != fmi2CoSimulation)
        status = refuse(i, MODEL_NAME " cannot be instantiated for model exchange: it is for co-simulation only.");
    if (status == MODEL_OK)
        return i;
    instance_free(i);
    return NULL;
}

void fmi2FreeInstance(fmi2Component c) { instance_free(c); }

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean loggingOn, size_t nCategories,
                               const fmi2String categories[])
{
    ENTRY(set_logging(i, __func__, loggingOn, loggingOn ? nCategories : 0, categories)); /* off means all off */
}

fmi2Status fmi2SetupExperiment(fmi2Component c, fmi2Boolean toleranceDefined, fmi2Real tolerance, fmi2Real startTime,
                               fmi2Boolean stopTimeDefined, fmi2Real stopTime)
{
    (void)toleranceDefined, (void)tolerance; /* the step inside the model is fixed */
    ENTRY(setup_experiment(i, __func__, startTime, stopTimeDefined, stopTime));
}

static ModelStatus enter_initialization(Instance *i, const char *function)
{
    if (check_phase(i, function, INSTANTIATED))
        return MODEL_ERROR;
    if (!i->progress.experiment_set)
        return refuse(i, "%s was called before fmi2SetupExperiment.", function);
    i->progress.phase = INITIALIZATION;
    return MODEL_OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) { ENTRY(enter_initialization(i, __func__)); }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { ENTRY(exit_initialization(i, __func__)); }
fmi2Status fmi2Terminate(fmi2Component c) { ENTRY(terminate(i, __func__)); }
fmi2Status fmi2Reset(fmi2Component c) { ENTRY(reset(i)); }

/* --- variables ----------------------------------------------------------------------------------------------- */

#define REFERENCES const fmi2ValueReference vr[], size_t nvr

fmi2Status fmi2GetReal(fmi2Component c, REFERENCES, fmi2Real value[]) { ENTRY(get_reals(i, __func__, vr, nvr, value)); }

fmi2Status fmi2SetReal(fmi2Component c, REFERENCES, const fmi2Real value[])
{
    ENTRY(set_reals(i, __func__, vr, nvr, value));
}

#define GETTER(Name, kind, expression)                                                                                 \
    fmi2Status fmi2Get##Name(fmi2Component c, REFERENCES, fmi2##Name value[])                                          \
    {                                                                                                                  \
        ModelStatus status = c ? check_get(c, __func__, kind, vr, nvr, value) : MODEL_ERROR;                           \
        for (size_t k = 0; k < nvr && status != MODEL_ERROR; k++)                                                      \
            value[k] = expression;                                                                                     \
        return (fmi2Status)status;                                                                                     \
    }

#define SETTER(Name, kind, statement)                                                                                  \
    fmi2Status fmi2Set##Name(fmi2Component c, REFERENCES, const fmi2##Name value[])                                    \
    {                                                                                                                  \
        ModelStatus status = c ? check_set(c, __func__, kind, vr, nvr, value) : MODEL_ERROR;                           \
        for (size_t k = 0; k < nvr && status != MODEL_ERROR; k++)                                                      \
            statement;                                                                                                 \
        return (fmi2Status)status;                                                                                     \
    }

GETTER(Boolean, KIND_BOOLEAN, *(int *)value_of(c, KIND_BOOLEAN, vr[k]) ? fmi2True : fmi2False)
GETTER(String, KIND_STRING, value_of(c, KIND_STRING, vr[k]))
SETTER(Boolean, KIND_BOOLEAN, *(int *)value_of(c, KIND_BOOLEAN, vr[k]) = value[k] != fmi2False)
SETTER(String, KIND_STRING, set_string(c, vr[k], value[k]))

/* --- saved states -------------------------------------------------------------------------------------------- */

fmi2Status fmi2GetFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) { ENTRY(state_get(i, __func__, FMUstate)); }
fmi2Status fmi2SetFMUstate(fmi2Component c, fmi2FMUstate FMUstate) { ENTRY(state_set(i, __func__, FMUstate)); }
fmi2Status fmi2FreeFMUstate(fmi2Component c, fmi2FMUstate *FMUstate) { ENTRY(state_free(i, __func__, FMUstate)); }

fmi2Status fmi2SerializedFMUstateSize(fmi2Component c, fmi2FMUstate FMUstate, size_t *size)
{
    ENTRY(state_size(i, __func__, FMUstate, size));
}

fmi2Status fmi2SerializeFMUstate(fmi2Component c, fmi2FMUstate FMUstate, fmi2Byte bytes[], size_t size)
{
    ENTRY(state_serialize(i, __func__, FMUstate, bytes, size));
}

fmi2Status fmi2DeSerializeFMUstate(fmi2Component c, const fmi2Byte bytes[], size_t size, fmi2FMUstate *FMUstate)
{
    ENTRY(state_deserialize(i, __func__, bytes, size, FMUstate));
}

/* --- steps --------------------------------------------------------------------------------------------------- */

fmi2Status fmi2DoStep(fmi2Component c, fmi2Real currentCommunicationPoint, fmi2Real communicationStepSize,
                      fmi2Boolean noSetFMUStatePriorToCurrentPoint)
{
    (void)noSetFMUStatePriorToCurrentPoint; /* going back costs nothing here */
    ENTRY(do_step(i, __func__, currentCommunicationPoint, communicationStepSize));
}

#define STATUS(Name, fmi2Type, kind, expression)                                                                       \
    fmi2Status fmi2Get##Name##Status(fmi2Component c, const fmi2StatusKind s, fmi2Type *value)                         \
    {                                                                                                                  \
        const Instance *i = c;                                                                                         \
        if (i && s == kind && value)                                                                                   \
            return *value = expression, fmi2OK;                                                                        \
        return i ? fmi2Discard : fmi2Error;                                                                            \
    }

STATUS(Real, fmi2Real, fmi2LastSuccessfulTime, i->progress.time)
STATUS(Boolean, fmi2Boolean, fmi2Terminated, fmi2False) /* the model never asks for an end */
STATUS(, fmi2Status, fmi2DoStepStatus, i->progress.phase == FAILED ? fmi2Error : fmi2OK)
STATUS(String, fmi2String, fmi2PendingStatus, "") /* steps are synchronous: nothing is ever pending */

/* --- what the capability flags say is absent: no argument is looked at -------------------------------------------- */

#pragma GCC diagnostic ignored "-Wunused-parameter"

#define ABSENT(name, arguments, reason)                                                                                \
    fmi2Status name arguments { ENTRY(refuse(i, "%s is not available: " reason, __func__)); }

static ModelStatus no_integers(const Instance *i, const char *function, size_t n)
{
    return n ? refuse(i, "%s: " MODEL_NAME " has no integer variables.", function) : MODEL_OK;
}

fmi2Status fmi2GetInteger(fmi2Component c, REFERENCES, fmi2Integer value[]) { ENTRY(no_integers(i, __func__, nvr)); }
fmi2Status fmi2SetInteger(fmi2Component c, REFERENCES, const fmi2Integer value[])
{
    ENTRY(no_integers(i, __func__, nvr));
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind s, fmi2Integer *value)
{
    return c ? fmi2Discard : fmi2Error;
}

ABSENT(fmi2CancelStep, (fmi2Component c), "steps are synchronous.")
ABSENT(fmi2SetRealInputDerivatives, (fmi2Component c, REFERENCES, const fmi2Integer order[], const fmi2Real value[]),
       "inputs are held over a step.")
ABSENT(fmi2GetRealOutputDerivatives, (fmi2Component c, REFERENCES, const fmi2Integer order[], fmi2Real value[]),
       "maxOutputDerivativeOrder is 0.")
ABSENT(fmi2GetDirectionalDerivative,
       (fmi2Component c, const fmi2ValueReference vUnknown[], size_t nUnknown, const fmi2ValueReference vKnown[],
        size_t nKnown, const fmi2Real dvKnown[], fmi2Real dvUnknown[]),
       "providesDirectionalDerivative is false.")

ABSENT(fmi2EnterEventMode, (fmi2Component c), ONLY_CO_SIMULATION)
ABSENT(fmi2NewDiscreteStates, (fmi2Component c, fmi2EventInfo *info), ONLY_CO_SIMULATION)
ABSENT(fmi2EnterContinuousTimeMode, (fmi2Component c), ONLY_CO_SIMULATION)
ABSENT(fmi2CompletedIntegratorStep,
       (fmi2Component c, fmi2Boolean noSetPrior, fmi2Boolean *enterEventMode, fmi2Boolean *terminateSimulation),
       ONLY_CO_SIMULATION)
ABSENT(fmi2SetTime, (fmi2Component c, fmi2Real time), ONLY_CO_SIMULATION)
ABSENT(fmi2SetContinuousStates, (fmi2Component c, const fmi2Real x[], size_t nx), ONLY_CO_SIMULATION)
ABSENT(fmi2GetDerivatives, (fmi2Component c, fmi2Real derivatives[], size_t nx), ONLY_CO_SIMULATION)
ABSENT(fmi2GetEventIndicators, (fmi2Component c, fmi2Real indicators[], size_t ni), ONLY_CO_SIMULATION)
ABSENT(fmi2GetContinuousStates, (fmi2Component c, fmi2Real x[], size_t nx), ONLY_CO_SIMULATION)
ABSENT(fmi2GetNominalsOfContinuousStates, (fmi2Component c, fmi2Real nominals[], size_t nx), ONLY_CO_SIMULATION)
