/* What FMI 2.0 and FMI 3.0 have in common: an instance, its phase, its variables and its saved states. fmi2.c and
 * fmi3.c translate names and types and add nothing else. */
#ifndef INSTANCE_H
#define INSTANCE_H

#include <stdbool.h>
#include <stddef.h>
#include "model.h"
#include "table.h"

#define ERROR_CATEGORY "logStatusError"
#define WARNING_CATEGORY "logStatusWarning"

/* Why an entry point of the standard is not available here. */
#define ONLY_CO_SIMULATION "this FMU is for co-simulation only."

typedef enum {
    INSTANTIATED = 1,
    INITIALIZATION = 2,
    STEPPING = 4,
    TERMINATED = 8,
    FAILED = 16, /* the model could not initialise or step: reset, restore a state or free */
} Phase;

typedef struct {
    double time, start_time, stop_time;
    int phase;
    int stop_defined;
    int experiment_set; /* FMI 2: fmi2SetupExperiment has been called */
    int outdated;       /* initial state and outputs do not follow from the present start values yet */
} Progress;

typedef struct Instance {
    Model model;
    Progress progress;
    Variables prepared; /* the variables model.derived was built for */
    bool is_prepared;
    bool category_enabled[MODEL_CATEGORIES];
    bool limited[MODEL_REALS]; /* inputs whose warning of a value beyond the range has been given */
    char *name;
    char *resources;
    void *memory; /* what model.state lies in */
    void *environment;
    void (*logger)(void); /* the importer's callback, of the type of its FMI version; may be NULL */
} Instance;

/* Provided by fmi2.c or fmi3.c: hands one finished message to the importer's logger; the characters that its version
 * of the standard wants doubled in a message. */
void deliver(const Instance *instance, ModelStatus status, const char *category, const char *message);
extern const char message_escapes[];

/* NULL if memory is short. Copies both strings. Before anything but refuse(), the instance must be loaded. */
Instance *instance_new(const char *name, const char *resources, void (*logger)(void), void *environment, bool logging);
ModelStatus instance_load(Instance *instance);
void instance_free(Instance *instance);

/* "dir/" -> "dir", in place: importers differ in whether the resources path ends with a separator. */
void strip_separator(char *path);

/* A sentence for the logger; they return MODEL_ERROR and MODEL_WARNING so that callers can `return refuse(...)`. */
ModelStatus refuse(const Instance *instance, const char *format, ...) LIKE_PRINTF(2, 3);
ModelStatus warn(const Instance *instance, const char *format, ...) LIKE_PRINTF(2, 3);

ModelStatus check_identity(const Instance *instance, const char *name, const char *token);
ModelStatus check_phase(const Instance *instance, const char *function, int allowed);
ModelStatus set_logging(Instance *instance, const char *function, bool on, size_t n, const char *const categories[]);

/* Reals: checked and copied. An input beyond its range acts at its limit, with one warning. */
ModelStatus get_reals(Instance *instance, const char *function, const unsigned vr[], size_t n, double values[]);
ModelStatus set_reals(Instance *instance, const char *function, const unsigned vr[], size_t n, const double values[]);

/* Booleans and strings, whose C types depend on the FMI version: the check comes first, the caller copies. Before
 * reading, outputs are brought up to date during initialisation; parameters and inputs can be read as soon as the
 * instance exists. Before writing, all values are checked, so that a refused call changes nothing. `values` is int[] or
 * bool[] (only looked at for NULL) or const char *[]. */
ModelStatus check_get(Instance *instance, const char *function, Kind kind, const unsigned vr[], size_t n,
                      const void *values);
ModelStatus check_set(Instance *instance, const char *function, Kind kind, const unsigned vr[], size_t n,
                      const void *values);
void *value_of(Instance *instance, Kind kind, unsigned vr);
void set_string(Instance *instance, unsigned vr, const char *value);

/* Builds derived data if the parameters it depends on have changed; then initial state and outputs if outdated. */
ModelStatus prepare_if_needed(Instance *instance);
ModelStatus bring_up_to_date(Instance *instance, const char *function);
ModelStatus check_outputs(Instance *instance, const char *function);

ModelStatus setup_experiment(Instance *instance, const char *function, double start, bool stop_defined, double stop);
ModelStatus exit_initialization(Instance *instance, const char *function);
ModelStatus do_step(Instance *instance, const char *function, double t, double h);
ModelStatus terminate(Instance *instance, const char *function);
ModelStatus reset(Instance *instance);

/* Saved states are plain bytes; the serialised form is the same bytes and a checksum. */
ModelStatus state_get(Instance *instance, const char *function, void **state);
ModelStatus state_set(Instance *instance, const char *function, const void *state);
ModelStatus state_free(Instance *instance, const char *function, void **state);
ModelStatus state_size(Instance *instance, const char *function, const void *state, size_t *size);
ModelStatus state_serialize(Instance *instance, const char *function, const void *state, void *bytes, size_t size);
ModelStatus state_deserialize(Instance *instance, const char *function, const void *bytes, size_t size, void **state);

#endif
