/* Saved states: what an instance is, as one run of plain bytes. */
#include "instance.h"

#include <stdlib.h>
#include <string.h>

typedef struct {
    char token[64]; /* whose bytes these are */
    Progress progress;
    Variables v;
    unsigned char state[]; /* model_state_size bytes */
} Saved;

static size_t saved_size(void)
{
    return sizeof(Saved) + model_state_size;
}

static bool is_ours(const Saved *saved)
{
    return strncmp(saved->token, model_token, sizeof saved->token) == 0;
}

/* calloc, so that padding is the same bytes each time */
static Saved *allocate(const Instance *instance, const char *function)
{
    Saved *saved = calloc(1, saved_size());
    if (!saved)
        refuse(instance, "%s: no memory for a state of %zu bytes.", function, saved_size());
    return saved;
}

ModelStatus state_get(Instance *instance, const char *function, void **state)
{
    if (!state)
        return refuse(instance, "%s: the pointer for the state is null.", function);
    Saved *saved = *state ? *state : allocate(instance, function);
    if (!saved)
        return MODEL_ERROR;
    strncpy(saved->token, model_token, sizeof saved->token - 1);
    memcpy(&saved->progress, &instance->progress, sizeof saved->progress);
    memcpy(&saved->v, &instance->model.v, sizeof saved->v);
    memcpy(saved->state, instance->model.state, model_state_size);
    *state = saved;
    return MODEL_OK;
}

static void restore(Instance *instance, const Saved *saved)
{
    memcpy(&instance->progress, &saved->progress, sizeof saved->progress);
    memcpy(&instance->model.v, &saved->v, sizeof saved->v);
    memcpy(instance->model.state, saved->state, model_state_size);
}

ModelStatus state_set(Instance *instance, const char *function, const void *state)
{
    const Saved *saved = state;
    if (!saved || !is_ours(saved))
        return refuse(instance, "%s: this is not a state of " MODEL_NAME ".", function);
    restore(instance, saved);
    if (saved->progress.outdated) /* not initialised yet: derived data will be built when it is */
        return MODEL_OK;
    ModelStatus status = prepare_if_needed(instance);
    restore(instance, saved); /* bit for bit, whatever model_prepare wrote */
    if (status == MODEL_ERROR)
        instance->progress.phase = FAILED;
    return status;
}

ModelStatus state_free(Instance *instance, const char *function, void **state)
{
    if (!state)
        return refuse(instance, "%s: the pointer to the state is null.", function);
    free(*state);
    *state = NULL;
    return MODEL_OK;
}

ModelStatus state_size(Instance *instance, const char *function, const void *state, size_t *size)
{
    if (!state || !is_ours(state))
        return refuse(instance, "%s: this is not a state of " MODEL_NAME ".", function);
    *size = saved_size();
    return MODEL_OK;
}

ModelStatus state_serialize(Instance *instance, const char *function, const void *state, void *bytes, size_t size)
{
    if (!state || !is_ours(state))
        return refuse(instance, "%s: this is not a state of " MODEL_NAME ".", function);
    if (!bytes || size < saved_size())
        return refuse(instance, "%s: the buffer has %zu bytes, a state needs %zu.", function, size, saved_size());
    memcpy(bytes, state, saved_size());
    return MODEL_OK;
}

ModelStatus state_deserialize(Instance *instance, const char *function, const void *bytes, size_t size, void **state)
{
    if (!bytes || !state)
        return refuse(instance, "%s: a pointer is null.", function);
    if (size != saved_size() || strncmp(bytes, model_token, sizeof((Saved *)0)->token) != 0)
        return refuse(instance, "%s: these %zu bytes are not a serialised state of this build of " MODEL_NAME ".", function,
                      size);
    Saved *saved = *state ? *state : allocate(instance, function);
    if (!saved)
        return MODEL_ERROR;
    memcpy(saved, bytes, size);
    *state = saved;
    return MODEL_OK;
}
