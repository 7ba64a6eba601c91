/* The image of a disc that is fitted to a window of a field (as template.py). */
#ifndef GRABBERD_DISC_H
#define GRABBERD_DISC_H

#include "grey.h"
#include "lanes.h"

/* What describes a disc's picture, the places last; and what the fit leaves. */
enum { BACKGROUND, CONTRAST, HALF_WIDTH, HALF_HEIGHT, LEAN, BLURRING, X, Y, NUMBERS, REST = NUMBERS, COLUMNS };
/* Rows of the design: of all of them but the background, whose slope is 1 for every pixel. */
enum { ROWS = COLUMNS - CONTRAST };
typedef double Quad __attribute__((vector_size(32)));

/* A window's pixels, in eights (padded with black, and eight more may be read): places, grey values, and the rows of the
   design with what is left below them. */
typedef struct {
    int64_t lines, apart, columns, pixels, padded; /* `apart`: frame lines from one line to the next */
    float *x, *y, *grey, *design; /* the last: (ROWS, padded) */
} Sheet;

float background_of(const Sheet *);
/* From the moments of the grey values' squares. */
void start_of(const Sheet *, double spread_px, float disc[NUMBERS]);
/* The design at a disc; and as much of it as chords are cut from. */
void picture_disc(const float *disc, float blurring_x, const GreySettings *, Sheet *);
void picture_chords(const float *disc, float blurring_x, const GreySettings *, Sheet *);
/* The upper triangle of the normal matrix, its right side in the last column, of one of four discs. */
void products_of(const Sheet *, int lane, Quad normal[COLUMNS][COLUMNS]);
/* The steps of four discs at once, and the variances of x and y for noise 1: these are the last, and so cheap. */
void solve(Quad normal[NUMBERS][COLUMNS], Quad step[NUMBERS], Quad *variance_x, Quad *variance_y);

/* Which of the eight columns from this one on the window has. */
INLINE WholeLanes columns_from(const Sheet *sheet, int64_t first) {
    const WholeLanes each = {0, 1, 2, 3, 4, 5, 6, 7};
    return each < (int32_t)at_most(sheet->columns - first, EIGHT);
}

#endif
