/* FMI 3.0 for Co-Simulation: the standard's names and types for what instance.h does. */
#include "fmi3Functions.h"
#include "instance.h"

/* Each entry point is one expression of a checked instance `i` and its own name. */
#define ENTRY(expression)                                                                                              \
    do {                                                                                                               \
        Instance *i = instance;                                                                                        \
        return i ? (fmi3Status)(expression) : fmi3Error;                                                               \
    } while (0)

const char message_escapes[] = "#"; /* a message may hold #1365# for the variable of that value reference */

void deliver(const Instance *instance, ModelStatus status, const char *category, const char *message)
{
    ((fmi3LogMessageCallback)instance->logger)(instance->environment, (fmi3Status)status, category, message);
}

const char *fmi3GetVersion(void) { return fmi3Version; }

static fmi3Instance keep_if(ModelStatus status, Instance *i)
{
    if (status == MODEL_OK)
        return i;
    instance_free(i);
    return NULL;
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String instanceName, fmi3String instantiationToken,
                                         fmi3String resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn,
                                         fmi3Boolean eventModeUsed, fmi3Boolean earlyReturnAllowed,
                                         const fmi3ValueReference requiredIntermediateVariables[],
                                         size_t nRequiredIntermediateVariables,
                                         fmi3InstanceEnvironment instanceEnvironment, fmi3LogMessageCallback logMessage,
                                         fmi3IntermediateUpdateCallback intermediateUpdate)
{
    (void)visible, (void)earlyReturnAllowed, (void)requiredIntermediateVariables, (void)intermediateUpdate;
    Instance *i = instance_new(instanceName, resourcePath, (void (*)(void))logMessage, instanceEnvironment, loggingOn);
    if (!i)
        return NULL;
    strip_separator(i->resources);
    ModelStatus status = instance_load(i);
    if (status != MODEL_ERROR)
        status = check_identity(i, instanceName, instantiationToken);
    if (status == MODEL_OK && eventModeUsed)
        status = refuse(i, MODEL_NAME " cannot be instantiated with event mode: hasEventMode is false.");
    if (status == MODEL_OK && nRequiredIntermediateVariables)
        status = refuse(i, MODEL_NAME " cannot be instantiated with intermediate variables: it has no intermediate "
                        "update.");
    return keep_if(status, i);
}

void fmi3FreeInstance(fmi3Instance instance) { instance_free(instance); }

fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean loggingOn, size_t nCategories,
                               const fmi3String categories[])
{
    ENTRY(set_logging(i, __func__, loggingOn, nCategories, categories));
}

static ModelStatus enter_initialization(Instance *i, const char *function, double start, bool stop_defined, double stop)
{
    if (setup_experiment(i, function, start, stop_defined, stop))
        return MODEL_ERROR;
    i->progress.phase = INITIALIZATION;
    return MODEL_OK;
}

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean toleranceDefined, fmi3Float64 tolerance,
                                       fmi3Float64 startTime, fmi3Boolean stopTimeDefined, fmi3Float64 stopTime)
{
    (void)toleranceDefined, (void)tolerance; /* the step inside the model is fixed */
    ENTRY(enter_initialization(i, __func__, startTime, stopTimeDefined, stopTime));
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance) { ENTRY(exit_initialization(i, __func__)); }
fmi3Status fmi3Terminate(fmi3Instance instance) { ENTRY(terminate(i, __func__)); }
fmi3Status fmi3Reset(fmi3Instance instance) { ENTRY(reset(i)); }

/* --- variables ----------------------------------------------------------------------------------------------- */

#define REFERENCES fmi3Instance instance, const fmi3ValueReference vr[], size_t nvr

/* All variables are scalars: one value to a reference. */
static ModelStatus check_count(const Instance *i, const char *function, size_t nvr, size_t n)
{
    if (nvr == n)
        return MODEL_OK;
    return refuse(i, "%s: %zu value references need %zu values, not %zu.", function, nvr, nvr, n);
}

