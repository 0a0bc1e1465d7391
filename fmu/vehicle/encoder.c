/* Wheel-speed sensors as a brake controller reads them: a ring with teeth, an edge per tooth, and a timer. The speed at a
 * communication point is the angle between the first and the last edge that have come since the edge used last, over the
 * time between them. It is thus the mean speed over about one communication step, half a step old: a moving average,
 * whose frequency response is |sin(pi f T) / (pi f T)|. */
#include "vehicle.h"

static const double FULL_TURN = 6.283185307179586;

static double tooth_pitch(const Variables *p) { return FULL_TURN / p->Sensor_WheelSpd_Teeth; }

void encoder_start(const Variables *p, Memory *m, const double spin[CORNERS]) {
    if (!encoder_is_on(p)) return;
    for (int i = 0; i < CORNERS; ++i) {
        m->edge[i] = m->used_edge[i] = floor(m->x.angle[i] / tooth_pitch(p));
        m->edge_speed[i] = spin[i];
    }
}

void encoder_step(const Variables *p, Memory *m, const double angle_before[CORNERS], double h) {
    const double pitch = tooth_pitch(p);
    for (int i = 0; i < CORNERS; ++i) {
        const double angle = m->x.angle[i], tooth = floor(angle / pitch), turned = angle - angle_before[i];
        m->edge_age[i] += h, m->used_age[i] += h;
        if (tooth == m->edge[i]) continue;
        const double passed = tooth > m->edge[i] ? tooth : tooth + 1; /* backwards, a tooth's far end comes last */
        m->edge[i] = tooth;
        m->edge_age[i] = clamp(h * (angle - passed * pitch) / turned, 0, h);
    }
}

/* Without a new edge the wheel turns slower than a tooth in the time since the last. */
void encoder_read(const Variables *p, Memory *m, double speed[CORNERS]) {
    const double pitch = tooth_pitch(p);
    for (int i = 0; i < CORNERS; ++i) {
        const double teeth = m->edge[i] - m->used_edge[i], time = m->used_age[i] - m->edge_age[i];
        if (teeth != 0 && time > 0) {
            m->edge_speed[i] = teeth * pitch / time;
            m->used_edge[i] = m->edge[i], m->used_age[i] = m->edge_age[i];
        } else if (m->edge_age[i] > 0) {
            m->edge_speed[i] = clamp(m->edge_speed[i], -pitch / m->edge_age[i], pitch / m->edge_age[i]);
        }
        speed[i] = m->edge_speed[i];
    }
}
