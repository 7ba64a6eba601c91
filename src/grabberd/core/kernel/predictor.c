/* What some targets tell of all of them (as displacement_field.DisplacementField.say). No library of linear algebra does
   it: those round otherwise with every number of threads, and live points would not be those measured again. */
#include "agreement.h"

void invert(int64_t targets, const double *covariance_mm2, double *precision, double *row) {
    memcpy(precision, covariance_mm2, (size_t)(targets * targets) * sizeof *precision);
    for (int64_t i = 0; i < targets; i++) sweep(precision, targets, i, 1.0, row);
    for (int64_t i = 0; i < targets * targets; i++) precision[i] = -precision[i];
}

/* Starts from nobody or from all, whichever is nearer. */
static void sweep_seen(const Smooth *smooth, const uint8_t *seen, int64_t count, double *swept, double *row) {
    int64_t targets = smooth->targets;
    bool is_filled = 2 * count < targets;
    const double *from = is_filled ? smooth->covariance_mm2 : smooth->precision;
    for (int64_t i = 0; i < targets * targets; i++) swept[i] = is_filled ? from[i] : -from[i];
    for (int64_t i = 0; i < targets; i++)
        if ((seen[i] != 0) == is_filled) sweep(swept, targets, i, is_filled ? 1.0 : -1.0, row);
}

void predictor_of(const Smooth *smooth, const uint8_t *seen, int64_t count, double *weights, double *sigma_mm, double *scratch) {
    int64_t targets = smooth->targets;
    double *swept = scratch, *row = scratch + targets * targets;
    sweep_seen(smooth, seen, count, swept, row);
    for (int64_t i = 0; i < targets; i++) {
        double own = swept[(targets + 1) * i], variance = seen[i] ? -1.0 / own : own;
        sigma_mm[i] = sqrt(larger(variance - smooth->noise_mm2, 0.0));
        row[i] = seen[i] ? variance : 1.0; /* a seen target is told by all but itself */
    }
    for (int64_t k = 0; k < targets; k++) {
        if (!seen[k]) continue;
        for (int64_t i = 0; i < targets; i++) weights[i] = swept[targets * k + i] * row[i];
        weights[k] = 0.0;
        weights += targets;
    }
}
