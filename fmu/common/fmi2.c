/* FMI 2.0 for Co-Simulation: the standard's names and types for what instance.h does. */
#include <stdlib.h>
#include <string.h>

#include "fmi2Functions.h"
#include "instance.h"

/* Each entry point is one expression of a checked instance `i` and its own name. */
#define ENTRY(expression)                                                                                              \
    do {                                                                                                               \
        Instance *i = c;                                                                                               \
        return i ? to_fmi(expression) : fmi2Error;                                                                     \
    } while (0)
#define NOT_HERE(reason) ENTRY(refuse(i, "%s is not available: " reason, __func__))
#define NO_MODEL_EXCHANGE NOT_HERE("this FMU is for co-simulation only.")

static fmi2Status to_fmi(ModelStatus status)
{
    return status == MODEL_OK ? fmi2OK : status == MODEL_WARNING ? fmi2Warning : fmi2Error;
}

/* FMI 2 reads the message as a printf format with #r1# for variable references: both signs are doubled. */
void deliver(const Instance *instance, ModelStatus status, const char *category, const char *message)
{
    fmi2CallbackLogger logger = (fmi2CallbackLogger)instance->logger;
    char escaped[4096];
    size_t n = 0;
    if (!logger)
        return;
    for (; *message && n < sizeof escaped - 2; message++) {
        if (*message == '%' || *message == '#')
            escaped[n++] = *message;
        escaped[n++] = *message;
    }
    escaped[n] = '\0';
    logger(instance->environment, instance->name, to_fmi(status), category, escaped);
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
    ModelStatus status = check_identity(i, instanceName, fmuGUID);
    if (status == MODEL_OK && fmuType != fmi2CoSimulation)
        status = refuse(i, MODEL_NAME " cannot be instantiated for model exchange: it is for co-simulation only.");
    if (status == MODEL_OK)
        return i;
    instance_free(i);
    return NULL;
}

void fmi2FreeInstance(fmi2Component c) { instance_free(c); }

fmi2Status fmi2SetDebugLogging(fmi2Component c, fmi2Boolean loggingOn, size_t nCategories, const fmi2String categories[])
{
    ENTRY(set_logging(i, __func__, loggingOn, nCategories, categories));
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

static ModelStatus terminate(Instance *i, const char *function)
{
    if (check_phase(i, function, STEPPING | FAILED))
        return MODEL_ERROR;
    i->progress.phase = TERMINATED;
    return MODEL_OK;
}

fmi2Status fmi2EnterInitializationMode(fmi2Component c) { ENTRY(enter_initialization(i, __func__)); }
fmi2Status fmi2ExitInitializationMode(fmi2Component c) { ENTRY(exit_initialization(i, __func__)); }
fmi2Status fmi2Terminate(fmi2Component c) { ENTRY(terminate(i, __func__)); }
fmi2Status fmi2Reset(fmi2Component c) { ENTRY(reset(i, __func__)); }

/* --- variables ----------------------------------------------------------------------------------------------- */

#define GETTER(Name, kind, expression)                                                                                 \
    fmi2Status fmi2Get##Name(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2##Name value[])           \
    {                                                                                                                  \
        ModelStatus status = c ? check_get(c, __func__, kind, vr, nvr) : MODEL_ERROR;                                  \
        for (size_t k = 0; k < nvr && status != MODEL_ERROR; k++)                                                      \
            value[k] = expression;                                                                                     \
        return to_fmi(status);                                                                                         \
    }

#define SETTER(Name, kind, statement)                                                                                  \
    fmi2Status fmi2Set##Name(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2##Name value[])     \
    {                                                                                                                  \
        ModelStatus status = c ? check_set(c, __func__, kind, vr, nvr, value) : MODEL_ERROR;                           \
        for (size_t k = 0; k < nvr && status != MODEL_ERROR; k++)                                                      \
            statement;                                                                                                 \
        return to_fmi(status);                                                                                         \
    }

GETTER(Real, KIND_REAL, *(double *)value_of(c, KIND_REAL, vr[k]))
GETTER(Boolean, KIND_BOOLEAN, *(int *)value_of(c, KIND_BOOLEAN, vr[k]) ? fmi2True : fmi2False)
GETTER(String, KIND_STRING, value_of(c, KIND_STRING, vr[k]))
SETTER(Real, KIND_REAL, *(double *)value_of(c, KIND_REAL, vr[k]) = value[k])
SETTER(Boolean, KIND_BOOLEAN, *(int *)value_of(c, KIND_BOOLEAN, vr[k]) = value[k] != fmi2False)
SETTER(String, KIND_STRING, set_string(c, vr[k], value[k]))

static ModelStatus no_integers(Instance *i, const char *function, size_t n)
{
    return n ? refuse(i, "%s: " MODEL_NAME " has no integer variables.", function) : MODEL_OK;
}

fmi2Status fmi2GetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, fmi2Integer value[])
{
    (void)vr, (void)value;
    ENTRY(no_integers(i, __func__, nvr));
}

