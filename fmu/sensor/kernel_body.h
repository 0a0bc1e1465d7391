/* The kernel, in terms of a Vector of LANES numbers and a few operations on it, which the file that includes this one defines:
 * load, store, splat, plus, multiply, divide, times_plus (a b + c), limited (to +-most; a NaN stays one); ROWS, the rows whose gates the
 * registers hold; ROW_STRANDS, the sums side by side where there is one row only; WIDE and STRANDS, the vectors of a product and the sums of
 * each.
 *
 * A register tile holds all four gates of LANES units in `count` rows, so that the cell follows straight from registers: the sums
 * never see memory. */

#if defined(__clang__)
#define INLINE static inline __attribute__((always_inline))
#define UNROLLED _Pragma("unroll")
#elif defined(__GNUC__)
#define INLINE static inline __attribute__((always_inline))
#define UNROLLED _Pragma("GCC unroll 16")
#else
#define INLINE static inline
#define UNROLLED
#endif

#if defined(__GNUC__)
#define FETCH(address) __builtin_prefetch((address), 0, 2) /* into the second-level cache */
#else
#define FETCH(address) (void)(address)
#endif

#define GATES 4
#define HALF 2
#define CACHE_LINE 16 /* numbers */
#define PARTS (BLOCK_UNITS / LANES)
#define GATE_STEP (LANES < 8 ? 8 : LANES)

/* Where the first gate of a part of a block lies. */
INLINE size_t part_place(size_t part) { return LANES < 8 ? part / 2 * 32 + part % 2 * LANES : part * 4 * LANES; }

/* tanh x = x P(x^2) / Q(x^2) up to 9.02, where it is 1 to single precision: a minimax fit, 4e-8 off with these coefficients. The
 * quotient is left open, so that a cell needs two divisions instead of five. */
typedef struct {
    Vector over, under;
} Ratio;

INLINE Vector polynomial(Vector s, float c0, float c1, float c2, float c3, float c4) {
    Vector sum = times_plus(splat(c4), s, splat(c3));
    sum = times_plus(sum, s, splat(c2));
    sum = times_plus(sum, s, splat(c1));
    return times_plus(sum, s, splat(c0));
}

INLINE Ratio tanh_of(Vector given) {
    const Vector x = limited(given, 9.02f), s = multiply(x, x);
    Ratio r;
    r.over = multiply(x, polynomial(s, 1.0f, 0.133797169f, 0.00349403336f, 2.05834604e-05f, 1.33190436e-08f));
    r.under = polynomial(s, 1.0f, 0.467130333f, 0.0258710682f, 0.000328309077f, 7.7620075e-07f);
    return r;
}

/* 1 / (1 + exp(-x)) = (1 + tanh(x / 2)) / 2 */
INLINE Ratio opening_of(Vector given) {
    const Vector x = limited(given, 18.04f), s = multiply(x, x);
    Ratio r;
    r.under = polynomial(s, 1.0f, 0.467130333f / 4, 0.0258710682f / 16, 0.000328309077f / 64, 7.7620075e-07f / 256);
    const Vector odd = polynomial(s, 1.0f / 4, 0.133797169f / 16, 0.00349403336f / 64, 2.05834604e-05f / 256, 1.33190436e-08f / 1024);
    r.over = times_plus(x, odd, multiply(splat(0.5f), r.under));
    return r;
}

typedef struct {
    Vector gate[GATES]; /* input, forget, cell, output */
} Sums;

/* Vectors of 16 hold 8 units of two gates; PAIR takes the low or the high halves of two vectors. */
#ifdef PAIR
INLINE Sums sorted(Sums s) {
    const Sums by_gate = {{PAIR(s.gate[0], s.gate[2], LOW), PAIR(s.gate[0], s.gate[2], HIGH), PAIR(s.gate[1], s.gate[3], LOW),
                           PAIR(s.gate[1], s.gate[3], HIGH)}};
    return by_gate;
}
#else
INLINE Sums sorted(Sums s) { return s; }
#endif

/* The LSTM's output, from the new cell. */
INLINE Vector output_of(const Sums *s, Vector cell) {
    const Ratio open = opening_of(s->gate[3]), bent = tanh_of(cell);
    return divide(multiply(open.over, bent.over), multiply(open.under, bent.under));
}

INLINE void begin_cell(Sums gates, float *hidden, float *cell) {
    const Sums s = sorted(gates);
    const Ratio in = opening_of(s.gate[0]), news = tanh_of(s.gate[2]);
    const Vector c = divide(multiply(in.over, news.over), multiply(in.under, news.under));
    store(cell, c);
    store(hidden, output_of(&s, c));
}

