/* Life cycle of an instance: creation, logging, phases, experiment, steps, reset. */
#include "instance.h"

#include <math.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { STATE_ALIGNMENT = 64 }; /* bytes: a cache line, and the widest vector */

static char *copy_text(const char *text)
{
    size_t size = strlen(text) + 1;
    char *copy = malloc(size);
    return copy ? memcpy(copy, text, size) : NULL;
}

void strip_separator(char *path)
{
    size_t n = strlen(path);
    while (n > 1 && (path[n - 1] == '/' || path[n - 1] == '\\'))
        path[--n] = '\0';
}

static void start_over(Instance *instance)
{
    memcpy(&instance->model.v, &model_start, sizeof model_start);
    memset(instance->model.state, 0, instance->model.state_size);
    memset(&instance->progress, 0, sizeof instance->progress);
    memset(instance->limited, 0, sizeof instance->limited);
    instance->progress.phase = INSTANTIATED;
    instance->progress.outdated = true;
    instance->is_prepared = false; /* a file it was built from may have changed */
}

Instance *instance_new(const char *name, const char *resources, void (*logger)(void), void *environment, bool logging)
{
    Instance *instance = calloc(1, sizeof *instance);
    if (!instance)
        return NULL;
    instance->name = copy_text(name ? name : "");
    instance->resources = copy_text(resources ? resources : "");
    if (!instance->name || !instance->resources) {
        instance_free(instance);
        return NULL;
    }
    instance->model.resources = instance->resources;
    instance->model.host = instance;
    instance->logger = logger;
    instance->environment = environment;
    memcpy(instance->model.token, model_token, strlen(model_token) + 1);
    for (size_t i = 0; i < MODEL_CATEGORIES; i++)
        instance->category_enabled[i] = logging;
    return instance;
}

ModelStatus instance_load(Instance *instance)
{
    Model *m = &instance->model;
    ModelStatus status = model_load(m);
    if (status == MODEL_ERROR)
        return status;
    instance->memory = calloc(1, m->state_size + STATE_ALIGNMENT);
    if (!instance->memory)
        return refuse(instance, MODEL_NAME " cannot be instantiated: no memory for a state of %zu bytes.",
                      m->state_size);
    m->state = (char *)instance->memory + STATE_ALIGNMENT - (uintptr_t)instance->memory % STATE_ALIGNMENT;
    start_over(instance);
    return status;
}

void instance_free(Instance *instance)
{
    if (!instance)
        return;
    if (instance->model.host) /* otherwise creation failed half-way and the model has never seen it */
        model_release(&instance->model);
    free(instance->memory);
    free(instance->resources);
    free(instance->name);
    free(instance);
}

/* --- logging ------------------------------------------------------------------------------------------------- */

static int category_index(const char *category)
{
    for (int i = 0; category && i < MODEL_CATEGORIES; i++)
        if (strcmp(category, model_categories[i]) == 0)
            return i;
    return -1;
}

static void escape(char *to, size_t room, const char *from)
{
    for (; *from && room > 2; from++) {
        if (strchr(message_escapes, *from))
            *to++ = *from, room--;
        *to++ = *from, room--;
    }
    *to = '\0';
}

/* Errors always arrive, as FMI 3.0.3 recommends; everything else only if its category is switched on. */
static void say(const Instance *instance, ModelStatus status, const char *category, const char *format, va_list values)
{
    int index = category_index(category);
    if (index < 0) /* only declared categories leave the FMU */
        index = category_index(ERROR_CATEGORY);
    if (!instance->logger || (status != MODEL_ERROR && !instance->category_enabled[index]))
        return;
    char message[2048], escaped[2 * sizeof message];
    vsnprintf(message, sizeof message, format, values);
    escape(escaped, sizeof escaped, message);
    deliver(instance, status, model_categories[index], escaped);
}

void model_log(const Model *m, ModelStatus status, const char *category, const char *format, ...)
{
    va_list values;
    va_start(values, format);
    say(m->host, status, category, format, values);
    va_end(values);
}

ModelStatus refuse(const Instance *instance, const char *format, ...)
{
    va_list values;
    va_start(values, format);
    say(instance, MODEL_ERROR, ERROR_CATEGORY, format, values);
    va_end(values);
    return MODEL_ERROR;
}

ModelStatus warn(const Instance *instance, const char *format, ...)
{
    va_list values;
    va_start(values, format);
    say(instance, MODEL_WARNING, WARNING_CATEGORY, format, values);
    va_end(values);
    return MODEL_WARNING;
}

