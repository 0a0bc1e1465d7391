/* What a model must provide to become an FMU. fmi2.c and fmi3.c know nothing else of it.
 *
 * A model's memory is plain old data: `Variables` (generated from variables.toml: every parameter, input and output)
 * followed by its own state. Copying those bytes is copying the FMU state. What is derived from
 * parameters or resources (tables, the road, a network) hangs off `derived`, holds nothing that one step leaves to
 * the next, and can be rebuilt. */
#ifndef MODEL_H
#define MODEL_H

#include <stddef.h>
#include "variables.h" /* generated: typedef struct {...} Variables; counts; start values */

/* Lets a compiler that can compare the values of a call with its format. */
#if defined(__GNUC__)
#define LIKE_PRINTF(text, first) __attribute__((format(printf, text, first)))
#else
#define LIKE_PRINTF(text, first)
#endif

typedef enum { MODEL_OK, MODEL_WARNING, MODEL_ERROR = 3 } ModelStatus; /* the numbers of both FMI versions */

typedef struct Model {
    Variables v;          /* parameters, inputs and outputs, by the names of variables.toml */
    void *state;          /* state_size bytes of plain old data, 64-byte aligned, owned by the FMI layer */
    size_t state_size;    /* model_load() sets it */
    char token[40];       /* what an importer must know the FMU by; model_load() may replace it */
    void *derived;        /* owned by the model: model_load() or model_prepare() builds it, model_release() frees it */
    const char *resources; /* absolute path of the FMU's resources directory, or "" */
    void *host;           /* the FMI layer's instance, for model_log() */
} Model;

/* At instantiation: says how large the state is, and reads what the FMU's resources fix for good. Nothing is
 * allocated after it but by model_prepare(). On an error it has said why. */
ModelStatus model_load(Model *m);

/* Parameters -> derived data; loads the road. Called when initialisation is left, and again when a state of
 * another parameterisation has been restored. Frees what an earlier call built. */
ModelStatus model_prepare(Model *m);

/* Initial state (static equilibrium) at the time `start` and the outputs that belong to it. */
ModelStatus model_initialise(Model *m, double start);

/* Advance from t to t + h with the inputs held; leaves the outputs of t + h in m->v. */
ModelStatus model_step(Model *m, double t, double h);

void model_release(Model *m);

/* Provided by the FMI layer: `category` is one of the categories declared in variables.toml. printf format. */
void model_log(const Model *m, ModelStatus status, const char *category, const char *format, ...)
    LIKE_PRINTF(4, 5);

#endif