INLINE void advance_cell(Sums gates, float *hidden, float *cell) {
    const Sums s = sorted(gates);
    const Ratio in = opening_of(s.gate[0]), keep = opening_of(s.gate[1]), news = tanh_of(s.gate[2]);
    const Vector under = multiply(in.under, news.under);
    const Vector gained = multiply(multiply(in.over, news.over), keep.under);
    const Vector over = times_plus(multiply(keep.over, load(cell)), under, gained);
    const Vector c = divide(over, multiply(keep.under, under));
    store(cell, c);
    store(hidden, output_of(&s, c));
}

/* A part of a block, for rows from the first one on. `soon` is what the next block needs, and `soon_step` is 0 once all of it has been
 * asked for: a large matrix comes from the third-level cache, and must be under way before it is needed. */
typedef struct {
    const float *matrix, *start, *input;
    size_t depth, input_step, step;
    float *hidden, *cell;
    const float *soon;
    size_t soon_step;
} Tile;

/* `vectors` are GATES, or HALF of them where the others belong to units that only fill the block. */
INLINE void advance_rows(const int count, const int vectors, Tile t) {
    Sums sum[ROWS];
    UNROLLED for (int r = 0; r < count; ++r) {
        UNROLLED for (int g = 0; g < GATES; ++g) sum[r].gate[g] = load(t.start + g * GATE_STEP);
    }
    for (size_t k = 0; k < t.depth; ++k, t.matrix += BLOCK, t.soon += t.soon_step) {
        Vector x[ROWS];
        FETCH(t.soon);
        UNROLLED for (int r = 0; r < count; ++r) x[r] = splat(t.input[r * t.input_step + k]);
        UNROLLED for (int g = 0; g < vectors; ++g) {
            const Vector weight = load(t.matrix + g * GATE_STEP);
            UNROLLED for (int r = 0; r < count; ++r) sum[r].gate[g] = times_plus(x[r], weight, sum[r].gate[g]);
        }
    }
    UNROLLED for (int r = 0; r < count; ++r) advance_cell(sum[r], t.hidden + r * t.step, t.cell + r * t.step);
}

/* One row waits for its own sums; in several strands it waits less. */
INLINE void advance_row(Tile t) {
    Sums sum[ROW_STRANDS];
    UNROLLED for (int g = 0; g < GATES; ++g) {
        sum[0].gate[g] = load(t.start + g * GATE_STEP);
        UNROLLED for (int s = 1; s < ROW_STRANDS; ++s) sum[s].gate[g] = splat(0.0f);
    }
    size_t k = 0;
    for (; k + ROW_STRANDS <= t.depth; k += ROW_STRANDS, t.matrix += ROW_STRANDS * BLOCK) {
        UNROLLED for (int s = 0; s < ROW_STRANDS; ++s) {
            const Vector x = splat(t.input[k + s]);
            UNROLLED for (int g = 0; g < GATES; ++g)
                sum[s].gate[g] = times_plus(x, load(t.matrix + s * BLOCK + g * GATE_STEP), sum[s].gate[g]);
        }
    }
    for (; k < t.depth; ++k, t.matrix += BLOCK) {
        const Vector x = splat(t.input[k]);
        UNROLLED for (int g = 0; g < GATES; ++g) sum[0].gate[g] = times_plus(x, load(t.matrix + g * GATE_STEP), sum[0].gate[g]);
    }
    UNROLLED for (int s = 1; s < ROW_STRANDS; ++s) {
        UNROLLED for (int g = 0; g < GATES; ++g) sum[0].gate[g] = plus(sum[0].gate[g], sum[s].gate[g]);
    }
    advance_cell(sum[0], t.hidden, t.cell);
}

INLINE void advance_tile(size_t count, const int vectors, const Tile *tile) {
    (void)vectors; /* where there is one row at a time */
    switch (count) {
    case 1: advance_row(*tile); break;
#if ROWS > 1
    case 2: advance_rows(2, vectors, *tile); break;
#endif
#if ROWS > 2
    case 3: advance_rows(3, vectors, *tile); break;
#endif
#if ROWS > 3
    case 4: advance_rows(4, vectors, *tile); break;
    case 5: advance_rows(5, vectors, *tile); break;
    case 6: advance_rows(6, vectors, *tile); break;
#endif
    default: break;
    }
}

static void advance_whole_tile(size_t count, const Tile *tile) { advance_tile(count, GATES, tile); }
#ifdef PAIR
static void advance_half_tile(size_t count, const Tile *tile) { advance_tile(count, HALF, tile); }
#endif

