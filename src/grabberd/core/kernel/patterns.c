/* Bit patterns of blobs, prepared for lookup in the tables of their kind (as locale.Entries). */
#include "patterns.h"

static const double STEPS_X = 10, STEPS_Y = 8, WIDE_PX = 0.5, HIGH_PX = 0.25, HALF = 5.0;
static const double FRACTIONS[4] = {0.12, 0.2, 0.3, 0.42}, NOMINAL_FRACTION = 0.3, PRIOR_BLOBS = 8.0, ROUNDED_PX = 0.15;
enum { NOMINAL = 2, CAPS = 18 };

/* The threshold's share of the contrast: interpolated rows are blurred, and so fuller or emptier. */
int threshold_fraction(const Picture *picture, const Settings *settings, const Seen *seen, const Size *sizes,
                       double *fraction, Outcome *outcome) {
    double across = 0, down = 0, of_delivered = 0, of_all = 0, blobs = 0;
    *fraction = NOMINAL_FRACTION;
    if (!is_doubled(picture)) return DONE;
    for (int64_t i = 0; i < seen->component_count; i++) {
        if (!seen->components[i].whole) continue;
        across += sizes[i].half_width_px, down += sizes[i].half_height_px;
        of_delivered += sizes[i].delivered, of_all += (double)seen->components[i].pixels;
        blobs += 1;
    }
    if (!(blobs > 0)) return DONE;
    double width = rounded(across / blobs / ROUNDED_PX), height = rounded(down / blobs / ROUNDED_PX);
    const Fullness *found = NULL;
    for (int64_t i = 0; i < settings->fullness_count && !found; i++)
        if (settings->fullness[i].half_width_px == width && settings->fullness[i].half_height_px == height)
            found = settings->fullness + i;
    if (!found) {
        outcome->missing[0] = width, outcome->missing[1] = height;
        return NO_FULLNESS;
    }
    double prior = PRIOR_BLOBS * of_delivered / blobs, least = INFINITY;
    double ratio = (of_all - of_delivered + prior * found->ratio[NOMINAL]) / (of_delivered + prior);
    for (int i = 0; i < 4; i++) {
        double off = fabs(found->ratio[i] - ratio);
        if (off < least) least = off, *fraction = FRACTIONS[i];
    }
    return DONE;
}

static int64_t kind_of(Kinds *kinds, int32_t wide, int32_t high) {
    uint64_t place = ((uint64_t)(uint32_t)wide << 32 | (uint32_t)high) * UINT64_C(0x9E3779B97F4A7C15) >> 32;
    for (;; place++) {
        int32_t *slot = kinds->slots + (place & (uint64_t)kinds->mask);
        if (*slot < 0) {
            *slot = (int32_t)kinds->count;
            kinds->kinds[kinds->count] = (Kind){.wide = wide, .high = high};
            return kinds->count++;
        }
        if (kinds->kinds[*slot].wide == wide && kinds->kinds[*slot].high == high) return *slot;
    }
}

/* The most frequent first; of equally frequent ones the narrower, then the lower. */
static bool comes_before(const Kind *one, const Kind *other) {
    if (one->blobs != other->blobs) return one->blobs > other->blobs;
    return one->wide != other->wide ? one->wide < other->wide : one->high < other->high;
}

/* Blobs of a kind together: their table then stays near at hand. */
static void put_in_order(Kinds *kinds, int64_t components) {
    kinds->first = 0;
    for (int64_t i = 1; i < kinds->count; i++) {
        kinds->kinds[i].begin = kinds->kinds[i - 1].begin + kinds->kinds[i - 1].blobs;
        if (comes_before(kinds->kinds + i, kinds->kinds + kinds->first)) kinds->first = i;
    }
    for (int64_t i = 0; i < kinds->count; i++) kinds->kinds[i].blobs = 0;
    for (int64_t blob = 0; blob < components; blob++) {
        if (kinds->of[blob] < 0) continue;
        Kind *kind = kinds->kinds + kinds->of[blob];
        kinds->order[kind->begin + kind->blobs++] = (int32_t)blob;
    }
}

