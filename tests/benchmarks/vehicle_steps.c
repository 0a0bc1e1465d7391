/* The vehicle model without FMI around it, for instruction counts: `vehicle_steps ROAD STEPS` rolls straight on from 20 m/s,
 * passive dampers, STEPS communication steps of 10 ms. */
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include "model.h"
#include "table.h"

void model_log(const Model *m, ModelStatus status, const char *category, const char *format, ...) {
    va_list values;
    (void)m, (void)status, (void)category;
    va_start(values, format);
    vfprintf(stderr, format, values);
    va_end(values);
    fputc('\n', stderr);
}

int main(int argc, char **argv) {
    static Model m;
    const int steps = argc == 3 ? atoi(argv[2]) : 0;
    m.v = model_start;
    model_load(&m);
    m.state = calloc(1, m.state_size);
    m.resources = "";
    if (!m.state || steps < 1 || (size_t)snprintf(m.v.Road_File, sizeof m.v.Road_File, "%s", argv[1]) >= sizeof m.v.Road_File) return 2;
    m.v.Init_Velocity = 20;
    m.v.Damp_Passive = 1;
    if (model_prepare(&m) || model_initialise(&m, 0.0)) return 1;
    for (int k = 0; k < steps; ++k)
        if (model_step(&m, 0.01 * k, 0.01)) return 1;
    printf("%.9f m\n", m.v.Car_tx);
    model_release(&m);
    free(m.state);
    return 0;
}
