/* Saved states: what an instance is, as one run of plain bytes. */
#include "instance.h"

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    char token[64]; /* whose bytes these are */
    uint64_t checksum; /* of all that follows, in serialised bytes; 0 in memory */
    Progress progress;
    Variables v;
    unsigned char state[]; /* model.state_size bytes */
} Saved;

static size_t saved_size(const Instance *instance)
{
    return sizeof(Saved) + instance->model.state_size;
}

/* FNV-1a: a file that was cut, edited or filled with something else does not pass. */
static uint64_t checksum(const unsigned char *bytes, size_t size)
{
    uint64_t hash = 14695981039346656037u;
    for (size_t i = 0; i < size; i++)
        hash = (hash ^ bytes[i]) * 1099511628211u;
    return hash;
}

static uint64_t checksum_of(const Instance *instance, const unsigned char *saved)
{
    const size_t begin = offsetof(Saved, progress);
    return checksum(saved + begin, saved_size(instance) - begin);
}

static ModelStatus check_ours(const Instance *instance, const char *function, const void *state)
{
    if (!state || strncmp(state, instance->model.token, sizeof((Saved *)0)->token) != 0)
        return refuse(instance, "%s: this is not a state of " MODEL_NAME ".", function);
    return MODEL_OK;
}

/* Memory for a state: the given one, which must be ours, or if that is NULL new. calloc, so that padding is the same
 * bytes each time. */
static Saved *room(const Instance *instance, const char *function, void **state)
{
    if (!state) {
        refuse(instance, "%s: the pointer for the state is null.", function);
        return NULL;
    }
    if (*state)
        return check_ours(instance, function, *state) ? NULL : *state;
    Saved *saved = calloc(1, saved_size(instance));
    if (!saved)
        refuse(instance, "%s: no memory for a state of %zu bytes.", function, saved_size(instance));
    return saved;
}

ModelStatus state_get(Instance *instance, const char *function, void **state)
{
    Saved *saved = room(instance, function, state);
    if (!saved)
        return MODEL_ERROR;
    strncpy(saved->token, instance->model.token, sizeof saved->token - 1);
    memcpy(&saved->progress, &instance->progress, sizeof saved->progress);
    memcpy(&saved->v, &instance->model.v, sizeof saved->v);
    memcpy(saved->state, instance->model.state, instance->model.state_size);
    *state = saved;
    return MODEL_OK;
}

static void restore(Instance *instance, const Saved *saved)
{
    memcpy(&instance->progress, &saved->progress, sizeof saved->progress);
    memcpy(&instance->model.v, &saved->v, sizeof saved->v);
    memcpy(instance->model.state, saved->state, instance->model.state_size);
}

ModelStatus state_set(Instance *instance, const char *function, const void *state)
{
    const Saved *saved = state;
    if (check_ours(instance, function, state))
        return MODEL_ERROR;
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
    if (!state || !*state) /* as the standard has it for NULL: nothing happens */
        return MODEL_OK;
    if (check_ours(instance, function, *state))
        return MODEL_ERROR;
    free(*state);
    *state = NULL;
    return MODEL_OK;
}

ModelStatus state_size(Instance *instance, const char *function, const void *state, size_t *size)
{
    if (check_ours(instance, function, state))
        return MODEL_ERROR;
    if (!size)
        return refuse(instance, "%s: the pointer for the size is null.", function);
    *size = saved_size(instance);
    return MODEL_OK;
}

ModelStatus state_serialize(Instance *instance, const char *function, const void *state, void *bytes, size_t size)
{
    if (check_ours(instance, function, state))
        return MODEL_ERROR;
    if (!bytes || size < saved_size(instance))
        return refuse(instance, "%s: the buffer has %zu bytes, a state needs %zu.", function, bytes ? size : 0,
                      saved_size(instance));
    const uint64_t sum = checksum_of(instance, state);
    memcpy(bytes, state, saved_size(instance));
    memcpy((char *)bytes + offsetof(Saved, checksum), &sum, sizeof sum);
    return MODEL_OK;
}

ModelStatus state_deserialize(Instance *instance, const char *function, const void *bytes, size_t size, void **state)
{
    uint64_t sum;
    if (!bytes || size != saved_size(instance) || strncmp(bytes, instance->model.token, sizeof((Saved *)0)->token) != 0)
        return refuse(instance, "%s: these %zu bytes are not a serialised state of this build of " MODEL_NAME ".",
                      function, bytes ? size : 0);
    memcpy(&sum, (const char *)bytes + offsetof(Saved, checksum), sizeof sum);
    if (sum != checksum_of(instance, bytes))
        return refuse(instance, "%s: these %zu bytes are a damaged state of " MODEL_NAME ".", function, size);
    Saved *saved = room(instance, function, state);
    if (!saved)
        return MODEL_ERROR;
    memcpy(saved, bytes, size);
    saved->checksum = 0;
    *state = saved;
    return MODEL_OK;
}
