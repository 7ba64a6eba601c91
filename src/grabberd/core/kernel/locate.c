/* From a packed field of 1 bit to its blobs, in one call (as location.measure). */
#include "kernel.h"

/* As noise.binary_sigma_px. */
static void start(const Picture *picture, const Component *own, Place *place) {
    double root = sqrt(sqrt(4 / PI * own->area_px)), y_step = (double)picture->y_step;
    double x = is_doubled(picture) ? 0.235 : 0.2122 * sqrt(y_step), y = is_doubled(picture) ? 0.244 : 0.2122 * y_step;
    *place = (Place){own->x, own->row, x / root, y / root};
}

/* x, y, σx, σy interleaved by pairs, then common, area, width, height, and whether it touches the border. */
void write_blob(const Component *own, const Place *place, double common_px, double y0, double y_step, double *out,
                int64_t capacity, int64_t k) {
    double *xy = out + 2 * k, *sigma = out + 2 * capacity + 2 * k, *rest = out + 4 * capacity + k;
    xy[0] = place->x, xy[1] = place->row * y_step + y0;
    sigma[0] = place->sigma_x, sigma[1] = place->sigma_y;
    rest[0] = common_px;
    rest[capacity] = own->area_px;
    rest[2 * capacity] = own->last_column - own->first_column + 1;
    rest[3 * capacity] = (double)(own->last_row - own->first_row + 1) * y_step;
    rest[4 * capacity] = own->at_border;
}

static void write_out(const Picture *picture, const Seen *seen, const Place *places, const double *common_px,
                      double *out, int64_t capacity) {
    for (int64_t i = 0, k = 0; i < seen->component_count; i++)
        if (seen->components[i].of_size)
            write_blob(seen->components + i, places + i, common_px[i], (double)picture->y0, (double)picture->y_step, out, capacity, k++);
}

static bool is_sound(const Picture *picture, const Settings *settings) {
    return picture->bits && settings && picture->rows > 0 && picture->stride > 0 && picture->rows < 1 << 24 &&
           picture->stride < 1 << 24 && picture->rows * picture->stride <= picture->length &&
           picture->rows * picture->stride < 1 << 28 && (picture->y_step == 1 || picture->y_step == 2) &&
           picture->parity >= 0 && picture->parity <= (picture->y_step == 1 ? PROGRESSIVE : 1) && picture->columns > 0 &&
           picture->columns < INT64_C(1) << 27 && picture->stride == (picture->columns + 7) / 8 &&
           settings->table_count >= 0 && settings->fullness_count >= 0;
}

static int locate_seen(const Picture *picture, const Settings *settings, const Seen *seen, double *out,
                       int64_t capacity, Outcome *outcome) {
    size_t count = (size_t)seen->component_count;
    Place *places = malloc(count * sizeof *places);
    Size *sizes = malloc(count * sizeof *sizes);
    bool *discs = malloc(count * sizeof *discs), shifting = settings->line_jitter_px > 0 && settings->shifts_taken;
    double *common_px = malloc(count * sizeof *common_px);
    int status = places && sizes && discs && common_px ? DONE : NO_MEMORY;
    for (size_t i = 0; status == DONE && i < count; i++) {
        start(picture, seen->components + i, places + i);
        discs[i] = seen->components[i].whole;
    }
    if (status == DONE && (settings->locale || shifting)) status = sizes_of(picture, seen, sizes);
    if (status == DONE && settings->locale) status = locate_by_locale(picture, settings, seen, sizes, discs, places, outcome);
    if (status == DONE && shifting) status = take_row_shifts(picture, settings->line_jitter_px, seen, sizes, discs, places);
    if (status == DONE) status = line_shares(picture, settings, seen, common_px, &outcome->common_reach_px);
    if (status == DONE) write_out(picture, seen, places, common_px, out, capacity);
    free(places);
    free(sizes);
    free(discs);
    free(common_px);
    return status;
}

/* Writes (COLUMNS · capacity) numbers at most; where there are more blobs, `outcome->count` says how many. */
int grabberd_locate(const Picture *picture, const Settings *settings, double *out, int64_t capacity, Outcome *outcome) {
    Seen seen = {0};
    *outcome = (Outcome){.common_reach_px = 2.0};
    if (!is_sound(picture, settings) || capacity < 0) return REFUSED;
    int status = find_components(picture, settings, &seen);
    for (int64_t i = 0; i < seen.component_count && status == DONE; i++) outcome->count += seen.components[i].of_size;
    if (status == DONE && outcome->count > capacity) status = MORE_ROOM;
    if (status == DONE && seen.component_count) status = locate_seen(picture, settings, &seen, out, capacity, outcome);
    free_components(&seen);
    return status;
}