int kinds_of(const Seen *seen, const Size *sizes, Kinds *kinds) {
    int64_t size = 16;
    while (size < 2 * seen->component_count) size *= 2;
    kinds->mask = size - 1, kinds->count = 0, kinds->blobs = 0;
    kinds->slots = malloc((size_t)size * sizeof *kinds->slots);
    kinds->kinds = malloc((size_t)seen->component_count * sizeof *kinds->kinds);
    kinds->of = malloc((size_t)seen->component_count * sizeof *kinds->of);
    kinds->order = malloc((size_t)seen->component_count * sizeof *kinds->order);
    if (!kinds->slots || !kinds->kinds || !kinds->of || !kinds->order) return NO_MEMORY;
    memset(kinds->slots, 0xff, (size_t)size * sizeof *kinds->slots);
    for (int64_t i = 0; i < seen->component_count; i++) {
        kinds->of[i] = -1;
        if (!seen->components[i].whole) continue;
        double wide = rounded(sizes[i].half_width_px / WIDE_PX), high = rounded(sizes[i].half_height_px / HIGH_PX);
        if (!(wide < 1e6 && high < 1e6)) return REFUSED;
        kinds->of[i] = (int32_t)kind_of(kinds, (int32_t)wide, (int32_t)high);
        kinds->kinds[kinds->of[i]].blobs++;
        kinds->blobs++;
    }
    put_in_order(kinds, seen->component_count);
    return DONE;
}

void free_kinds(Kinds *kinds) {
    free(kinds->slots);
    free(kinds->kinds);
    free(kinds->of);
    free(kinds->order);
}

/* The one of a kind and a threshold; NULL if none of its noises has been asked for. */
static const Table *table_of(const Settings *settings, double fraction, const Kind *kind) {
    for (int64_t k = 0; k < settings->table_count; k++) {
        const Table *table = settings->tables + k;
        if (table->wide == kind->wide && table->high == kind->high && table->fraction == fraction) return table;
    }
    return NULL;
}

int find_table(const Settings *settings, double fraction, int noise, Kind *kind, Outcome *outcome) {
    bool there = (kind->table = table_of(settings, fraction, kind)) != NULL;
    int first = noise == ANY_NOISE ? 0 : noise, end = noise == ANY_NOISE ? NOISES : noise + 1;
    for (int k = first; k < end && there; k++) there = kind->table->values[k] != NULL;
    if (there) return DONE;
    outcome->missing[0] = kind->wide, outcome->missing[1] = kind->high;
    outcome->missing[2] = fraction, outcome->missing[3] = noise;
    return NO_TABLE;
}

void pattern_of(const Picture *picture, const Component *own, const Size *size, const Kind *kind, Pattern *pattern) {
    double y_step = (double)picture->y_step;
    pattern->middle_x = rounded(own->x * STEPS_X);
    pattern->middle_y = rounded((own->row - (double)first_row(picture)) * (STEPS_Y * y_step));
    pattern->wider = WIDE_PX * kind->wide / size->half_width_px;
    pattern->higher = HIGH_PX * kind->high / size->half_height_px;
}

/* NaN ranks below all. */
INLINE int64_t bounded(double value) { return (int64_t)(value > -1e9 ? smaller(value, 1e9) : -1e9); }

int64_t entries_of(const Picture *picture, const Run *runs, const Component *own, const Size *size,
                   const Pattern *pattern, const Table *table, int64_t *entry) {
    int64_t reach_y = REACH_Y(picture->y_step), ahead_x = table->columns - 2 * REACH_X;
    int64_t ahead_y = table->rows - 2 * reach_y, right = REACH_X - table->columns / 2;
    int64_t down_to = reach_y - table->rows / 2, count = 2, row = 0, is_between = 0;
    int64_t phase = ((int64_t)-pattern->middle_x - right) % (int64_t)STEPS_X;
    if (phase < 0) phase += (int64_t)STEPS_X;
    const Run *run = runs + own->begin;
    for (int32_t i = 0; i < own->count; i++) {
        int32_t first = run[i].first;
        /* A gap between two runs of a row is taken as set: no target has such rows. */
        while (i + 1 < own->count && run[i + 1].row == run[i].row) i++;
        double down = (double)(run[i].row - first_row(picture)) * ((double)picture->y_step * STEPS_Y) - pattern->middle_y;
        double origin = pattern->middle_x + HALF + size->lean * down * (STEPS_X / STEPS_Y);
        double start = rounded((first * STEPS_X - origin) * pattern->wider + HALF);
        double end = rounded((((double)run[i].last + 1) * STEPS_X - origin) * pattern->wider + HALF);
        row = within(bounded(rounded(down * pattern->higher)) - down_to, 0, ahead_y - 1);
        is_between = !is_delivered(picture, run[i].row);
        if (count == 2) entry[0] = (4 * table->columns + is_between * CAPS + phase) * table->rows + row;
        entry[count++] = (is_between * table->columns + within(bounded(start) - right, 0, ahead_x - 1)) * table->rows + row;
        entry[count++] = ((2 + is_between) * table->columns + within(bounded(end) - right, 0, ahead_x - 1)) * table->rows + row;
    }
    entry[1] = (4 * table->columns + (2 + is_between) * CAPS + phase) * table->rows + row;
    return count;
}
