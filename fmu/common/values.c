/* Variables of an instance: lookup, reading, checked writing. */
#include "instance.h"

#include <float.h>
#include <math.h>
#include <string.h>

static const VariableInfo time_info = {"time", "s", 0, INDEPENDENT, -INFINITY, INFINITY, 0}; /* it lives in Progress */

/* The generated struct begins with all reals in the order of their value references. */
static double *reals_of(Instance *instance) { return (double *)&instance->model.v; }

static const VariableInfo *find(Kind kind, unsigned vr)
{
    const VariableTable *table = &model_tables[kind];
    const unsigned row = vr - table->first; /* far beyond the table if vr is below it */
    if (row < table->count)
        return &table->rows[row];
    return kind == KIND_REAL && vr == TIME_REFERENCE ? &time_info : NULL;
}

void *value_of(Instance *instance, Kind kind, unsigned vr)
{
    const VariableInfo *info = find(kind, vr);
    return info == &time_info ? (void *)&instance->progress.time : (char *)&instance->model.v + info->offset;
}

void set_string(Instance *instance, unsigned vr, const char *value)
{
    char *target = value_of(instance, KIND_STRING, vr);
    size_t length = strlen(value); /* check_set has seen that it fits */
    memcpy(target, value, length);
    memset(target + length, 0, MODEL_STRING_SIZE - length); /* equal strings are equal bytes in a saved state */
}

static ModelStatus refuse_unknown(const Instance *instance, const char *function, Kind kind, unsigned vr)
{
    static const char *const names[] = {"real", "Boolean", "string"};
    return refuse(instance, "%s: " MODEL_NAME " has no %s variable with value reference %u.", function, names[kind],
                  vr);
}

static ModelStatus refuse_null(const Instance *instance, const char *function, size_t n)
{
    return refuse(instance, "%s: a null pointer was given for %zu variables.", function, n);
}

static size_t value_size(Kind kind)
{
    static const size_t sizes[] = {sizeof(double), sizeof(int), MODEL_STRING_SIZE};
    return sizes[kind];
}

/* --- initialisation -------------------------------------------------------------------------------------------- */

/* Whether model.derived belongs to the present parameters. Tunable ones are read where they are used. */
static bool derived_fits(const Instance *instance)
{
    if (!instance->is_prepared)
        return false;
    for (int kind = KIND_REAL; kind <= KIND_STRING; kind++)
        for (size_t i = 0; i < model_tables[kind].count; i++) {
            const VariableInfo *info = &model_tables[kind].rows[i];
            if (info->role == PARAMETER_FIXED
                && memcmp((const char *)&instance->model.v + info->offset,
                          (const char *)&instance->prepared + info->offset, value_size(kind)) != 0)
                return false;
        }
    return true;
}

ModelStatus prepare_if_needed(Instance *instance)
{
    if (derived_fits(instance))
        return MODEL_OK;
    instance->is_prepared = false;
    ModelStatus status = model_prepare(&instance->model);
    if (status == MODEL_ERROR)
        return status;
    instance->prepared = instance->model.v;
    instance->is_prepared = true;
    return status;
}

/* Every initialisation starts from the same bytes, however many came before it. */
static void clear_outputs(Instance *instance)
{
    for (int kind = KIND_REAL; kind <= KIND_STRING; kind++)
        for (size_t i = 0; i < model_tables[kind].count; i++) {
            const VariableInfo *info = &model_tables[kind].rows[i];
            if (info->role == OUTPUT)
                memcpy((char *)&instance->model.v + info->offset, (const char *)&model_start + info->offset,
                       value_size(kind));
        }
    memset(instance->model.state, 0, instance->model.state_size);
}

ModelStatus check_outputs(Instance *instance, const char *function)
{
    const double *value = reals_of(instance);
    bool finite = true; /* what stands between the outputs, if anything, was checked when it was set */
    for (size_t i = MODEL_OUTPUTS_BEGIN; i < MODEL_OUTPUTS_END; i++)
        finite &= fabs(value[i]) <= DBL_MAX;
    for (size_t i = MODEL_OUTPUTS_BEGIN; i < MODEL_OUTPUTS_END && !finite; i++)
        if (!isfinite(value[i]))
            return refuse(instance, "%s: the output %s became %g.", function, model_tables[KIND_REAL].rows[i].name,
                          value[i]);
    return MODEL_OK;
}

ModelStatus bring_up_to_date(Instance *instance, const char *function)
{
    if (!instance->progress.outdated)
        return MODEL_OK;
    ModelStatus prepared = prepare_if_needed(instance);
    if (prepared == MODEL_ERROR)
        return prepared;
    clear_outputs(instance);
    ModelStatus initialised = model_initialise(&instance->model, instance->progress.start_time);
    if (initialised == MODEL_ERROR || check_outputs(instance, function))
        return MODEL_ERROR;
    instance->progress.outdated = false;
    return initialised > prepared ? initialised : prepared;
}

/* --- reading --------------------------------------------------------------------------------------------------- */

ModelStatus check_get(Instance *instance, const char *function, Kind kind, const unsigned vr[], size_t n,
                      const void *values)
{
    bool reads_output = false;
    if (n > 0 && (!vr || !values))
        return refuse_null(instance, function, n);
    for (size_t i = 0; i < n; i++) {
        const VariableInfo *info = find(kind, vr[i]);
        if (!info)
            return refuse_unknown(instance, function, kind, vr[i]);
        if (info->role == OUTPUT && instance->progress.phase == INSTANTIATED)
            return refuse(instance, "%s: the output %s has no value before initialization mode.", function, info->name);
        reads_output = reads_output || info->role == OUTPUT;
    }
    bool due = reads_output && instance->progress.phase == INITIALIZATION;
    return due ? bring_up_to_date(instance, function) : MODEL_OK;
}

