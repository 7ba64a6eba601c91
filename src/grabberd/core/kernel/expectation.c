/* What the seen targets tell of the others (as displacement_field.DisplacementField), one target more or less. */
#include "agreement.h"

void expect_nothing(Expectation *field, const double *covariance_mm2) {
    size_t targets = (size_t)field->targets;
    memcpy(field->swept, covariance_mm2, targets * targets * sizeof *field->swept);
    memset(field->value, 0, 3 * targets * sizeof *field->value);
    memset(field->seen_mm, 0, 3 * targets * sizeof *field->seen_mm);
    memset(field->seen, 0, targets * sizeof *field->seen);
}

/* Pivots on a target; `sign` is 1 for adding it, −1 for taking it away. */
WIDE void sweep(double *swept, int64_t targets, int64_t target, double sign, double *row) {
    memcpy(row, swept + targets * target, (size_t)targets * sizeof *row);
    double pivot = row[target];
    for (int64_t i = 0; i < targets; i++) {
        double *own = swept + targets * i, share = row[i] / pivot;
        if (i == target) continue;
        for (int64_t k = 0; k < targets; k++) own[k] -= share * row[k];
        own[target] = sign * share;
    }
    for (int64_t k = 0; k < targets; k++) swept[targets * target + k] = sign * (row[k] / pivot);
    swept[targets * target + target] = -1.0 / pivot;
}

/* Moves every value along the target's row, in opposite senses for seen and unseen ones. */
static void shift(Expectation *field, int64_t target, const double by_mm[3]) {
    const double *row = field->swept + field->targets * target;
    for (int64_t i = 0; i < field->targets; i++) {
        double share = field->seen[i] ? -row[i] : row[i];
        for (int k = 0; k < 3; k++) field->value[3 * i + k] += share * by_mm[k];
    }
}

void see(Expectation *field, int64_t target, const double displacement_mm[3]) {
    double news[3], variance = field->swept[(field->targets + 1) * target], *own = field->value + 3 * target;
    for (int k = 0; k < 3; k++) news[k] = (displacement_mm[k] - own[k]) / variance;
    shift(field, target, news);
    for (int k = 0; k < 3; k++) own[k] = news[k], field->seen_mm[3 * target + k] = displacement_mm[k];
    sweep(field->swept, field->targets, target, 1.0, field->row);
    field->seen[target] = true;
}

void forget(Expectation *field, int64_t target) {
    double displacement_mm[3], news[3], *own = field->value + 3 * target;
    expected_of(field, target, displacement_mm);
    for (int k = 0; k < 3; k++) news[k] = displacement_mm[k] - field->seen_mm[3 * target + k];
    shift(field, target, news);
    memcpy(own, displacement_mm, sizeof displacement_mm);
    sweep(field->swept, field->targets, target, -1.0, field->row);
    field->seen[target] = false;
}

double expected_of(const Expectation *field, int64_t target, double displacement_mm[3]) {
    double own = field->swept[(field->targets + 1) * target];
    const double *value = field->value + 3 * target;
    double variance = field->seen[target] ? -1.0 / own : own;
    for (int k = 0; k < 3; k++)
        displacement_mm[k] = field->seen[target] ? field->seen_mm[3 * target + k] - value[k] * variance : value[k];
    return larger(variance - field->noise_mm2, 0.0);
}
