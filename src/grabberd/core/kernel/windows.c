/* Windows around the components of a target's size (as locator.windows_of). */
#include "grey.h"

static const double BEYOND_PX = 1.2, BEYOND_MORE_PX = 3.9, LARGEST_SHARE = 0.5, ALL_BUT_THE_LARGEST = 0.9;

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

int windows_of(const GreyPicture *picture, const Seen *seen, double background, Windows *windows) {
    int64_t count = 0;
    for (int64_t i = 0; i < seen->component_count; i++) count += seen->components[i].of_size;
    size_t room = (size_t)(count ? count : 1);
    double *scratch = malloc(room * sizeof *scratch);
    *windows = (Windows){.blob = malloc(room * sizeof *windows->blob),
                         .line = malloc(room * sizeof *windows->line),
                         .column = malloc(room * sizeof *windows->column)};
    int status = scratch && windows->blob && windows->line && windows->column ? DONE : NO_MEMORY;
    for (int64_t i = 0; i < seen->component_count && status == DONE; i++)
        if (seen->components[i].of_size) windows->blob[windows->count++] = seen->components + i;
    if (status == DONE && count) place_windows(picture, background, windows, scratch);
    free(scratch);
    return status;
}

void free_windows(Windows *windows) {
    free(windows->blob);
    free(windows->line);
    free(windows->column);
}
