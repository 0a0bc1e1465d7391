/* Constants of a packed file, laid out as sensor/packed/layout.py writes them. */
#ifndef PACKED_H
#define PACKED_H

#include "network.h"

enum { PACKED_VERSION = 1, WINDOWED = 0, CARRIED = 1 };
enum { LINE = 10, MEANS = 7, INTEGRALS = 3, DELAYED = 5, MOVING = MEANS + INTEGRALS + 2 * LINE, DRIVING = 13 };

/* The first 64 bytes. */
typedef struct {
    char magic[8];
    uint32_t byte_order, version;
    uint32_t bytes, checksum; /* of the file; CRC-32 of all that follows this number */
    uint32_t kind, window, units, hidden, residual;
    uint32_t front_units, leads, depth, warm_up, spare;
} Header;

/* Wheel-speed residuals as sensor/residual_matrices.py has them. */
typedef struct Residual {
    double wheels[CHANNELS][WHEELS], driving[CHANNELS][WHEELS], steering[CHANNELS][WHEELS], slip[CHANNELS][WHEELS];
    double spread[WHEELS][CHANNELS], others[CHANNELS], rolling[WHEELS], lowest, highest;
} Residual;

/* Constants of the carried network's features, sensor/carried. */
typedef struct Features {
    double largest[CHANNELS], wheel_y[WHEELS], axle[WHEELS], per_ay[WHEELS], per_ax;
    float slowest_rates[MEANS + 1], zeros_before[MEANS + 1];
    float typical[INTEGRALS], integral_keep[INTEGRALS], deviation_scale[WHEELS];
    float residual_least, residual_most, slip_least, slip_most, least_speed, least_energy, sample_time, wheelbase_samples;
    float age_least, age_most, speed_unit, slowness_unit, moving_least, moving_most;
    float scale, deviation_least, deviation_most;
} Features;

#endif
