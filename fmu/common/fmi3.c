/* FMI 3.0 for Co-Simulation: the standard's names and types for what instance.h does. */
#include <stdlib.h>
#include <string.h>

#include "fmi3Functions.h"
#include "instance.h"

#define ENTRY(expression)                                                                                              \
    do {                                                                                                               \
        Instance *i = instance;                                                                                        \
        return i ? to_fmi(expression) : fmi3Error;                                                                     \
    } while (0)
#define NOT_HERE(reason) ENTRY(refuse(i, "%s is not available: " reason, __func__))
#define NO_MODEL_EXCHANGE NOT_HERE("this FMU is for co-simulation only.")
#define NO_CLOCKS NOT_HERE("this FMU has no clocks.")
#define NO_EVENT_MODE NOT_HERE("hasEventMode is false.")
#define NO_STRUCTURE NOT_HERE("this FMU has no structural parameters.")

static fmi3Status to_fmi(ModelStatus status)
{
    return status == MODEL_OK ? fmi3OK : status == MODEL_WARNING ? fmi3Warning : fmi3Error;
}

void deliver(const Instance *instance, ModelStatus status, const char *category, const char *message)
{
    fmi3LogMessageCallback logger = (fmi3LogMessageCallback)instance->logger;
    if (logger)
        logger(instance->environment, to_fmi(status), category, message);
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
    ModelStatus status = check_identity(i, instanceName, instantiationToken);
    if (status == MODEL_OK && eventModeUsed)
        status = refuse(i, MODEL_NAME " cannot be instantiated with event mode: hasEventMode is false.");
    if (status == MODEL_OK && nRequiredIntermediateVariables)
        status = refuse(i, MODEL_NAME " cannot be instantiated with intermediate variables: it has no intermediate "
                        "update.");
    return keep_if(status, i);
}

