#include <string.h>

#include "stages.h"

enum { ALIGNMENT = 64, MOST_UNITS = 4096, MOST_SAMPLES = 4096 };

static uint32_t crc32(const unsigned char *at, size_t bytes) {
    uint32_t table[16], crc = 0xFFFFFFFFu;
    for (uint32_t i = 0; i < 16; ++i) {
        table[i] = i;
        for (int bit = 0; bit < 4; ++bit) table[i] = table[i] >> 1 ^ (table[i] & 1 ? 0xEDB88320u : 0);
    }
    for (size_t k = 0; k < bytes; ++k) {
        crc ^= at[k];
        crc = crc >> 4 ^ table[crc & 15];
        crc = crc >> 4 ^ table[crc & 15];
    }
    return ~crc;
}

static bool begins(const char *text, const char *with) {
    while (*with && *text == *with) ++text, ++with;
    return !*with;
}

static bool between(uint32_t x, uint32_t least, uint32_t most) { return x >= least && x <= most; }

static const char *fault(const Header *h, const void *blob, size_t bytes) {
    if ((uintptr_t)blob % ALIGNMENT) return "The packed network does not lie at an address that is a multiple of 64.";
    if (bytes < sizeof *h || !begins(h->magic, "VRELNET")) return "This is no packed network.";
    if (h->byte_order != 0x01020304u) return "The packed network was written for the other byte order.";
    if (h->version != PACKED_VERSION) return "The packed network is of another version than this sensor: pack it again.";
    if (h->bytes != bytes) return "The packed network has been cut short or prolonged.";
    if (crc32((const unsigned char *)&h->kind, bytes - offsetof(Header, kind)) != h->checksum)
        return "The packed network's bytes have been changed: its checksum is wrong.";
    if (h->kind > CARRIED || !between(h->units, 1, MOST_UNITS) || !between(h->hidden, 1, MOST_UNITS)) return "The packed network has a shape that cannot be.";
    if (h->kind == WINDOWED ? !between(h->window, 2, MOST_SAMPLES) : !between(h->front_units, 1, MOST_UNITS) || !between(h->leads, 1, MOST_SAMPLES) || !between(h->depth, 4, MOST_SAMPLES))
        return "The packed network has a shape that cannot be.";
    return NULL;
}

/* Sections follow each other, each at a multiple of 64 bytes; offsets go on past the end without harm, and are checked there. */
typedef struct {
    const unsigned char *blob;
    size_t offset;
} Place;

static const void *take(Place *place, size_t bytes) {
    const size_t offset = place->offset;
    place->offset += NETWORK_ROUND(bytes, ALIGNMENT);
    return place->blob + offset;
}

static const float *floats(Place *place, size_t count) { return take(place, count * sizeof(float)); }

static Layer layer(Place *place, size_t depth, size_t blocks, bool start) {
    Layer l = {NULL, NULL, depth, blocks};
    l.matrix = floats(place, blocks * depth * BLOCK);
    if (start) l.start = floats(place, blocks * BLOCK);
    return l;
}

static Readout four(Place *place, size_t width, bool start) {
    Readout r = {NULL, NULL, NETWORK_ROUND(width, BLOCK_UNITS)};
    r.weights = floats(place, WHEELS * r.width);
    if (start) r.start = floats(place, WHEELS);
    return r;
}

static void windowed_sections(Network *n, Place *place, bool residual) {
    const size_t blocks = n->padded / BLOCK_UNITS;
    if (residual) n->residual = take(place, sizeof(Residual));
    n->input_mean = floats(place, CHANNELS);
    n->input_std = floats(place, CHANNELS);
    n->output_mean = floats(place, WHEELS);
    n->output_std = floats(place, WHEELS);
    n->forward_input = layer(place, CHANNELS, blocks, true);
    n->backward_input = layer(place, CHANNELS, blocks, true);
    n->lstm = layer(place, n->units, blocks, false);
    n->dense = layer(place, 2 * n->padded, NETWORK_ROUND(n->hidden, BLOCK) / BLOCK, true);
    n->output = four(place, n->hidden, true);
}

static void carried_sections(Network *n, Place *place) {
    n->features = take(place, sizeof(Features));
    n->lead = floats(place, n->leads);
    n->feature_scale = floats(place, n->feature_count - DRIVING);
    n->input_mean = floats(place, n->feature_count);
    n->input_std = floats(place, n->feature_count);
    n->front = layer(place, n->feature_count, NETWORK_ROUND(n->front_units, BLOCK) / BLOCK, true);
    n->lstm = layer(place, n->front_units + n->units, n->padded / BLOCK_UNITS, true);
    n->dense = layer(place, n->units, NETWORK_ROUND(n->hidden, BLOCK) / BLOCK, true);
    n->output = four(place, n->hidden, true);
    n->deviation = four(place, n->hidden, true);
    n->straight = four(place, n->feature_count, false);
}

const char *network_open(Network *network, const void *blob, size_t bytes) {
    const Header *h = blob;
    const char *wrong = fault(h, blob, bytes);
    if (wrong) return wrong;
    Network n;
    memset(&n, 0, sizeof n);
    n.kernel = best_kernel();
    n.units = h->units, n.hidden = h->hidden, n.warm_up = h->warm_up;
    n.padded = NETWORK_ROUND(h->units, BLOCK_UNITS);
    n.window = h->kind == WINDOWED ? h->window : 1;
    n.front_units = h->front_units, n.leads = h->leads, n.depth = h->depth;
    n.feature_count = DRIVING + MOVING + DELAYED * n.leads;
    Place place = {blob, sizeof *h};
    if (h->kind == WINDOWED) windowed_sections(&n, &place, h->residual != 0);
    else carried_sections(&n, &place);
    if (place.offset != bytes) return "The packed network's shape and its size do not agree.";
    const Features *f = n.features;
    if (f && !(f->least_speed > 0 && f->age_least >= 0 && f->age_most <= (float)(n.depth - 3))) return "The packed network's features reach beyond its delay line.";
    *network = n;
    return NULL;
}
