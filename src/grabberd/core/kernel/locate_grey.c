/* From a packed field of more than 1 bit to its blobs, in one call (as location.measure with method "template"). */
#include "grey.h"
#include "module.h"

/* The stride as well: the mask of a picture with longer rows would be shorter than they are. */
static bool is_sound(const GreyPicture *picture, const GreySettings *settings) {
    int64_t planes = picture->bits == 8 ? 1 : picture->bits, wide = picture->bits == 8 ? 1 : 8;
    return (picture->bits == 8 || (picture->bits >= 2 && picture->bits <= 6)) && picture->rows > 0 && picture->stride > 0 &&
           picture->rows < 1 << 24 && picture->stride < 1 << 24 && picture->rows * picture->stride < 1 << 28 &&
           planes * picture->rows * picture->stride <= picture->length && (picture->y_step == 1 || picture->y_step == 2) &&
           picture->parity >= 0 && picture->parity <= (picture->y_step == 1 ? PROGRESSIVE : 1) && picture->columns > 0 && picture->columns < INT64_C(1) << 27 &&
           picture->stride == (picture->columns + wide - 1) / wide &&
           lines_of(picture) > 0 && settings->edge_values == EDGE_VALUES && settings->edge && (uintptr_t)settings->edge % sizeof *settings->edge == 0 &&
           settings->line_jitter_px >= 0;
}

/* As few lines of each as hold the chords that weigh, of all but the tallest (as locator.Chords.trimmed). */
static void trim(Chords *chords, double *scratch) {
    int64_t height = chords->height, *first = (int64_t *)(scratch + chords->count);
    bool none = true;
    for (int64_t i = 0; i < chords->count; i++) {
        const double *weight = chords->weight + i * height;
        int64_t end = height;
        first[i] = 0;
        while (first[i] < height && !(weight[first[i]] > 0)) first[i]++;
        if (first[i] == height) first[i] = 0;
        else none = false;
        while (end > 1 && !(weight[end - 1] > 0)) end--;
        if (!(weight[end - 1] > 0)) end = height;
        scratch[i] = (double)(end - first[i]);
    }
    if (none) return;
    int64_t kept = (int64_t)ranked(scratch, chords->count, (int64_t)(0.95 * (double)(chords->count - 1)));
    for (int64_t i = 0; i < chords->count; i++) {
        int64_t begin = at_most(first[i], height - kept);
        for (int64_t k = 0; k < kept; k++) {
            chords->centre[i * kept + k] = chords->centre[i * height + begin + k];
            chords->weight[i * kept + k] = chords->weight[i * height + begin + k];
            chords->share[i * kept + k] = chords->share[i * height + begin + k];
        }
        chords->line[i] += begin;
    }
    chords->height = kept;
}

static bool weighs(const Chords *chords) {
    for (int64_t k = 0; k < chords->count * chords->height; k++)
        if (chords->weight[k] > 0) return true;
    return false;
}

/* As line_jitter.steadied. */
static int steady(const GreyPicture *picture, const GreySettings *settings, const Chords *chords, LineShifts *found) {
    for (int64_t i = 0; i < chords->count; i++) found->x_px[i] = 0, found->common_px[i] = settings->line_jitter_px;
    found->reach_px = REACH_PX, found->jitter_px = NAN;
    if (settings->line_jitter_px == 0) return DONE;
    if (!settings->shifts_solved) shifts_unsolved(chords, settings->line_jitter_px, found);
    else if (weighs(chords)) return line_shifts(chords, settings, lines_of(picture), picture->columns, found);
    return DONE;
}

static void write_out(const GreyPicture *picture, const Windows *windows, const Place *places, const LineShifts *found,
                      double *out, int64_t capacity) {
    for (int64_t i = 0; i < windows->count; i++) {
        Place at = places[i];
        at.x -= found->x_px[i];
        write_blob(windows->blob[i], &at, found->common_px[i], (double)picture->y0, (double)picture->y_step, out, capacity, i);
    }
}

static int locate_all(const GreyPicture *picture, const GreySettings *settings, const Windows *windows, double noise,
                      double *out, int64_t capacity, GreyOutcome *outcome) {
    size_t count = (size_t)windows->count, cells = count * (size_t)windows->lines;
    Place *places = malloc(count * sizeof *places);
    int64_t *line = malloc(count * sizeof *line);
    double *numbers = malloc((5 * count + 3 * cells) * sizeof *numbers);
    int status = places && line && numbers ? DONE : NO_MEMORY;
    if (status == DONE) {
        double *rest = numbers + 5 * count;
        LineShifts found = {.x_px = numbers, .common_px = numbers + count};
        Chords chords = {windows->count, windows->lines, line, numbers + 2 * count, rest, rest + cells, rest + 2 * cells};
        status = fit_discs(picture, settings, windows, noise, places, &chords);
        if (status == DONE) trim(&chords, numbers + 3 * count);
        if (status == DONE) status = steady(picture, settings, &chords, &found);
        if (status == DONE) write_out(picture, windows, places, &found, out, capacity);
        outcome->common_reach_px = found.reach_px, outcome->jitter_px = found.jitter_px;
    }
    free(places);
    free(line);
    free(numbers);
    return status;
}

static int find(const GreyPicture *picture, const GreySettings *settings, Seen *seen) {
    int64_t stride = (picture->columns + 7) / 8;
    uint8_t *bits = calloc((size_t)picture->rows, (size_t)stride);
    if (!bits) return NO_MEMORY;
    Picture mask = {bits, picture->rows * stride, picture->rows, stride, picture->columns, picture->parity, picture->y0, picture->y_step};
    Settings sizes = {.min_diameter_px = settings->min_diameter_px, .max_diameter_px = settings->max_diameter_px};
    bits_above(picture, bits, stride);
    int status = find_components(&mask, &sizes, seen);
    free(bits);
    return status;
}

/* Writes (COLUMNS · capacity) numbers at most; where there are more blobs, `outcome->count` says how many. */
int grabberd_locate_grey(const GreyPicture *picture, const GreySettings *settings, double *out, int64_t capacity, GreyOutcome *outcome) {
    Seen seen = {0};
    Windows windows = {0};
    *outcome = (GreyOutcome){0, REACH_PX, NAN};
    if (!is_sound(picture, settings) || capacity < 0) return REFUSED;
    int status = find(picture, settings, &seen);
    Background behind = background_in(picture);
    if (status == DONE) status = windows_of(picture, &seen, behind.level, &windows);
    outcome->count = windows.count;
    if (status == DONE && windows.count > capacity) status = MORE_ROOM;
    if (status == DONE && windows.count) {
        double noise = isnan(settings->noise_levels) ? behind.noise : settings->noise_levels;
        status = locate_all(picture, settings, &windows, noise, out, capacity, outcome);
    }
    free_windows(&windows);
    free_components(&seen);
    return status;
}