/* On: the categories given and no others; off: the categories given. No categories given means all of them. */
ModelStatus set_logging(Instance *instance, const char *function, bool on, size_t n, const char *const categories[])
{
    for (size_t i = 0; i < n; i++)
        if (!categories || category_index(categories[i]) < 0)
            return refuse(instance, "%s: \"%s\" is not a log category of " MODEL_NAME ".", function,
                          categories && categories[i] ? categories[i] : "(null)");
    for (int i = 0; i < MODEL_CATEGORIES && (on || n == 0); i++)
        instance->category_enabled[i] = on && n == 0;
    for (size_t i = 0; i < n; i++)
        instance->category_enabled[category_index(categories[i])] = on;
    return MODEL_OK;
}

/* --- call order ---------------------------------------------------------------------------------------------- */

ModelStatus check_identity(const Instance *instance, const char *name, const char *token)
{
    if (!name || !name[strspn(name, " \t\r\n")])
        return refuse(instance, MODEL_NAME " cannot be instantiated without an instance name.");
    if (!token || strcmp(token, instance->model.token) != 0)
        return refuse(instance, MODEL_NAME " cannot be instantiated: the token \"%s\" is not that of this binary, "
                      "\"%s\"; modelDescription.xml and binary come from different builds.", token ? token : "(null)",
                      instance->model.token);
    return MODEL_OK;
}

static const char *phase_name(int phase)
{
    switch (phase) {
    case INSTANTIATED: return "before initialization mode";
    case INITIALIZATION: return "in initialization mode";
    case STEPPING: return "between initialization and termination";
    case TERMINATED: return "after termination";
    default: return "after an error";
    }
}

ModelStatus check_phase(const Instance *instance, const char *function, int allowed)
{
    char places[160] = "";
    if (instance->progress.phase & allowed)
        return MODEL_OK;
    for (int phase = INSTANTIATED; phase <= FAILED; phase *= 2)
        if (phase & allowed) {
            size_t used = strlen(places);
            snprintf(places + used, sizeof places - used, "%s%s", used ? " or " : "", phase_name(phase));
        }
    return refuse(instance, "%s was called %s; it may be called %s.", function, phase_name(instance->progress.phase),
                  places);
}

ModelStatus setup_experiment(Instance *instance, const char *function, double start, bool stop_defined, double stop)
{
    if (check_phase(instance, function, INSTANTIATED))
        return MODEL_ERROR;
    if (!isfinite(start))
        return refuse(instance, "%s: the start time is %g s; it must be finite.", function, start);
    if (stop_defined && !(stop >= start)) /* also a NaN */
        return refuse(instance, "%s: the stop time %.17g s is before the start time %.17g s.", function, stop, start);
    instance->progress.time = instance->progress.start_time = start;
    instance->progress.stop_defined = stop_defined;
    instance->progress.stop_time = stop_defined ? stop : 0.0;
    instance->progress.experiment_set = true;
    return MODEL_OK;
}

ModelStatus exit_initialization(Instance *instance, const char *function)
{
    if (check_phase(instance, function, INITIALIZATION))
        return MODEL_ERROR;
    ModelStatus status = bring_up_to_date(instance, function);
    instance->progress.phase = status == MODEL_ERROR ? FAILED : STEPPING;
    return status;
}

ModelStatus do_step(Instance *instance, const char *function, double t, double h)
{
    Progress *progress = &instance->progress;
    if (check_phase(instance, function, STEPPING))
        return MODEL_ERROR;
    if (!(h > 0.0) || !isfinite(h))
        return refuse(instance, "%s: the communication step size is %.17g s; it must be positive.", function, h);
    /* a master may count n*h or add up h: both are met if the slack is far above rounding and far below a step */
    double slack = 1e-6 * h + 1e-12 * fabs(progress->time);
    if (!(fabs(t - progress->time) <= slack))
        return refuse(instance, "%s: the communication point is %.17g s, but the instance stands at %.17g s.", function,
                      t, progress->time);
    if (progress->stop_defined && t + h > progress->stop_time + slack)
        return refuse(instance, "%s: a step from %.17g s to %.17g s would pass the stop time %.17g s.", function, t,
                      t + h, progress->stop_time);
    ModelStatus status = model_step(&instance->model, t, h);
    if (status == MODEL_ERROR || check_outputs(instance, function)) {
        progress->phase = FAILED;
        return MODEL_ERROR;
    }
    progress->time = t + h;
    return status;
}

ModelStatus terminate(Instance *instance, const char *function)
{
    if (check_phase(instance, function, STEPPING | FAILED))
        return MODEL_ERROR;
    instance->progress.phase = TERMINATED;
    return MODEL_OK;
}

ModelStatus reset(Instance *instance)
{
    start_over(instance);
    return MODEL_OK;
}
