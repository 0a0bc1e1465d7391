/* The sensor as the FMI layer sees it. It takes a sample every 10 ms of its own, whatever the master's step is; the
 * network is in network.h. */
#include "sensor.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "table.h"

static const char network_file[] = "network.bin";

/* The struct of all variables begins with the reals in the order of their value references: channels, commands. */
static const double *channels_of(const Model *m) { return (const double *)&m->v; }
static const double *command_of(const Model *m) { return m->v.Car_SuspControl_Damper_CtrlOut; }
static void *network_state(const Model *m) { return (char *)m->state + NETWORK_STATE_AT; }

/* --- the network's file -------------------------------------------------------------------------------------- */

static ModelStatus refuse_file(const Model *m, const char *why)
{
    model_log(m, MODEL_ERROR, "logStatusError",
              "The sensor cannot be instantiated: %s/%s: %s `cosim pack` puts a network into the FMU's resources.",
              m->resources, network_file, why);
    return MODEL_ERROR;
}

/* Another network is another FMU: the second half of the token is a checksum (FNV-1a) of the file's header, which has a
 * checksum of all the rest. */
static void identify(Model *m, const unsigned char *header)
{
    uint64_t hash = 14695981039346656037u;
    for (int i = 0; i < 64; i++)
        hash = (hash ^ header[i]) * 1099511628211u;
    snprintf(m->token + 20, sizeof m->token - 20, "%04x-%06lx%06lx}", (unsigned)(hash >> 48),
             (unsigned long)(hash >> 24 & 0xffffff), (unsigned long)(hash & 0xffffff));
}

static ModelStatus load(Model *m, Sensor *sensor)
{
    char path[4096];
    const char *why = NULL;
    size_t size = 0;

    if ((size_t)snprintf(path, sizeof path, "%s/%s", m->resources, network_file) >= sizeof path)
        return refuse_file(m, "The path is too long.");
    sensor->blob = read_blob(path, &size, &sensor->blob_memory, &why);
    if (!sensor->blob)
        return refuse_file(m, why);
    why = network_open(&sensor->network, sensor->blob, size);
    if (why)
        return refuse_file(m, why);
    sensor->scratch = aligned_room(network_scratch_bytes(&sensor->network), &sensor->scratch_memory);
    if (!sensor->scratch)
        return refuse_file(m, "Memory is short.");
    m->state_size = NETWORK_STATE_AT + network_state_bytes(&sensor->network);
    identify(m, sensor->blob);
    return MODEL_OK;
}

ModelStatus model_load(Model *m)
{
    m->derived = calloc(1, sizeof(Sensor));
    return m->derived ? load(m, m->derived) : refuse_file(m, "Memory is short.");
}

ModelStatus model_prepare(Model *m)
{
    (void)m; /* nothing depends on parameters */
    return MODEL_OK;
}

void model_release(Model *m)
{
    Sensor *sensor = m->derived;
    if (sensor) {
        free(sensor->blob_memory);
        free(sensor->scratch_memory);
    }
    free(sensor);
    m->derived = NULL;
}

/* --- samples ------------------------------------------------------------------------------------------------- */

ModelStatus model_initialise(Model *m, double start)
{
    const Sensor *sensor = m->derived;
    Sampling *s = m->state;
    s->start = start;
    memcpy(s->command, command_of(m), sizeof s->command);
    network_reset(&sensor->network, network_state(m));
    return MODEL_OK;
}

/* Notes which channels have a value, and names those that have lost theirs, once in each gap. */
static void look(const Model *m, Sampling *s, double t)
{
    const double *channel = channels_of(m);
    uint32_t lacking = 0;
    for (unsigned i = 0; i < CHANNELS; i++) {
        const uint32_t bit = (uint32_t)1 << i;
        if (isfinite(channel[i])) {
            s->held[i] = channel[i];
            s->seen |= bit;
            continue;
        }
        lacking |= bit;
        if (!(s->lacking & bit))
            model_log(m, MODEL_OK, "logChannels", "%s is %g at t = %.9g s: no estimate counts until it is back for good.",
                      model_tables[KIND_REAL].rows[i].name, channel[i], t);
    }
    s->lacking = lacking;
}

/* A window forgets a sample that lacks a value, and all before it. A state that is carried on would not: it is bridged
 * with the last value of each channel, as sensor/missing.py does, and has to settle after a long gap. */
static bool estimate_now(const Model *m, const double command[COMMANDS], double estimate[WHEELS],
                         double deviation[WHEELS])
{
    Sensor *sensor = m->derived;
    Sampling *s = m->state;
    const bool carried = sensor->network.window == 1;
    if (carried && s->seen != ((uint32_t)1 << CHANNELS) - 1)
        return false;
    s->gap = s->lacking ? s->gap + (s->gap < INT32_MAX) : 0;
    s->waiting -= s->waiting > 0;
    if (carried && s->gap > LONGEST_GAP)
        s->waiting = SETTLING;
    const bool counts = network_step(&sensor->network, network_state(m), sensor->scratch,
                                     carried ? s->held : channels_of(m), command, estimate, deviation, NULL);
    return counts && !s->lacking && s->waiting == 0;
}

static void take_sample(Model *m, const double command[COMMANDS], double t)
{
    double estimate[WHEELS], deviation[WHEELS];
    look(m, m->state, t);
    const bool counts = estimate_now(m, command, estimate, deviation);
    if (counts && !m->v.Sensor_Valid)
        model_log(m, MODEL_OK, "logChannels", "The estimates count from t = %.9g s on.", t);
    m->v.Sensor_Valid = counts;
    if (!counts)
        return; /* the last ones stay */
    memcpy(m->v.VRel, estimate, sizeof estimate);
    memcpy(m->v.VRel_Deviation, deviation, sizeof deviation);
}

static void count_missed(Model *m, double missed, double h)
{
    if (m->v.Sensor_MissedSamples == 0.0)
        model_log(m, MODEL_OK, "logSampling",
                  "A step of %g s has more than one sample of %g s in it, which get the same values: step by %g s or "
                  "less. This is said once; Sensor.MissedSamples counts the samples that were missed.",
                  h, SAMPLE_PERIOD, SAMPLE_PERIOD);
    m->v.Sensor_MissedSamples += missed;
}

/* Samples are counted, so that no rounding of the master's time adds up; one that falls on the end of a step to within
 * a thousandth of it belongs to the next. A sample reads the channels as they are held over the step that it falls
 * into, and the command that the dampers held until it. */
ModelStatus model_step(Model *m, double t, double h)
{
    Sampling *s = m->state;
    const double slack = 1e-3 * h;
    const double due = ceil((t + h - slack - s->start) * SAMPLES_PER_SECOND) - (double)s->next;
    if (due > 1e9) {
        model_log(m, MODEL_ERROR, "logStatusError", "A step of %g s has %g samples of %g s in it; there may be 1e9.", h,
                  due, SAMPLE_PERIOD);
        return MODEL_ERROR;
    }
    if (due > 1.0)
        count_missed(m, due - 1.0, h);
    for (int64_t left = (int64_t)due; left > 0; left--, s->next++) {
        const double sampled = s->start + (double)s->next / SAMPLES_PER_SECOND;
        take_sample(m, sampled - t > slack ? command_of(m) : s->command, sampled);
    }
    memcpy(s->command, command_of(m), sizeof s->command);
    return MODEL_OK;
}
