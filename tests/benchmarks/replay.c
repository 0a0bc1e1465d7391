/* A master in C, for the benchmark: sets the recorded inputs and steps an FMI 3 instance that is ready to step.
 * Returns the number of steps that went well. */
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef int SetFloat64(void *, const uint32_t[], size_t, const double[], size_t);
typedef int DoStep(void *, double, double, bool, bool *, bool *, bool *, double *);

int replay(SetFloat64 *set, DoStep *step, void *instance, const uint32_t references[], const double *inputs, size_t count, int steps, double h) {
    bool event, ended, early;
    double last;
    for (int k = 0; k < steps; ++k) {
        if (set(instance, references, count, inputs + count * (size_t)k, count) > 1) return k;
        if (step(instance, k * h, h, true, &event, &ended, &early, &last) > 1) return k;
    }
    return steps;
}
