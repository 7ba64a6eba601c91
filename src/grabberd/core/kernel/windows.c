/* Windows around the components of a target's size (as locator.windows_of). */
#include "grey.h"

static const double BEYOND_PX = 1.2, BEYOND_MORE_PX = 3.9, LARGEST_SHARE = 0.5, ALL_BUT_THE_LARGEST = 0.9;
enum { MOST_SPOTS = 4096 };

/* Margin of windows beyond the pixels above the threshold. */
static double beyond_px(const GreyPicture *picture, const Windows *windows, double background, double *scratch) {
    for (int64_t i = 0; i < windows->count; i++) {
        float grey;
        greys_of(picture, (int64_t)windows->blob[i]->row, (int64_t)windows->blob[i]->x, 1, &grey);
        scratch[i] = grey;
    }
    double height = larger(median_of(scratch, windows->count) - background, 1.0);
    double share = ((double)picture->threshold - background) / height;
    return BEYOND_PX + BEYOND_MORE_PX * smaller(larger(share, 0.0), LARGEST_SHARE);
}

/* Size of a window in steps: odd, unless the field is smaller. */
static int64_t size_of(double *extent, int64_t count, double beyond, int64_t step, int64_t most) {
    double large = ranked(extent, count, (int64_t)(ALL_BUT_THE_LARGEST * (double)count));
    return at_most(2 * (int64_t)ceil((large / 2 + beyond) / (double)step - 0.01) + 1, most);
}

static int64_t first_of(double middle, int64_t size, int64_t end) {
    return within((int64_t)rounded(middle) - size / 2, 0, end - size);
}

static void place_windows(const GreyPicture *picture, double background, Windows *windows, double *scratch) {
    double beyond = beyond_px(picture, windows, background, scratch);
    for (int64_t i = 0; i < windows->count; i++)
        scratch[i] = windows->blob[i]->last_column - windows->blob[i]->first_column + 1;
    windows->columns = size_of(scratch, windows->count, beyond, 1, picture->columns);
    for (int64_t i = 0; i < windows->count; i++)
        scratch[i] = (double)((windows->blob[i]->last_row - windows->blob[i]->first_row + 1) * picture->y_step);
    windows->lines = size_of(scratch, windows->count, beyond, lines_apart(picture), lines_of(picture));
    for (int64_t i = 0; i < windows->count; i++) {
        windows->column[i] = first_of(windows->blob[i]->x, windows->columns, picture->columns);
        windows->line[i] = first_of(line_of_row(picture, windows->blob[i]->row), windows->lines, lines_of(picture));
    }
}

/* Where the pixels nearer to another blob begin, by the widest gap between the two (as locator._own_pixels). */
static void keep_apart(const Component *one, const Component *other, int64_t y_step, int64_t *own) {
    int64_t right = other->first_column - one->last_column, left = one->first_column - other->last_column;
    int64_t below = y_step * (other->first_row - one->last_row), above = y_step * (one->first_row - other->last_row);
    int64_t across = at_least(right, left), down = at_least(below, above);
    if (across <= 0 && down <= 0) return;
    if (across >= down && right > 0) own[1] = at_most(own[1], (one->last_column + other->first_column) / 2);
    else if (across >= down) own[0] = at_least(own[0], (other->last_column + one->first_column + 1) / 2);
    else if (below > 0) own[3] = at_most(own[3], (one->last_row + other->first_row) / 2);
    else own[2] = at_least(own[2], (other->last_row + one->first_row + 1) / 2);
}

static bool are_far(const Component *one, const Component *other, int64_t columns) {
    return other->first_column > one->last_column + columns || one->first_column > other->last_column + columns;
}

/* Components stand in the order of their first rows. */
static void share_pixels(const GreyPicture *picture, const Seen *seen, const Windows *windows) {
    int64_t rows = windows->lines * lines_apart(picture) / picture->y_step, *own = windows->own;
    for (int64_t i = 0; i < windows->count; i++)
        memcpy(own + 4 * i, (int64_t[]){0, picture->columns - 1, 0, picture->rows - 1}, 4 * sizeof *own);
    const Component *one = seen->components, *end = one + (seen->component_count <= MOST_SPOTS ? seen->component_count : 0);
    for (; one < end; own += one++->of_size ? 4 : 0) {
        int64_t *others = own + (one->of_size ? 4 : 0);
        for (const Component *other = one + 1; other < end && other->first_row <= one->last_row + rows; others += other++->of_size ? 4 : 0) {
            if (are_far(one, other, windows->columns)) continue;
            if (one->of_size) keep_apart(one, other, picture->y_step, own);
            if (other->of_size) keep_apart(other, one, picture->y_step, others);
        }
    }
}

int windows_of(const GreyPicture *picture, const Seen *seen, double background, Windows *windows) {
    int64_t count = 0;
    for (int64_t i = 0; i < seen->component_count; i++) count += seen->components[i].of_size;
    size_t room = (size_t)(count ? count : 1);
    double *scratch = malloc(room * sizeof *scratch);
    *windows = (Windows){.blob = malloc(room * sizeof *windows->blob),
                         .line = malloc(room * sizeof *windows->line),
                         .column = malloc(room * sizeof *windows->column),
                         .own = malloc(room * 4 * sizeof *windows->own)};
    int status = scratch && windows->blob && windows->line && windows->column && windows->own ? DONE : NO_MEMORY;
    for (int64_t i = 0; i < seen->component_count && status == DONE; i++)
        if (seen->components[i].of_size) windows->blob[windows->count++] = seen->components + i;
    if (status == DONE && count) {
        place_windows(picture, background, windows, scratch);
        share_pixels(picture, seen, windows);
    }
    free(scratch);
    return status;
}

void free_windows(Windows *windows) {
    free(windows->blob);
    free(windows->line);
    free(windows->column);
    free(windows->own);
}