ModelStatus get_reals(Instance *instance, const char *function, const unsigned vr[], size_t n, double values[])
{
    ModelStatus status = MODEL_OK;
    if (!vr || !values || instance->progress.phase <= INITIALIZATION) /* else every variable has its value */
        status = check_get(instance, function, KIND_REAL, vr, n, values);
    if (status == MODEL_ERROR)
        return status;
    const double *reals = reals_of(instance);
    for (size_t i = 0; i < n; i++) {
        if (vr[i] < MODEL_REALS)
            values[i] = reals[vr[i]];
        else if (vr[i] == TIME_REFERENCE)
            values[i] = instance->progress.time;
        else
            return refuse_unknown(instance, function, KIND_REAL, vr[i]);
    }
    return status;
}

/* --- writing --------------------------------------------------------------------------------------------------- */

static ModelStatus check_role(const Instance *instance, const char *function, const VariableInfo *info)
{
    int phase = instance->progress.phase;
    if (info->role == OUTPUT || info->role == INDEPENDENT)
        return refuse(instance, "%s: %s is an output and cannot be set.", function, info->name);
    if (phase == TERMINATED || phase == FAILED)
        return refuse(instance, "%s: %s cannot be set after %s.", function, info->name,
                      phase == FAILED ? "an error" : "termination");
    if (info->role == PARAMETER_FIXED && phase == STEPPING)
        return refuse(instance, "%s: %s is a fixed parameter and cannot be set after initialization.", function,
                      info->name);
    return MODEL_OK;
}

static bool in_range(const VariableInfo *info, double value)
{
    return (value >= info->min && value <= info->max && fabs(value) <= DBL_MAX)
           || (info->can_be_missing && !isfinite(value));
}

static ModelStatus check_number(const Instance *instance, const char *function, const VariableInfo *info, double value)
{
    if (in_range(info, value))
        return MODEL_OK;
    if (!isfinite(value))
        return refuse(instance, "%s: %s cannot be set to %g; it must be a finite number.", function, info->name, value);
    if (info->role == INPUT) /* it comes from a running signal: set_reals holds it at its limit */
        return MODEL_OK;
    return refuse(instance, "%s: %s cannot be set to %g %s; its range is %g to %g %s.", function, info->name, value,
                  info->unit, info->min, info->max, info->unit);
}

static ModelStatus check_text(const Instance *instance, const char *function, const VariableInfo *info,
                              const char *value)
{
    if (!value)
        return refuse(instance, "%s: %s cannot be set to a null pointer.", function, info->name);
    if (strlen(value) >= MODEL_STRING_SIZE)
        return refuse(instance, "%s: %s cannot be set to a text of %zu bytes; there is room for %d.", function,
                      info->name, strlen(value), MODEL_STRING_SIZE - 1);
    return MODEL_OK;
}

ModelStatus check_set(Instance *instance, const char *function, Kind kind, const unsigned vr[], size_t n,
                      const void *values)
{
    const bool stepping = instance->progress.phase == STEPPING;
    if (n > 0 && (!vr || !values))
        return refuse_null(instance, function, n);
    for (size_t i = 0; i < n; i++) {
        const VariableInfo *info = find(kind, vr[i]);
        if (!info)
            return refuse_unknown(instance, function, kind, vr[i]);
        if (!(stepping && info->role == INPUT) && check_role(instance, function, info))
            return MODEL_ERROR;
        if (kind == KIND_REAL && check_number(instance, function, info, ((const double *)values)[i]))
            return MODEL_ERROR;
        if (kind == KIND_STRING && check_text(instance, function, info, ((const char *const *)values)[i]))
            return MODEL_ERROR;
    }
    if (!stepping)
        instance->progress.outdated = true;
    return MODEL_OK;
}

/* An input beyond its range acts at its limit; it is said once, since it may come back at every step. */
static ModelStatus limited(Instance *instance, const char *function, unsigned vr, double value, double limit)
{
    const VariableInfo *info = &model_tables[KIND_REAL].rows[vr];
    reals_of(instance)[vr] = limit;
    if (instance->limited[vr])
        return MODEL_OK;
    instance->limited[vr] = true;
    return warn(instance, "%s: %s = %g %s is beyond its range of %g to %g %s and acts as %g %s; this is said once.",
                function, info->name, value, info->unit, info->min, info->max, info->unit, limit, info->unit);
}

/* What a master sets at every step. */
static bool all_inputs_in_range(const unsigned vr[], size_t n, const double values[])
{
    const VariableInfo *rows = model_tables[KIND_REAL].rows;
    for (size_t i = 0; i < n; i++)
        if (vr[i] >= MODEL_REALS || rows[vr[i]].role != INPUT || !in_range(&rows[vr[i]], values[i]))
            return false;
    return true;
}

ModelStatus set_reals(Instance *instance, const char *function, const unsigned vr[], size_t n, const double values[])
{
    double *reals = reals_of(instance);
    if (vr && values && instance->progress.phase == STEPPING && all_inputs_in_range(vr, n, values)) {
        for (size_t i = 0; i < n; i++)
            reals[vr[i]] = values[i];
        return MODEL_OK;
    }
    ModelStatus status = check_set(instance, function, KIND_REAL, vr, n, values);
    for (size_t i = 0; i < n && status != MODEL_ERROR; i++) {
        const VariableInfo *info = &model_tables[KIND_REAL].rows[vr[i]];
        if (in_range(info, values[i]))
            reals[vr[i]] = values[i];
        else if (limited(instance, function, vr[i], values[i], values[i] < info->min ? info->min : info->max))
            status = MODEL_WARNING;
    }
    return status;
}
