/* Declarations shared by location with more than 1 bit. */
#ifndef GRABBERD_GREY_H
#define GRABBERD_GREY_H

#include "kernel.h"

enum { REACH_PX = 2, EDGE_VALUES = 5120, GREYS = 256 };

/* A packed field of more than 1 bit: a byte a pixel with 8, else planes of packed bits, the highest first. */
typedef struct {
    const uint8_t *data;
    int64_t length; /* of `data`, bytes */
    int64_t bits, rows, stride, columns, parity, y0, y_step, threshold;
} GreyPicture;

/* How targets are located; `edge`: pairs of what is there of an edge and how fast that changes (template.edge_table). */
typedef struct {
    double min_diameter_px, max_diameter_px, line_jitter_px, spread_px, noise_levels; /* noise NaN: not known */
    int64_t shifts_solved, jitter_known;
    const uint64_t *edge; /* two floats each */
    int64_t edge_values;
} GreySettings;

typedef struct {
    double level, noise;
} Background;

/* What came of it: of `count` blobs. */
typedef struct {
    int64_t count;
    double common_reach_px, jitter_px; /* NaN: not estimated */
} GreyOutcome;

/* Windows of N blobs, all of one size: the component of each, its first field line and first column; and which pixels
   are nearer to no other blob: first and last column, first and last row. */
typedef struct {
    int64_t count, lines, columns;
    const Component **blob;
    int64_t *line, *column, *own; /* the last: (N, 4) */
} Windows;

/* As `locator.Chords`, of N blobs with `height` lines each: (count, height) but for `line` and `middle`. */
typedef struct {
    int64_t count, height;
    int64_t *line;
    double *middle, *centre, *weight, *share; /* `middle`: the field line of each blob's centre */
} Chords;

/* What shifted lines do to the x of N blobs: (count,) each. `jitter_px` NaN: not estimated. */
typedef struct {
    double *x_px, *common_px;
    double reach_px, jitter_px;
} LineShifts;

void bits_above(const GreyPicture *, uint8_t *bits, int64_t stride);
void greys_of(const GreyPicture *, int64_t row, int64_t column, int64_t count, float *grey);
Background background_in(const GreyPicture *);
int windows_of(const GreyPicture *, const Seen *, double background, Windows *);
void free_windows(Windows *);
/* Places (count,) of the blobs in columns and rows, and their chords with room for all of a window's lines. */
int fit_discs(const GreyPicture *, const GreySettings *, const Windows *, double noise, Place *places, Chords *);
int line_shifts(const Chords *, const GreySettings *, int64_t lines, int64_t columns, LineShifts *);
void shifts_unsolved(const Chords *, double jitter_px, LineShifts *);

/* Frame lines from one delivered line to the next. */
INLINE int64_t lines_apart(const GreyPicture *picture) { return picture->parity == PROGRESSIVE ? 1 : 2; }
INLINE int64_t lines_of(const GreyPicture *picture) { return picture->rows * picture->y_step / lines_apart(picture); }
INLINE int64_t first_delivered(const GreyPicture *picture) {
    return picture->y_step == 1 && picture->parity != PROGRESSIVE ? picture->parity : 0;
}
INLINE double line_of_row(const GreyPicture *picture, double row) {
    return (row - (double)first_delivered(picture)) * (double)picture->y_step / (double)lines_apart(picture);
}
INLINE double row_of_line(const GreyPicture *picture, double line) {
    return line * (double)lines_apart(picture) / (double)picture->y_step + (double)first_delivered(picture);
}

#endif
