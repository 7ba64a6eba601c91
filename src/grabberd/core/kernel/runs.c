/* Runs of set pixels, found in the packed bits, each with the number of what it is connected with (as labelling.py). */
#include "runs.h"

enum { WORD_BYTES = 8, WORD_BITS = 64, RUNS_A_BYTE = 4, BLOCK_BYTES = 32 };
typedef uint64_t Block __attribute__((vector_size(BLOCK_BYTES)));

INLINE uint64_t word_at(const uint8_t *bytes, int64_t count) {
    uint64_t word = 0;
    if (count >= WORD_BYTES) {
        memcpy(&word, bytes, WORD_BYTES);
#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
        return __builtin_bswap64(word);
#else
        return word;
#endif
    }
    for (int64_t i = 0; i < count; i++) word |= (uint64_t)bytes[i] << (56 - 8 * i);
    return word;
}

INLINE Block block_at(const uint8_t *bytes) {
    Block block;
    memcpy(&block, bytes, sizeof block);
    return block;
}

/* Most rows have nothing, and are not looked at word by word. */
static bool is_blank(const uint8_t *bytes, int64_t stride) {
    if (stride < BLOCK_BYTES) {
        uint8_t any = 0;
        for (int64_t at = 0; at < stride; at++) any |= bytes[at];
        return !any;
    }
    Block any = block_at(bytes + stride - BLOCK_BYTES);
    for (int64_t at = 0; at + BLOCK_BYTES < stride; at += BLOCK_BYTES) any |= block_at(bytes + at);
    return !(any[0] | any[1] | any[2] | any[3]);
}

/* The pixels of a word that differ from the one before. */
INLINE uint64_t edges_of(uint64_t word, uint64_t before) { return word ^ (word >> 1 | before << (WORD_BITS - 1)); }

/* Edges are first pixels of runs and, by turns, the ones after their last. */
INLINE void put_edge(Run *runs, int64_t edge, int32_t row, int32_t column) {
    Run *run = runs + (edge >> 1);
    if (edge & 1) run->last = column - 1;
    else *run = (Run){row, column, column, 0};
}

/* Writes the runs of a row; how many. */
static int64_t runs_in(const uint8_t *bytes, int64_t stride, int32_t row, Run *runs) {
    int64_t edge = 0;
    for (int64_t at = 0; at < stride; at += WORD_BYTES) {
        uint64_t word = word_at(bytes + at, stride - at), before = (uint64_t)edge & 1;
        if (!(word | before)) continue;
        for (uint64_t edges = edges_of(word, before); edges; edge++) {
            int bit = __builtin_clzll(edges);
            edges ^= UINT64_C(1) << (WORD_BITS - 1 - bit);
            put_edge(runs, edge, row, (int32_t)(8 * at + bit));
        }
    }
    if (edge & 1) put_edge(runs, edge++, row, (int32_t)(8 * stride));
    return edge / 2;
}

static bool make_room(int64_t more, FoundRuns *found) {
    if (found->count + more <= found->room) return true;
    int64_t room = 2 * found->room + more;
    Run *runs = realloc(found->runs, (size_t)room * sizeof *runs);
    if (runs) found->runs = runs;
    int32_t *parent = realloc(found->parent, (size_t)room * sizeof *parent);
    if (parent) found->parent = parent;
    if (!runs || !parent) return false;
    found->room = room;
    return true;
}

static int32_t root_of(int32_t *parent, int32_t number) {
    while (parent[number] != number) number = parent[number] = parent[parent[number]];
    return number;
}

static void unite(int32_t *parent, int32_t one, int32_t other) {
    one = root_of(parent, one), other = root_of(parent, other);
    if (one < other) parent[other] = one;
    else parent[one] = other;
}

/* Numbers a row's runs by those of the row above, from `above` on: diagonal neighbours are connected. */
static void connect(int64_t above, int64_t begin, int64_t end, FoundRuns *found) {
    Run *runs = found->runs;
    for (int64_t i = begin; i < end; i++) {
        int32_t first = runs[i].first - 1, last = runs[i].last + 1;
        while (above < begin && runs[above].last < first) above++;
        if (above < begin && runs[above].first <= last) {
            runs[i].label = runs[above].label;
            for (int64_t j = above + 1; j < begin && runs[j].first <= last; j++) unite(found->parent, runs[i].label, runs[j].label);
        } else {
            runs[i].label = found->parent[found->numbers] = (int32_t)found->numbers;
            found->numbers++;
        }
    }
}

/* Runs were numbered before all was known: from here on by their components, in the order of these' first runs. */
static void settle_numbers(FoundRuns *found) {
    int32_t *parent = found->parent, components = 0;
    for (int64_t i = 0; i < found->numbers; i++) parent[i] = parent[i] == i ? components++ : parent[parent[i]];
    for (int64_t i = 0; i < found->count; i++) found->runs[i].label = parent[found->runs[i].label];
    found->components = components;
}

int find_runs(const Picture *picture, FoundRuns *found) {
    int64_t above = 0;
    *found = (FoundRuns){0};
    for (int64_t row = 0; row < picture->rows; row++) {
        const uint8_t *bytes = picture->bits + row * picture->stride;
        int64_t begin = found->count;
        if (!is_blank(bytes, picture->stride)) {
            if (!make_room(RUNS_A_BYTE * picture->stride, found)) return NO_MEMORY;
            found->count += runs_in(bytes, picture->stride, (int32_t)row, found->runs + begin);
            connect(above, begin, found->count, found);
        }
        above = begin;
    }
    settle_numbers(found);
    return DONE;
}
