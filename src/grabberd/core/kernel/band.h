/* Symmetric positive definite equations with a band matrix. */
#ifndef GRABBERD_BAND_H
#define GRABBERD_BAND_H

#include "kernel.h"

/* Of `count` equations; every column from its main diagonal down, `height` numbers. */
typedef struct {
    int64_t count, height;
    double *values;
} Band;

void factor(const Band *matrix, double more, Band *lower);
void solve_down(const Band *lower, const double *right, double *solution);
void solve_up(const Band *lower, double *solution);
/* What of the inverse lies within a band of one more than the factor's height. */
void inverse_of(const Band *lower, Band *inverse);

INLINE double *band_at(const Band *band, int64_t row, int64_t column) { return band->values + column * band->height + (row - column); }
INLINE double band_value(const Band *band, int64_t one, int64_t other) {
    return one > other ? *band_at(band, one, other) : *band_at(band, other, one);
}

#endif
