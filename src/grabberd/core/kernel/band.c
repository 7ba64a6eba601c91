/* Cholesky factor of a band matrix, and the part of its inverse within the band (as line_shifts.band_factor). */
#include "band.h"

static const double TINY = 2.2250738585072014e-308;

/* Factor of a band with `more` added to its main diagonal. */
void factor(const Band *matrix, double more, Band *lower) {
    int64_t height = matrix->height, count = matrix->count;
    memcpy(lower->values, matrix->values, (size_t)(height * count) * sizeof *lower->values);
    for (int64_t j = 0; j < count; j++) lower->values[j * height] += more;
    for (int64_t j = 0; j < count; j++) {
        double *own = lower->values + j * height, scale = 1.0 / sqrt(larger(own[0], TINY));
        int64_t below = at_most(height, count - j);
        own[0] = sqrt(larger(own[0], TINY));
        for (int64_t k = 1; k < below; k++) own[k] *= scale;
        for (int64_t k = 1; k < below; k++) {
            double *other = own + k * height;
            for (int64_t m = k; m < below; m++) other[m - k] -= own[m] * own[k];
        }
    }
}

/* L⁻¹ of the right side; in place, if wanted. */
void solve_down(const Band *lower, const double *right, double *solution) {
    if (solution != right) memcpy(solution, right, (size_t)lower->count * sizeof *solution);
    for (int64_t j = 0; j < lower->count; j++) {
        const double *own = lower->values + j * lower->height;
        solution[j] /= own[0];
        for (int64_t k = 1; k < at_most(lower->height, lower->count - j); k++) solution[j + k] -= own[k] * solution[j];
    }
}

/* L⁻ᵀ of it. */
void solve_up(const Band *lower, double *solution) {
    for (int64_t j = lower->count - 1; j >= 0; j--) {
        const double *own = lower->values + j * lower->height;
        for (int64_t k = 1; k < at_most(lower->height, lower->count - j); k++) solution[j] -= own[k] * solution[j + k];
        solution[j] /= own[0];
    }
}

/* From the last column on: (inverse · L) is upper triangular, with 1 / L_jj on its diagonal. */
void inverse_of(const Band *lower, Band *inverse) {
    for (int64_t j = lower->count - 1; j >= 0; j--) {
        const double *own = lower->values + j * lower->height;
        int64_t below = at_most(lower->height, lower->count - j);
        for (int64_t i = j + at_most(inverse->height, lower->count - j) - 1; i >= j; i--) {
            double sum = i == j ? 1.0 / own[0] : 0.0;
            for (int64_t k = 1; k < below; k++) sum -= band_value(inverse, i, j + k) * own[k];
            *band_at(inverse, i, j) = sum / own[0];
        }
    }
}
