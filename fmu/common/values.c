/* Variables of an instance: lookup, reading, checked writing. */
#include "instance.h"

#include <math.h>
#include <string.h>

static const VariableInfo time_info = {"time", "s", 0, INDEPENDENT, -INFINITY, INFINITY}; /* it lives in Progress */

static const VariableInfo *find(Kind kind, unsigned vr)
{
    if (kind == KIND_REAL && vr == TIME_REFERENCE)
        return &time_info;
    const VariableTable *table = &model_tables[kind];
    return vr >= table->first && vr - table->first < table->count ? &table->rows[vr - table->first] : NULL;
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

static const char *kind_name(Kind kind)
{
    static const char *const names[] = {"real", "Boolean", "string"};
    return names[kind];
}

static const VariableInfo *find_or_refuse(Instance *instance, const char *function, Kind kind, unsigned vr)
{
    const VariableInfo *info = find(kind, vr);
    if (!info)
        refuse(instance, "%s: " MODEL_NAME " has no %s variable with value reference %u.", function, kind_name(kind), vr);
    return info;
}

static size_t value_size(Kind kind)
{
    static const size_t sizes[] = {sizeof(double), sizeof(int), MODEL_STRING_SIZE};
    return sizes[kind];
}

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
    memset(instance->model.state, 0, model_state_size);
}

ModelStatus check_outputs(const Instance *instance, const char *function)
{
    for (size_t i = 0; i < model_tables[KIND_REAL].count; i++) {
        const VariableInfo *info = &model_tables[KIND_REAL].rows[i];
        double value = *(const double *)((const char *)&instance->model.v + info->offset);
        if (info->role == OUTPUT && !isfinite(value))
            return refuse(instance, "%s: the output %s became %g.", function, info->name, value);
    }
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
    ModelStatus initialised = model_initialise(&instance->model);
    if (initialised == MODEL_ERROR || check_outputs(instance, function))
        return MODEL_ERROR;
    instance->progress.outdated = false;
    return initialised > prepared ? initialised : prepared;
}

ModelStatus check_get(Instance *instance, const char *function, Kind kind, const unsigned vr[], size_t n)
{
    bool reads_output = false;
    for (size_t i = 0; i < n; i++) {
        const VariableInfo *info = find_or_refuse(instance, function, kind, vr[i]);
        if (!info)
            return MODEL_ERROR;
        if (info->role == OUTPUT && instance->progress.phase == INSTANTIATED)
            return refuse(instance, "%s: the output %s has no value before initialization mode.", function, info->name);
        reads_output = reads_output || info->role == OUTPUT;
    }
    bool due = reads_output && instance->progress.phase == INITIALIZATION;
    return due ? bring_up_to_date(instance, function) : MODEL_OK;
}

static ModelStatus check_role(Instance *instance, const char *function, const VariableInfo *info)
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

static ModelStatus check_number(Instance *instance, const char *function, const VariableInfo *info, double value)
{
    if (!isfinite(value))
        return refuse(instance, "%s: %s cannot be set to %g; it must be a finite number.", function, info->name, value);
    /* an input beyond its range is a fact of the run that the model has to live with; a parameter is a mistake */
    if (info->role != INPUT && (value < info->min || value > info->max))
        return refuse(instance, "%s: %s cannot be set to %g %s; its range is %g to %g %s.", function, info->name, value,
                      info->unit, info->min, info->max, info->unit);
    return MODEL_OK;
}

static ModelStatus check_text(Instance *instance, const char *function, const VariableInfo *info, const char *value)
{
    if (!value)
        return refuse(instance, "%s: %s cannot be set to a null pointer.", function, info->name);
    if (strlen(value) >= MODEL_STRING_SIZE)
        return refuse(instance, "%s: %s cannot be set to a text of %zu bytes; there is room for %d.", function, info->name,
                      strlen(value), MODEL_STRING_SIZE - 1);
    return MODEL_OK;
}

ModelStatus check_set(Instance *instance, const char *function, Kind kind, const unsigned vr[], size_t n,
                      const void *values)
{
    for (size_t i = 0; i < n; i++) {
        const VariableInfo *info = find_or_refuse(instance, function, kind, vr[i]);
        if (!info || check_role(instance, function, info))
            return MODEL_ERROR;
        if (kind == KIND_REAL && check_number(instance, function, info, ((const double *)values)[i]))
            return MODEL_ERROR;
        if (kind == KIND_STRING && check_text(instance, function, info, ((const char *const *)values)[i]))
            return MODEL_ERROR;
    }
    if (instance->progress.phase != STEPPING)
        instance->progress.outdated = true;
    return MODEL_OK;
}