fmi3Status fmi3GetFloat64(REFERENCES, fmi3Float64 values[], size_t nValues)
{
    ENTRY(check_count(i, __func__, nvr, nValues) ? MODEL_ERROR : get_reals(i, __func__, vr, nvr, values));
}

fmi3Status fmi3SetFloat64(REFERENCES, const fmi3Float64 values[], size_t nValues)
{
    ENTRY(check_count(i, __func__, nvr, nValues) ? MODEL_ERROR : set_reals(i, __func__, vr, nvr, values));
}

#define ACCESS(check, kind, statement)                                                                           \
    {                                                                                                                  \
        if (!instance || check_count(instance, __func__, nvr, nValues))                                                \
            return fmi3Error;                                                                                          \
        ModelStatus status = check(instance, __func__, kind, vr, nvr, values);                                         \
        for (size_t k = 0; k < nvr && status != MODEL_ERROR; k++)                                                      \
            statement;                                                                                                 \
        return (fmi3Status)status;                                                                                     \
    }
#define GETTER(Name, kind, expression)                                                                                 \
    fmi3Status fmi3Get##Name(REFERENCES, fmi3##Name values[], size_t nValues)                                          \
    ACCESS(check_get, kind, values[k] = expression)
#define SETTER(Name, kind, statement)                                                                                  \
    fmi3Status fmi3Set##Name(REFERENCES, const fmi3##Name values[], size_t nValues)                                    \
    ACCESS(check_set, kind, statement)

GETTER(Boolean, KIND_BOOLEAN, *(int *)value_of(instance, KIND_BOOLEAN, vr[k]) != 0)
GETTER(String, KIND_STRING, value_of(instance, KIND_STRING, vr[k]))
SETTER(Boolean, KIND_BOOLEAN, *(int *)value_of(instance, KIND_BOOLEAN, vr[k]) = values[k])
SETTER(String, KIND_STRING, set_string(instance, vr[k], values[k]))

/* --- saved states -------------------------------------------------------------------------------------------- */

fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *FMUState) { ENTRY(state_get(i, __func__, FMUState)); }
fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState FMUState) { ENTRY(state_set(i, __func__, FMUState)); }
fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *FMUState) { ENTRY(state_free(i, __func__, FMUState)); }

fmi3Status fmi3SerializedFMUStateSize(fmi3Instance instance, fmi3FMUState FMUState, size_t *size)
{
    ENTRY(state_size(i, __func__, FMUState, size));
}

fmi3Status fmi3SerializeFMUState(fmi3Instance instance, fmi3FMUState FMUState, fmi3Byte bytes[], size_t size)
{
    ENTRY(state_serialize(i, __func__, FMUState, bytes, size));
}

fmi3Status fmi3DeserializeFMUState(fmi3Instance instance, const fmi3Byte bytes[], size_t size, fmi3FMUState *FMUState)
{
    ENTRY(state_deserialize(i, __func__, bytes, size, FMUState));
}

/* --- steps --------------------------------------------------------------------------------------------------- */

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 currentCommunicationPoint, fmi3Float64 communicationStepSize,
                      fmi3Boolean noSetFMUStatePriorToCurrentPoint, fmi3Boolean *eventHandlingNeeded,
                      fmi3Boolean *terminateSimulation, fmi3Boolean *earlyReturn, fmi3Float64 *lastSuccessfulTime)
{
    (void)noSetFMUStatePriorToCurrentPoint; /* going back costs nothing here */
    Instance *i = instance;
    if (!i)
        return fmi3Error;
    ModelStatus status = do_step(i, __func__, currentCommunicationPoint, communicationStepSize);
    if (eventHandlingNeeded)
        *eventHandlingNeeded = fmi3False;
    if (terminateSimulation)
        *terminateSimulation = fmi3False;
    if (earlyReturn)
        *earlyReturn = fmi3False;
    if (lastSuccessfulTime)
        *lastSuccessfulTime = i->progress.time;
    return (fmi3Status)status;
}