/* A tile of `units` units: a kernel whose vectors hold two gates leaves those out that only fill the block. */
static void advance_units(size_t units, size_t count, const Tile *tile) {
#ifdef PAIR
    if (units <= LANES / 2) {
        advance_half_tile(count, tile);
        return;
    }
#endif
    (void)units;
    advance_whole_tile(count, tile);
}

/* All rows of a part of a block, in tiles as equal as they can be. */
static void advance_part(Tile tile, size_t rows, size_t units) {
    const float *soon_end = tile.soon + tile.depth * BLOCK;
    for (size_t tiles = (rows + ROWS - 1) / ROWS; tiles > 0; --tiles) {
        const size_t count = (rows + tiles - 1) / tiles;
        advance_units(units, count, &tile);
        rows -= count;
        tile.input += count * tile.input_step;
        tile.hidden += count * tile.step;
        tile.cell += count * tile.step;
        tile.soon += tile.depth * tile.soon_step;
        if (tile.soon == soon_end) tile.soon = tile.matrix, tile.soon_step = 0;
    }
}

static void clear_part(size_t rows, float *hidden, size_t step) {
    for (size_t r = 0; r < rows; ++r) store(hidden + r * step, splat(0.0f));
}

static void advance(const Layer *layer, const float *start, const Rows *rows) {
    const size_t size = layer->depth * BLOCK;
    for (size_t b = 0; b < layer->blocks; ++b)
        for (size_t p = 0; p < PARTS; ++p) {
            const size_t unit = b * BLOCK_UNITS + p * LANES, next = b + 1 < layer->blocks ? b + 1 : 0;
            if (unit >= rows->units) {
                clear_part(rows->count, rows->hidden + unit, rows->step);
                continue;
            }
            const Tile tile = {layer->matrix + b * size + part_place(p), start + b * BLOCK + part_place(p), rows->input, layer->depth,
                               rows->input_step, rows->step, rows->hidden + unit, rows->cell + unit, layer->matrix + next * size,
                               p ? 0 : CACHE_LINE};
            advance_part(tile, rows->count, rows->units - unit);
        }
}

static void begin(size_t blocks, const float *gates, float *hidden, float *cell) {
    for (size_t b = 0; b < blocks; ++b)
        for (size_t p = 0; p < PARTS; ++p) {
            Sums s;
            UNROLLED for (int g = 0; g < GATES; ++g) s.gate[g] = load(gates + b * BLOCK + part_place(p) + g * GATE_STEP);
            begin_cell(s, hidden + b * BLOCK_UNITS + p * LANES, cell + b * BLOCK_UNITS + p * LANES);
        }
}

/* WIDE vectors of a block at a time, in STRANDS sums each. */
INLINE void product_part(const float *m, const float *start, const float *input, size_t depth, float *sums) {
    Vector sum[STRANDS][WIDE];
    UNROLLED for (int v = 0; v < WIDE; ++v) {
        sum[0][v] = load(start + v * LANES);
        UNROLLED for (int s = 1; s < STRANDS; ++s) sum[s][v] = splat(0.0f);
    }
    size_t k = 0;
    for (; k + STRANDS <= depth; k += STRANDS, m += STRANDS * BLOCK) {
        UNROLLED for (int s = 0; s < STRANDS; ++s) {
            const Vector x = splat(input[k + s]);
            UNROLLED for (int v = 0; v < WIDE; ++v) sum[s][v] = times_plus(x, load(m + s * BLOCK + v * LANES), sum[s][v]);
        }
    }
    for (; k < depth; ++k, m += BLOCK) {
        const Vector x = splat(input[k]);
        UNROLLED for (int v = 0; v < WIDE; ++v) sum[0][v] = times_plus(x, load(m + v * LANES), sum[0][v]);
    }
    UNROLLED for (int v = 0; v < WIDE; ++v) {
        UNROLLED for (int s = 1; s < STRANDS; ++s) sum[0][v] = plus(sum[0][v], sum[s][v]);
        store(sums + v * LANES, sum[0][v]);
    }
}

static void product(const Layer *layer, const float *input, float *sums) {
    for (size_t b = 0; b < layer->blocks; ++b)
        for (size_t l = 0; l < BLOCK; l += WIDE * LANES)
            product_part(layer->matrix + b * layer->depth * BLOCK + l, layer->start + b * BLOCK + l, input, layer->depth, sums + b * BLOCK + l);
}

static void bend(size_t count, float *values) {
    for (size_t i = 0; i < count; i += LANES) {
        const Ratio r = tanh_of(load(values + i));
        store(values + i, divide(r.over, r.under));
    }
}

static void open(size_t count, float *values) {
    for (size_t i = 0; i < count; i += LANES) {
        const Ratio r = opening_of(load(values + i));
        store(values + i, divide(r.over, r.under));
    }
}
