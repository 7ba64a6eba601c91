/* Runs of set pixels, found in the packed bits, and their connected components (as runs.py, labels.py). */
#include "kernel.h"

INLINE uint64_t word_at(const uint8_t *bytes, int64_t count) {
    uint64_t word = 0;
    if (count >= 8) {
        memcpy(&word, bytes, 8);
#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
        return __builtin_bswap64(word);
#else
        return word;
#endif
    }
    for (int64_t i = 0; i < count; i++) word |= (uint64_t)bytes[i] << (56 - 8 * i);
    return word;
}

/* The pixels of a word that differ from the one before. */
INLINE uint64_t edges_of(uint64_t word, uint64_t before) { return word ^ (word >> 1 | before << 63); }

/* Runs as they are found, with room for more. */
typedef struct {
    Run *runs;
    int64_t count, room;
} Found;

static bool make_room(Found *found) {
    int64_t room = found->room ? 2 * found->room : 2048;
    Run *more = realloc(found->runs, (size_t)room * sizeof *more);
    if (!more) return false;
    found->runs = more, found->room = room;
    return true;
}

static bool find_in_row(const uint8_t *bytes, int64_t stride, int32_t row, Found *found) {
    uint64_t before = 0;
    for (int64_t at = 0; at < stride; at += 8) {
        uint64_t word = word_at(bytes + at, stride - at);
        if (!(word | before)) continue;
        for (uint64_t edges = edges_of(word, before); edges;) {
            int bit = __builtin_clzll(edges);
            int32_t column = (int32_t)(8 * at + bit);
            edges &= ~(UINT64_C(1) << (63 - bit));
            before ^= 1;
            if (!before) found->runs[found->count++].last = column - 1;
            else if (found->count < found->room || make_room(found))
                found->runs[found->count] = (Run){row, column, column, 0};
            else return false;
        }
    }
    if (before) found->runs[found->count++].last = (int32_t)(8 * stride - 1);
    return true;
}

static int find_runs(const Picture *picture, Found *found) {
    for (int64_t row = 0; row < picture->rows; row++)
        if (!find_in_row(picture->bits + row * picture->stride, picture->stride, (int32_t)row, found)) return NO_MEMORY;
    return DONE;
}

static int32_t root_of(int32_t *parent, int32_t run) {
    while (parent[run] != run) run = parent[run] = parent[parent[run]];
    return run;
}

static void unite(int32_t *parent, int32_t one, int32_t other) {
    one = root_of(parent, one);
    other = root_of(parent, other);
    if (one < other) parent[other] = one;
    else parent[one] = other;
}

/* Diagonal neighbours are connected; every root is its component's first run. */
static void connect(const Run *runs, int64_t count, int32_t *parent) {
    int64_t above = 0, row_begin = 0, row_end = 0;
    for (int64_t i = 0; i < count; i++) {
        if (i == 0 || runs[i].row != runs[i - 1].row) {
            bool adjoining = i > 0 && runs[i - 1].row + 1 == runs[i].row;
            above = adjoining ? row_begin : i;
            row_begin = row_end = i;
        }
        parent[i] = (int32_t)i;
        while (above < row_end && runs[above].last < runs[i].first - 1) above++;
        for (int64_t j = above; j < row_end && runs[j].first <= runs[i].last + 1; j++)
            unite(parent, (int32_t)i, (int32_t)j);
    }
}

static int64_t number(Run *runs, int64_t count, int32_t *parent) {
    int32_t labels = 0;
    for (int64_t i = 0; i < count; i++) {
        int32_t root = root_of(parent, (int32_t)i);
        runs[i].label = root == i ? labels++ : runs[root].label;
    }
    return labels;
}

static void order_by_component(const Run *from, int64_t count, Run *to, Component *components, int64_t labels) {
    for (int64_t i = 0; i < count; i++) components[from[i].label].count++;
    int32_t begin = 0;
    for (int64_t i = 0; i < labels; i++) {
        components[i].begin = begin;
        begin += components[i].count;
        components[i].count = 0;
    }
    for (int64_t i = 0; i < count; i++) {
        Component *own = components + from[i].label;
        to[own->begin + own->count++] = from[i];
    }
}

static void shape(const Picture *picture, const Settings *settings, const Run *runs, Component *own) {
    int64_t across = 0, down = 0;
    const Run *run = runs + own->begin;
    own->first_row = run->row;
    own->last_row = run[own->count - 1].row;
    own->first_column = run->first;
    own->last_column = run->last;
    for (int32_t i = 0; i < own->count; i++, run++) {
        int64_t length = run->last - run->first + 1;
        own->pixels += length;
        across += length * (run->first + run->last);
        down += length * run->row;
        if (run->first < own->first_column) own->first_column = run->first;
        if (run->last > own->last_column) own->last_column = run->last;
    }
    own->x = (double)across / (double)(2 * own->pixels);
    own->row = (double)down / (double)own->pixels;
    own->area_px = (double)own->pixels * (double)picture->y_step;
    double diameter = sqrt(4 / PI * own->area_px);
    double height = (double)((own->last_row - own->first_row + 1) * picture->y_step);
    own->at_border = own->first_row == 0 || own->last_row == picture->rows - 1 || own->first_column == 0 ||
                     own->last_column == picture->columns - 1;
    own->of_size = diameter >= settings->min_diameter_px && diameter <= settings->max_diameter_px;
    own->low = own->of_size && height <= 2.0 * settings->max_diameter_px;
    own->whole = own->low && !own->at_border;
}

static int connect_all(const Picture *picture, const Settings *settings, const Found *found, Seen *seen) {
    size_t count = (size_t)found->count;
    int32_t *parent = malloc(count * sizeof *parent);
    seen->runs = malloc(count * sizeof *seen->runs);
    if (parent && seen->runs) {
        connect(found->runs, found->count, parent);
        seen->component_count = number(found->runs, found->count, parent);
        seen->components = calloc((size_t)seen->component_count, sizeof *seen->components);
    }
    free(parent);
    if (!seen->components) {
        seen->component_count = 0;
        return NO_MEMORY;
    }
    order_by_component(found->runs, found->count, seen->runs, seen->components, seen->component_count);
    for (int64_t i = 0; i < seen->component_count; i++) shape(picture, settings, seen->runs, seen->components + i);
    return DONE;
}

int find_components(const Picture *picture, const Settings *settings, Seen *seen) {
    Found found = {0};
    int status = find_runs(picture, &found);
    *seen = (Seen){.run_count = found.count};
    if (status == DONE && found.count) status = connect_all(picture, settings, &found, seen);
    free(found.runs);
    return status;
}

void free_components(Seen *seen) {
    free(seen->runs);
    free(seen->components);
}
