/* Connected components of set pixels, and what is summed over their runs (as labelling.py). */
#include "runs.h"

/* Sums over the runs of a component, from the corner at its first run on: whole numbers, and so exact. */
typedef struct {
    int64_t pixels, across, down; /* `across` in half pixels */
    double length, x, y, xx, yy, xy, squares, beside; /* of delivered rows; of all rows' lengths, and of neighbouring rows' */
} Sums;

INLINE void add_moments(double length, double x, double y, Sums *sums) {
    sums->length += length;
    sums->x += length * x, sums->y += length * y;
    sums->xx += length * (3.0 * (x * x) + length * length - 1.0), sums->yy += length * y * y, sums->xy += length * x * y;
}

/* In one pass, for runs are few and each pass ends with a branch that cannot be foreseen; it also notes the columns covered. */
static void sum_up(const Picture *picture, const Run *run, Component *own, Sums *sums) {
    int32_t corner = 2 * run->first, top = run->row, row = top;
    double line = 0, above = 0; /* lengths of this row, as far as it is known, and of the one before */
    own->first_column = run->first, own->last_column = run->last;
    for (int32_t i = 0; i < own->count; i++, run++) {
        int32_t length = run->last - run->first + 1, x = run->first + run->last - corner, y = run->row - top;
        sums->pixels += length, sums->across += (int64_t)length * x, sums->down += (int64_t)length * y;
        if (is_delivered(picture, run->row)) add_moments(length, x, y, sums);
        own->first_column = run->first < own->first_column ? run->first : own->first_column;
        own->last_column = run->last > own->last_column ? run->last : own->last_column;
        if (run->row != row) sums->squares += line * line, sums->beside += line * above, above = line, line = 0, row = run->row;
        line += length;
    }
    sums->squares += line * line, sums->beside += line * above;
}

/* Of delivered rows, about the centroid, which is so many half pixels and rows from the corner. */
static Moments moments_of(const Picture *picture, const Sums *sums, double x, double y) {
    double y_step = (double)picture->y_step;
    return (Moments){.pixels = sums->length,
                     .xx = sums->xx / 12 - x * sums->x / 2 + x * x * sums->length / 4,
                     .yy = (sums->yy - 2 * y * sums->y + y * y * sums->length) * (y_step * y_step),
                     .xy = (sums->xy - x * sums->y - y * sums->x + x * y * sums->length) / 2 * y_step};
}

static void shape(const Picture *picture, const Settings *settings, const Run *runs, Component *own) {
    Sums sums = {0};
    const Run *run = runs + own->begin;
    own->first_row = run->row, own->last_row = run[own->count - 1].row;
    sum_up(picture, run, own, &sums);
    double across = (double)sums.across / (double)sums.pixels, down = (double)sums.down / (double)sums.pixels;
    own->pixels = sums.pixels;
    own->x = (double)(sums.across + 2 * run->first * sums.pixels) / (double)(2 * sums.pixels);
    own->row = (double)(sums.down + own->first_row * sums.pixels) / (double)sums.pixels;
    own->area_px = (double)own->pixels * (double)picture->y_step;
    own->moments = moments_of(picture, &sums, across, down);
    own->row_squares = sums.squares, own->row_products = sums.beside;
    double diameter = sqrt(4 / PI * own->area_px);
    double height = (double)((own->last_row - own->first_row + 1) * picture->y_step);
    own->at_border = own->first_row == 0 || own->last_row == picture->rows - 1 || own->first_column == 0 ||
                     own->last_column == picture->columns - 1;
    own->of_size = diameter >= settings->min_diameter_px && diameter <= settings->max_diameter_px;
    own->low = own->of_size && height <= 2.0 * settings->max_diameter_px;
    own->whole = own->low && !own->at_border;
}

static void order_by_component(const FoundRuns *found, Seen *seen) {
    Component *components = seen->components;
    for (int64_t i = 0; i < found->count; i++) components[found->runs[i].label].count++;
    int32_t begin = 0;
    for (int64_t i = 0; i < found->components; i++) {
        components[i].begin = begin;
        begin += components[i].count;
        components[i].count = 0;
    }
    for (int64_t i = 0; i < found->count; i++) {
        Component *own = components + found->runs[i].label;
        seen->runs[own->begin + own->count++] = found->runs[i];
    }
}

static int make_components(const Picture *picture, const Settings *settings, const FoundRuns *found, Seen *seen) {
    seen->runs = malloc((size_t)found->count * sizeof *seen->runs);
    seen->components = calloc((size_t)found->components, sizeof *seen->components);
    if (!seen->runs || !seen->components) return NO_MEMORY;
    seen->component_count = found->components;
    order_by_component(found, seen);
    for (int64_t i = 0; i < seen->component_count; i++) shape(picture, settings, seen->runs, seen->components + i);
    return DONE;
}

int find_components(const Picture *picture, const Settings *settings, Seen *seen) {
    FoundRuns found;
    int status = find_runs(picture, &found);
    *seen = (Seen){.run_count = found.count};
    if (status == DONE && found.count) status = make_components(picture, settings, &found, seen);
    free(found.runs);
    free(found.parent);
    return status;
}

void free_components(Seen *seen) {
    free(seen->runs);
    free(seen->components);
}