fmi2Status fmi2SetInteger(fmi2Component c, const fmi2ValueReference vr[], size_t nvr, const fmi2Integer value[])
{
    (void)vr, (void)value;
    ENTRY(no_integers(i, __func__, nvr));
}

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

fmi2Status fmi2GetRealStatus(fmi2Component c, const fmi2StatusKind s, fmi2Real *value)
{
    if (!c || s != fmi2LastSuccessfulTime)
        return c ? fmi2Discard : fmi2Error;
    *value = ((Instance *)c)->progress.time;
    return fmi2OK;
}

fmi2Status fmi2GetBooleanStatus(fmi2Component c, const fmi2StatusKind s, fmi2Boolean *value)
{
    if (!c || s != fmi2Terminated)
        return c ? fmi2Discard : fmi2Error;
    *value = fmi2False; /* the model never asks for an end */
    return fmi2OK;
}

fmi2Status fmi2GetStatus(fmi2Component c, const fmi2StatusKind s, fmi2Status *value)
{
    if (!c || s != fmi2DoStepStatus)
        return c ? fmi2Discard : fmi2Error;
    *value = ((Instance *)c)->progress.phase == FAILED ? fmi2Error : fmi2OK;
    return fmi2OK;
}

fmi2Status fmi2GetIntegerStatus(fmi2Component c, const fmi2StatusKind s, fmi2Integer *value)
{
    (void)s, (void)value;
    return c ? fmi2Discard : fmi2Error;
}

fmi2Status fmi2GetStringStatus(fmi2Component c, const fmi2StatusKind s, fmi2String *value)
{
    (void)s, (void)value;
    return c ? fmi2Discard : fmi2Error;
}

fmi2Status fmi2CancelStep(fmi2Component c) { NOT_HERE("steps are synchronous."); }

/* --- what the capability flags say is absent ------------------------------------------------------------------- */

fmi2Status fmi2SetRealInputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                       const fmi2Integer order[], const fmi2Real value[])
{
    (void)vr, (void)nvr, (void)order, (void)value;
    NOT_HERE("inputs are held over a step.");
}

fmi2Status fmi2GetRealOutputDerivatives(fmi2Component c, const fmi2ValueReference vr[], size_t nvr,
                                        const fmi2Integer order[], fmi2Real value[])
{
    (void)vr, (void)nvr, (void)order, (void)value;
    NOT_HERE("maxOutputDerivativeOrder is 0.");
}

fmi2Status fmi2GetDirectionalDerivative(fmi2Component c, const fmi2ValueReference vUnknown_ref[], size_t nUnknown,
                                        const fmi2ValueReference vKnown_ref[], size_t nKnown, const fmi2Real dvKnown[],
                                        fmi2Real dvUnknown[])
{
    (void)vUnknown_ref, (void)nUnknown, (void)vKnown_ref, (void)nKnown, (void)dvKnown, (void)dvUnknown;
    NOT_HERE("providesDirectionalDerivative is false.");
}

fmi2Status fmi2EnterEventMode(fmi2Component c) { NO_MODEL_EXCHANGE; }
fmi2Status fmi2NewDiscreteStates(fmi2Component c, fmi2EventInfo *info) { (void)info; NO_MODEL_EXCHANGE; }
fmi2Status fmi2EnterContinuousTimeMode(fmi2Component c) { NO_MODEL_EXCHANGE; }
fmi2Status fmi2SetTime(fmi2Component c, fmi2Real time) { (void)time; NO_MODEL_EXCHANGE; }

fmi2Status fmi2CompletedIntegratorStep(fmi2Component c, fmi2Boolean noSetFMUStatePriorToCurrentPoint,
                                       fmi2Boolean *enterEventMode, fmi2Boolean *terminateSimulation)
{
    (void)noSetFMUStatePriorToCurrentPoint, (void)enterEventMode, (void)terminateSimulation;
    NO_MODEL_EXCHANGE;
}

fmi2Status fmi2SetContinuousStates(fmi2Component c, const fmi2Real x[], size_t nx)
{
    (void)x, (void)nx;
    NO_MODEL_EXCHANGE;
}

#define NO_VECTOR(name)                                                                                                \
    fmi2Status name(fmi2Component c, fmi2Real x[], size_t nx) { (void)x, (void)nx; NO_MODEL_EXCHANGE; }

NO_VECTOR(fmi2GetDerivatives)
NO_VECTOR(fmi2GetEventIndicators)
NO_VECTOR(fmi2GetContinuousStates)
NO_VECTOR(fmi2GetNominalsOfContinuousStates)