/* --- what the capability flags say is absent: no argument is looked at -------------------------------------------- */

#pragma GCC diagnostic ignored "-Wunused-parameter"

static fmi3Instance only_co_simulation(fmi3String name, fmi3InstanceEnvironment environment, fmi3LogMessageCallback log)
{
    Instance *i = instance_new(name, "", (void (*)(void))log, environment, false);
    if (i)
        refuse(i, MODEL_NAME " cannot be instantiated this way: " ONLY_CO_SIMULATION);
    return keep_if(MODEL_ERROR, i);
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resourcePath,
                                          fmi3Boolean visible, fmi3Boolean loggingOn,
                                          fmi3InstanceEnvironment environment, fmi3LogMessageCallback log)
{
    return only_co_simulation(name, environment, log);
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resourcePath,
                                               fmi3Boolean visible, fmi3Boolean loggingOn,
                                               fmi3InstanceEnvironment environment, fmi3LogMessageCallback log,
                                               fmi3ClockUpdateCallback clockUpdate,
                                               fmi3LockPreemptionCallback lockPreemption,
                                               fmi3UnlockPreemptionCallback unlockPreemption)
{
    return only_co_simulation(name, environment, log);
}

#define NO_TYPE(Name)                                                                                                  \
    fmi3Status fmi3Get##Name(REFERENCES, fmi3##Name values[], size_t nValues)                                          \
    {                                                                                                                  \
        ENTRY(nvr ? refuse(i, "%s: " MODEL_NAME " has no " #Name " variables.", __func__) : MODEL_OK);                 \
    }                                                                                                                  \
    fmi3Status fmi3Set##Name(REFERENCES, const fmi3##Name values[], size_t nValues)                                    \
    {                                                                                                                  \
        ENTRY(nvr ? refuse(i, "%s: " MODEL_NAME " has no " #Name " variables.", __func__) : MODEL_OK);                 \
    }

NO_TYPE(Float32)
NO_TYPE(Int8)
NO_TYPE(UInt8)
NO_TYPE(Int16)
NO_TYPE(UInt16)
NO_TYPE(Int32)
NO_TYPE(UInt32)
NO_TYPE(Int64)
NO_TYPE(UInt64)

#define ABSENT(name, arguments, reason)                                                                                \
    fmi3Status name arguments { ENTRY(refuse(i, "%s is not available: " reason, __func__)); }

#define NO_BINARY "this FMU has no Binary variables."
ABSENT(fmi3GetBinary, (REFERENCES, size_t sizes[], fmi3Binary values[], size_t nValues), NO_BINARY)
ABSENT(fmi3SetBinary, (REFERENCES, const size_t sizes[], const fmi3Binary values[], size_t nValues), NO_BINARY)

#define NO_EVENT_MODE "hasEventMode is false."
ABSENT(fmi3EnterEventMode, (fmi3Instance instance), NO_EVENT_MODE)
ABSENT(fmi3EnterStepMode, (fmi3Instance instance), NO_EVENT_MODE)
ABSENT(fmi3EvaluateDiscreteStates, (fmi3Instance instance), NO_EVENT_MODE)
ABSENT(fmi3UpdateDiscreteStates,
       (fmi3Instance instance, fmi3Boolean *needUpdate, fmi3Boolean *terminateSimulation, fmi3Boolean *nominalsChanged,
        fmi3Boolean *valuesChanged, fmi3Boolean *nextEventTimeDefined, fmi3Float64 *nextEventTime),
       NO_EVENT_MODE)

#define NO_STRUCTURE "this FMU has no structural parameters."
ABSENT(fmi3EnterConfigurationMode, (fmi3Instance instance), NO_STRUCTURE)
ABSENT(fmi3ExitConfigurationMode, (fmi3Instance instance), NO_STRUCTURE)

#define NO_ELEMENTS "providesPerElementDependencies is false."
ABSENT(fmi3GetNumberOfVariableDependencies, (fmi3Instance instance, fmi3ValueReference vr, size_t *n), NO_ELEMENTS)
ABSENT(fmi3GetVariableDependencies,
       (fmi3Instance instance, fmi3ValueReference dependent, size_t elementsOfDependent[],
        fmi3ValueReference independents[], size_t elementsOfIndependents[], fmi3DependencyKind kinds[], size_t n),
       NO_ELEMENTS)

#define NO_DERIVATIVES "derivatives are not provided."
#define PARTIAL                                                                                                        \
    (REFERENCES, const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[], size_t nSeed,            \
     fmi3Float64 sensitivity[], size_t nSensitivity)
ABSENT(fmi3GetDirectionalDerivative, PARTIAL, NO_DERIVATIVES)
ABSENT(fmi3GetAdjointDerivative, PARTIAL, NO_DERIVATIVES)
ABSENT(fmi3GetOutputDerivatives, (REFERENCES, const fmi3Int32 orders[], fmi3Float64 values[], size_t nValues),
       NO_DERIVATIVES)

#define NO_CLOCKS "this FMU has no clocks."
ABSENT(fmi3GetClock, (REFERENCES, fmi3Clock values[]), NO_CLOCKS)
ABSENT(fmi3SetClock, (REFERENCES, const fmi3Clock values[]), NO_CLOCKS)
ABSENT(fmi3GetIntervalDecimal, (REFERENCES, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[]), NO_CLOCKS)
ABSENT(fmi3GetIntervalFraction,
       (REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[]), NO_CLOCKS)
ABSENT(fmi3SetIntervalDecimal, (REFERENCES, const fmi3Float64 intervals[]), NO_CLOCKS)
ABSENT(fmi3SetIntervalFraction, (REFERENCES, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]), NO_CLOCKS)
ABSENT(fmi3GetShiftDecimal, (REFERENCES, fmi3Float64 shifts[]), NO_CLOCKS)
ABSENT(fmi3GetShiftFraction, (REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[]), NO_CLOCKS)
ABSENT(fmi3SetShiftDecimal, (REFERENCES, const fmi3Float64 shifts[]), NO_CLOCKS)
ABSENT(fmi3SetShiftFraction, (REFERENCES, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]), NO_CLOCKS)
ABSENT(fmi3ActivateModelPartition, (fmi3Instance instance, fmi3ValueReference clock, fmi3Float64 time), NO_CLOCKS)

ABSENT(fmi3EnterContinuousTimeMode, (fmi3Instance instance), ONLY_CO_SIMULATION)
ABSENT(fmi3CompletedIntegratorStep,
       (fmi3Instance instance, fmi3Boolean noSetPrior, fmi3Boolean *enterEventMode, fmi3Boolean *terminateSimulation),
       ONLY_CO_SIMULATION)
ABSENT(fmi3SetTime, (fmi3Instance instance, fmi3Float64 time), ONLY_CO_SIMULATION)
ABSENT(fmi3SetContinuousStates, (fmi3Instance instance, const fmi3Float64 x[], size_t n), ONLY_CO_SIMULATION)
ABSENT(fmi3GetContinuousStates, (fmi3Instance instance, fmi3Float64 x[], size_t n), ONLY_CO_SIMULATION)
ABSENT(fmi3GetContinuousStateDerivatives, (fmi3Instance instance, fmi3Float64 x[], size_t n), ONLY_CO_SIMULATION)
ABSENT(fmi3GetNominalsOfContinuousStates, (fmi3Instance instance, fmi3Float64 x[], size_t n), ONLY_CO_SIMULATION)
ABSENT(fmi3GetEventIndicators, (fmi3Instance instance, fmi3Float64 indicators[], size_t n), ONLY_CO_SIMULATION)
ABSENT(fmi3GetNumberOfEventIndicators, (fmi3Instance instance, size_t *n), ONLY_CO_SIMULATION)
ABSENT(fmi3GetNumberOfContinuousStates, (fmi3Instance instance, size_t *n), ONLY_CO_SIMULATION)
