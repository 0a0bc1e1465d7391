/* The variable table that the build generates from variables.toml (variables.c), as the FMI layer sees it. */
#ifndef TABLE_H
#define TABLE_H

#include <stddef.h>
#include "variables.h" /* generated */

typedef enum { KIND_REAL, KIND_BOOLEAN, KIND_STRING } Kind;

typedef enum { PARAMETER_FIXED, PARAMETER_TUNABLE, INPUT, OUTPUT, INDEPENDENT } Role;

typedef struct {
    const char *name;
    const char *unit; /* "" where there is none */
    size_t offset;    /* of the value inside Variables */
    Role role;
    double min, max;  /* +-INFINITY where variables.toml gives no limit */
    int can_be_missing; /* an input that is NaN or infinite where there is no value */
} VariableInfo;

typedef struct {
    const VariableInfo *rows;
    size_t count;
    unsigned first; /* value reference of rows[0]; the others follow without gaps */
} VariableTable;

extern const VariableTable model_tables[3]; /* by Kind */
extern const Variables model_start;
extern const char *const model_categories[MODEL_CATEGORIES];
extern const char model_token[]; /* GUID of FMI 2, instantiation token of FMI 3 */

#define TIME_REFERENCE 999999u /* FMI 3's independent variable */

#endif
