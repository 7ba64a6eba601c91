/* One Gauss–Newton step from the moments to the image of a disc, and chords against that (as template.py). */
#include "disc.h"

static const double LONGEST_STEP[NUMBERS] = {INFINITY, INFINITY, 0.7, 0.7, 0.3, 0.3, 1.5, 1.5};
static const double PRIOR_SIGMA[NUMBERS] = {255.0, 255.0, 1.0, 1.0, 0.1, 0.3, 3.0, 3.0};
static const double PIXEL = 1.0 / 12.0, LEAST = 1e-6, VAGUEST = 4.0;
static const float SMALLEST_PX = 0.4f;

enum { ABREAST = 4 };

/* The disc after a step. */
static void improve(const double step[NUMBERS], float disc[NUMBERS]) {
    for (int k = 0; k < NUMBERS; k++) disc[k] += (float)smaller(larger(step[k], -LONGEST_STEP[k]), LONGEST_STEP[k]);
    for (int k = HALF_WIDTH; k <= HALF_HEIGHT; k++) disc[k] = disc[k] > SMALLEST_PX ? disc[k] : SMALLEST_PX;
}

/* Each line's own shift against the disc (as template._chords). */
WIDE static void cut(const Sheet *sheet, const float disc[NUMBERS], double noise, int64_t column, double *centre, double *weight, double *share) {
    const float *slope = sheet->design + (X - CONTRAST) * sheet->padded, *rest = sheet->design + (REST - CONTRAST) * sheet->padded;
    double all_of_them = 0;
    for (int64_t line = 0; line < sheet->lines; line++, slope += sheet->columns, rest += sheet->columns) {
        Lanes squares = {0}, products = {0};
        for (int64_t first = 0; first < sheet->columns; first += EIGHT) {
            Lanes own = only(columns_from(sheet, first), lanes_at(slope + first));
            squares += own * own, products += own * lanes_at(rest + first);
        }
        double own = (double)sum_of(squares), along = (double)(disc[X] + disc[LEAN] * ((float)(sheet->apart * line) - disc[Y]));
        centre[line] = (double)column + (along + (double)sum_of(products) / larger(own, LEAST));
        weight[line] = own / (noise * noise) > VAGUEST ? own / (noise * noise) : 0;
        share[line] = own;
        all_of_them += own;
    }
    for (int64_t line = 0; line < sheet->lines; line++) share[line] /= larger(all_of_them, LEAST);
}

/* Four of them, side by side. */
static bool make_sheets(const Windows *windows, int64_t apart, Sheet sheets[ABREAST]) {
    int64_t pixels = windows->lines * windows->columns, padded = (pixels + EIGHT - 1) / EIGHT * EIGHT;
    float *from = calloc((size_t)((2 + ABREAST * (1 + ROWS)) * padded + EIGHT), sizeof *from);
    if (!from) return false;
    for (int k = 0; k < ABREAST; k++) {
        float *own = from + (2 + k * (1 + ROWS)) * padded;
        sheets[k] = (Sheet){windows->lines, apart, windows->columns, pixels, padded, from, from + padded, own, own + padded};
    }
    for (int64_t i = 0; i < pixels; i++)
        from[i] = (float)(i % windows->columns), from[padded + i] = (float)(apart * (i / windows->columns));
    return true;
}

/* What is nearer to another blob is taken for background: its light would draw the disc there. */
static void leave_out(const int64_t own[4], int64_t row, int64_t apart, int64_t column, const Sheet *sheet) {
    int64_t end = column + sheet->columns - 1, last = row + apart * (sheet->lines - 1);
    if (own[0] <= column && own[1] >= end && own[2] <= row && own[3] >= last) return;
    float background = background_of(sheet), *grey = sheet->grey;
    for (int64_t line = 0; line < sheet->lines; line++, row += apart)
        for (int64_t i = 0; i < sheet->columns; i++, grey++)
            if (column + i < own[0] || column + i > own[1] || row < own[2] || row > own[3]) *grey = background;
}

static void read_window(const GreyPicture *picture, const Windows *windows, int64_t i, Sheet *sheet) {
    int64_t apart = lines_apart(picture) / picture->y_step, first = windows->line[i] * apart + first_delivered(picture);
    for (int64_t line = 0, row = first; line < windows->lines; line++, row += apart)
        greys_of(picture, row, windows->column[i], windows->columns, sheet->grey + line * windows->columns);
    leave_out(windows->own + 4 * i, first, apart, windows->column[i], sheet);
}

/* What becomes of the fitted disc of a window. */
static void write_down(const GreyPicture *picture, const Windows *windows, int64_t i, const Sheet *sheet, const float disc[NUMBERS],
                       double noise, Place *places, Chords *chords) {
    int64_t at = i * windows->lines;
    double line = (double)windows->line[i] + (double)disc[Y] / (double)lines_apart(picture);
    places[i].x = (double)windows->column[i] + (double)disc[X], places[i].row = row_of_line(picture, line);
    cut(sheet, disc, noise, windows->column[i], chords->centre + at, chords->weight + at, chords->share + at);
    chords->line[i] = windows->line[i];
    chords->middle[i] = line_of_row(picture, places[i].row);
}

/* So many discs, four at most, from this one on. */
static void fit_abreast(const GreyPicture *picture, const GreySettings *settings, const Windows *windows, double noise,
                        int64_t first, int count, Sheet sheets[ABREAST], Place *places, Chords *chords) {
    float disc[ABREAST][NUMBERS];
    Quad normal[COLUMNS][COLUMNS] = {{{0}}}, steps[NUMBERS], variance_x, variance_y;
    const float blurring_x = (float)(settings->spread_px * settings->spread_px + PIXEL);
    /* One kind of work after the other: what was just written is not read at once in other pieces. */
    for (int k = 0; k < count; k++) read_window(picture, windows, first + k, sheets + k);
    for (int k = 0; k < count; k++) start_of(sheets + k, settings->spread_px, disc[k]);
    for (int k = 0; k < count; k++) picture_disc(disc[k], blurring_x, settings, sheets + k);
    for (int k = 0; k < count; k++) products_of(sheets + k, k, normal);
    for (int k = 0; k < NUMBERS; k++) normal[k][k] += noise / PRIOR_SIGMA[k] * (noise / PRIOR_SIGMA[k]);
    solve(normal, steps, &variance_x, &variance_y);
    for (int k = 0; k < count; k++) {
        double step[NUMBERS];
        for (int i = 0; i < NUMBERS; i++) step[i] = steps[i][k];
        improve(step, disc[k]);
        places[first + k].sigma_x = noise * sqrt(variance_x[k]), places[first + k].sigma_y = noise * sqrt(variance_y[k]);
    }
    for (int k = 0; k < count; k++) picture_chords(disc[k], blurring_x, settings, sheets + k);
    for (int k = 0; k < count; k++) write_down(picture, windows, first + k, sheets + k, disc[k], noise, places, chords);
}

int fit_discs(const GreyPicture *picture, const GreySettings *settings, const Windows *windows, double noise,
              Place *places, Chords *chords) {
    Sheet sheets[ABREAST];
    if (!make_sheets(windows, lines_apart(picture), sheets)) return NO_MEMORY;
    for (int64_t i = 0; i < windows->count; i += ABREAST)
        fit_abreast(picture, settings, windows, noise, i, (int)at_most(ABREAST, windows->count - i), sheets, places, chords);
    free(sheets[0].x);
    return DONE;
}