static fmi3Instance only_co_simulation(fmi3String name, fmi3InstanceEnvironment environment,
                                       fmi3LogMessageCallback logMessage)
{
    Instance *i = instance_new(name, "", (void (*)(void))logMessage, environment, false);
    if (i)
        refuse(i, MODEL_NAME " cannot be instantiated this way: it is for co-simulation only.");
    return keep_if(MODEL_ERROR, i);
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String instanceName, fmi3String instantiationToken,
                                          fmi3String resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn,
                                          fmi3InstanceEnvironment instanceEnvironment, fmi3LogMessageCallback logMessage)
{
    (void)instantiationToken, (void)resourcePath, (void)visible, (void)loggingOn;
    return only_co_simulation(instanceName, instanceEnvironment, logMessage);
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String instanceName, fmi3String instantiationToken,
                                               fmi3String resourcePath, fmi3Boolean visible, fmi3Boolean loggingOn,
                                               fmi3InstanceEnvironment instanceEnvironment,
                                               fmi3LogMessageCallback logMessage, fmi3ClockUpdateCallback clockUpdate,
                                               fmi3LockPreemptionCallback lockPreemption,
                                               fmi3UnlockPreemptionCallback unlockPreemption)
{
    (void)instantiationToken, (void)resourcePath, (void)visible, (void)loggingOn, (void)clockUpdate;
    (void)lockPreemption, (void)unlockPreemption;
    return only_co_simulation(instanceName, instanceEnvironment, logMessage);
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

static ModelStatus terminate(Instance *i, const char *function)
{
    if (check_phase(i, function, STEPPING | FAILED))
        return MODEL_ERROR;
    i->progress.phase = TERMINATED;
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
fmi3Status fmi3Reset(fmi3Instance instance) { ENTRY(reset(i, __func__)); }

/* --- variables ----------------------------------------------------------------------------------------------- */

#define REFERENCES const fmi3ValueReference vr[], size_t nvr

/* All variables are scalars: one value to a reference. */
static ModelStatus check_count(Instance *i, const char *function, size_t nvr, size_t n)
{
    if (!i)
        return MODEL_ERROR;
    return nvr == n ? MODEL_OK
                    : refuse(i, "%s: %zu value references need %zu values, not %zu.", function, nvr, nvr, n);
}

#define GETTER(Name, kind, expression)                                                                                 \
    fmi3Status fmi3Get##Name(fmi3Instance instance, REFERENCES, fmi3##Name values[], size_t nValues)                   \
    {                                                                                                                  \
        ModelStatus status = check_count(instance, __func__, nvr, nValues);                                            \
        if (status == MODEL_OK)                                                                                        \
            status = check_get(instance, __func__, kind, vr, nvr);                                                     \
        for (size_t k = 0; k < nvr && status != MODEL_ERROR; k++)                                                      \
            values[k] = expression;                                                                                    \
        return to_fmi(status);                                                                                         \
    }

#define SETTER(Name, kind, statement)                                                                                  \
    fmi3Status fmi3Set##Name(fmi3Instance instance, REFERENCES, const fmi3##Name values[], size_t nValues)             \
    {                                                                                                                  \
        ModelStatus status = check_count(instance, __func__, nvr, nValues);                                            \
        if (status == MODEL_OK)                                                                                        \
            status = check_set(instance, __func__, kind, vr, nvr, values);                                             \
        for (size_t k = 0; k < nvr && status != MODEL_ERROR; k++)                                                      \
            statement;                                                                                                 \
        return to_fmi(status);                                                                                         \
    }

GETTER(Float64, KIND_REAL, *(double *)value_of(instance, KIND_REAL, vr[k]))
GETTER(Boolean, KIND_BOOLEAN, *(int *)value_of(instance, KIND_BOOLEAN, vr[k]) != 0)
GETTER(String, KIND_STRING, value_of(instance, KIND_STRING, vr[k]))
SETTER(Float64, KIND_REAL, *(double *)value_of(instance, KIND_REAL, vr[k]) = values[k])
SETTER(Boolean, KIND_BOOLEAN, *(int *)value_of(instance, KIND_BOOLEAN, vr[k]) = values[k])
SETTER(String, KIND_STRING, set_string(instance, vr[k], values[k]))

#define NO_TYPE(Name)                                                                                                  \
    fmi3Status fmi3Get##Name(fmi3Instance instance, REFERENCES, fmi3##Name values[], size_t nValues)                   \
    {                                                                                                                  \
        (void)vr, (void)values, (void)nValues;                                                                         \
        ENTRY(nvr ? refuse(i, "%s: " MODEL_NAME " has no " #Name " variables.", __func__) : MODEL_OK);                 \
    }                                                                                                                  \
    fmi3Status fmi3Set##Name(fmi3Instance instance, REFERENCES, const fmi3##Name values[], size_t nValues)             \
    {                                                                                                                  \
        (void)vr, (void)values, (void)nValues;                                                                         \
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

fmi3Status fmi3GetBinary(fmi3Instance instance, REFERENCES, size_t valueSizes[], fmi3Binary values[], size_t nValues)
{
    (void)vr, (void)valueSizes, (void)values, (void)nValues;
    ENTRY(nvr ? refuse(i, "%s: " MODEL_NAME " has no Binary variables.", __func__) : MODEL_OK);
}

fmi3Status fmi3SetBinary(fmi3Instance instance, REFERENCES, const size_t valueSizes[], const fmi3Binary values[],
                         size_t nValues)
{
    (void)vr, (void)valueSizes, (void)values, (void)nValues;
    ENTRY(nvr ? refuse(i, "%s: " MODEL_NAME " has no Binary variables.", __func__) : MODEL_OK);
}

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
    return to_fmi(status);
}

/* --- what the capability flags say is absent ------------------------------------------------------------------- */

fmi3Status fmi3EnterEventMode(fmi3Instance instance) { NO_EVENT_MODE; }
fmi3Status fmi3EnterStepMode(fmi3Instance instance) { NO_EVENT_MODE; }
fmi3Status fmi3EvaluateDiscreteStates(fmi3Instance instance) { NO_EVENT_MODE; }
fmi3Status fmi3EnterConfigurationMode(fmi3Instance instance) { NO_STRUCTURE; }
fmi3Status fmi3ExitConfigurationMode(fmi3Instance instance) { NO_STRUCTURE; }
fmi3Status fmi3EnterContinuousTimeMode(fmi3Instance instance) { NO_MODEL_EXCHANGE; }
fmi3Status fmi3SetTime(fmi3Instance instance, fmi3Float64 time) { (void)time; NO_MODEL_EXCHANGE; }

fmi3Status fmi3UpdateDiscreteStates(fmi3Instance instance, fmi3Boolean *discreteStatesNeedUpdate,
                                    fmi3Boolean *terminateSimulation, fmi3Boolean *nominalsOfContinuousStatesChanged,
                                    fmi3Boolean *valuesOfContinuousStatesChanged, fmi3Boolean *nextEventTimeDefined,
                                    fmi3Float64 *nextEventTime)
{
    (void)discreteStatesNeedUpdate, (void)terminateSimulation, (void)nominalsOfContinuousStatesChanged;
    (void)valuesOfContinuousStatesChanged, (void)nextEventTimeDefined, (void)nextEventTime;
    NO_EVENT_MODE;
}

fmi3Status fmi3GetNumberOfVariableDependencies(fmi3Instance instance, fmi3ValueReference valueReference,
                                               size_t *nDependencies)
{
    (void)valueReference, (void)nDependencies;
    NOT_HERE("providesPerElementDependencies is false.");
}

fmi3Status fmi3GetVariableDependencies(fmi3Instance instance, fmi3ValueReference dependent,
                                       size_t elementIndicesOfDependent[], fmi3ValueReference independents[],
                                       size_t elementIndicesOfIndependents[], fmi3DependencyKind dependencyKinds[],
                                       size_t nDependencies)
{
    (void)dependent, (void)elementIndicesOfDependent, (void)independents, (void)elementIndicesOfIndependents;
    (void)dependencyKinds, (void)nDependencies;
    NOT_HERE("providesPerElementDependencies is false.");
}

#define NO_DERIVATIVE(name)                                                                                            \
    fmi3Status name(fmi3Instance instance, const fmi3ValueReference unknowns[], size_t nUnknowns,                      \
                    const fmi3ValueReference knowns[], size_t nKnowns, const fmi3Float64 seed[], size_t nSeed,         \
                    fmi3Float64 sensitivity[], size_t nSensitivity)                                                    \
    {                                                                                                                  \
        (void)unknowns, (void)nUnknowns, (void)knowns, (void)nKnowns, (void)seed, (void)nSeed;                         \
        (void)sensitivity, (void)nSensitivity;                                                                         \
        NOT_HERE("partial derivatives are not provided.");                                                             \
    }

NO_DERIVATIVE(fmi3GetDirectionalDerivative)
NO_DERIVATIVE(fmi3GetAdjointDerivative)

fmi3Status fmi3GetOutputDerivatives(fmi3Instance instance, REFERENCES, const fmi3Int32 orders[], fmi3Float64 values[],
                                    size_t nValues)
{
    (void)vr, (void)nvr, (void)orders, (void)values, (void)nValues;
    NOT_HERE("maxOutputDerivativeOrder is 0.");
}

fmi3Status fmi3GetClock(fmi3Instance instance, REFERENCES, fmi3Clock values[])
{
    (void)vr, (void)nvr, (void)values;
    NO_CLOCKS;
}

fmi3Status fmi3SetClock(fmi3Instance instance, REFERENCES, const fmi3Clock values[])
{
    (void)vr, (void)nvr, (void)values;
    NO_CLOCKS;
}

fmi3Status fmi3GetIntervalDecimal(fmi3Instance instance, REFERENCES, fmi3Float64 intervals[],
                                  fmi3IntervalQualifier qualifiers[])
{
    (void)vr, (void)nvr, (void)intervals, (void)qualifiers;
    NO_CLOCKS;
}

fmi3Status fmi3GetIntervalFraction(fmi3Instance instance, REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[],
                                   fmi3IntervalQualifier qualifiers[])
{
    (void)vr, (void)nvr, (void)counters, (void)resolutions, (void)qualifiers;
    NO_CLOCKS;
}

fmi3Status fmi3GetShiftDecimal(fmi3Instance instance, REFERENCES, fmi3Float64 shifts[])
{
    (void)vr, (void)nvr, (void)shifts;
    NO_CLOCKS;
}

fmi3Status fmi3GetShiftFraction(fmi3Instance instance, REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[])
{
    (void)vr, (void)nvr, (void)counters, (void)resolutions;
    NO_CLOCKS;
}

fmi3Status fmi3SetIntervalDecimal(fmi3Instance instance, REFERENCES, const fmi3Float64 intervals[])
{
    (void)vr, (void)nvr, (void)intervals;
    NO_CLOCKS;
}

#define NO_FRACTION(name)                                                                                              \
    fmi3Status name(fmi3Instance instance, REFERENCES, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[])    \
    {                                                                                                                  \
        (void)vr, (void)nvr, (void)counters, (void)resolutions;                                                        \
        NO_CLOCKS;                                                                                                     \
    }

NO_FRACTION(fmi3SetIntervalFraction)
NO_FRACTION(fmi3SetShiftFraction)

fmi3Status fmi3SetShiftDecimal(fmi3Instance instance, REFERENCES, const fmi3Float64 shifts[])
{
    (void)vr, (void)nvr, (void)shifts;
    NO_CLOCKS;
}

fmi3Status fmi3ActivateModelPartition(fmi3Instance instance, fmi3ValueReference clockReference,
                                      fmi3Float64 activationTime)
{
    (void)clockReference, (void)activationTime;
    NO_CLOCKS;
}

fmi3Status fmi3CompletedIntegratorStep(fmi3Instance instance, fmi3Boolean noSetFMUStatePriorToCurrentPoint,
                                       fmi3Boolean *enterEventMode, fmi3Boolean *terminateSimulation)
{
    (void)noSetFMUStatePriorToCurrentPoint, (void)enterEventMode, (void)terminateSimulation;
    NO_MODEL_EXCHANGE;
}

fmi3Status fmi3SetContinuousStates(fmi3Instance instance, const fmi3Float64 continuousStates[], size_t n)
{
    (void)continuousStates, (void)n;
    NO_MODEL_EXCHANGE;
}

#define NO_VECTOR(name)                                                                                                \
    fmi3Status name(fmi3Instance instance, fmi3Float64 x[], size_t n) { (void)x, (void)n; NO_MODEL_EXCHANGE; }

NO_VECTOR(fmi3GetContinuousStateDerivatives)
NO_VECTOR(fmi3GetEventIndicators)
NO_VECTOR(fmi3GetContinuousStates)
NO_VECTOR(fmi3GetNominalsOfContinuousStates)

fmi3Status fmi3GetNumberOfEventIndicators(fmi3Instance instance, size_t *n) { (void)n; NO_MODEL_EXCHANGE; }
fmi3Status fmi3GetNumberOfContinuousStates(fmi3Instance instance, size_t *n) { (void)n; NO_MODEL_EXCHANGE; }
