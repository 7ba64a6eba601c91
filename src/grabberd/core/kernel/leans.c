/* Leans of discs as quadratics in their places, one for either half of the picture, and as unknowns beside the shifts (as line_shifts.Leans). */
#include "leans.h"

enum { ONE_HALF = TERMS / 2, ENOUGH = 12 };
static const double RIDGE = 0.01, ANY_LEAN = 0.5;

void terms_by_place(const double *column, const double *line, int64_t count, const double size[2], Terms *terms) {
    int64_t found[2] = {0, 0};
    for (int64_t i = 0; i < count; i++) found[column[i] >= size[1] / 2]++;
    memset(terms, 0, (size_t)count * sizeof *terms);
    for (int64_t i = 0; i < count; i++) {
        int half = column[i] >= size[1] / 2;
        double u = 4.0 * column[i] / size[1] - (half ? 3.0 : 1.0), v = 2.0 * line[i] / size[0] - 1.0;
        const double own[ONE_HALF] = {1.0, u, v, u * u, u * v, v * v};
        if (found[half] >= ENOUGH) memcpy(terms[i] + half * ONE_HALF, own, sizeof own);
    }
}

/* The first term of the half that a disc is in: those of the other one are zero. */
INLINE int half_of(const double *terms) { return terms[ONE_HALF] != 0 ? ONE_HALF : 0; }

/* In place, of a positive definite matrix of which the lower triangle is given. */
static void factor_terms(Terms *matrix) {
    for (int i = 0; i < TERMS; i++)
        for (int k = 0; k <= i; k++) {
            double sum = matrix[i][k];
            for (int m = 0; m < k; m++) sum -= matrix[i][m] * matrix[k][m];
            matrix[i][k] = i == k ? sqrt(sum) : sum / matrix[k][k];
        }
}

static void solve_terms_down(const Terms *root, double *solution) {
    for (int i = 0; i < TERMS; i++) {
        for (int k = 0; k < i; k++) solution[i] -= root[i][k] * solution[k];
        solution[i] /= root[i][i];
    }
}

static void solve_terms_up(const Terms *root, double *solution) {
    for (int i = TERMS - 1; i >= 0; i--) {
        for (int k = i + 1; k < TERMS; k++) solution[i] -= root[k][i] * solution[k];
        solution[i] /= root[i][i];
    }
}

WIDE void smooth_leans(const Terms *terms, const double *lean, int64_t count, double *smooth) {
    Terms normal[TERMS] = {{0}}, found = {0};
    for (int a = 0; a < TERMS; a++) normal[a][a] = RIDGE;
    for (int64_t i = 0; i < count; i++) {
        const double *own = terms[i] + half_of(terms[i]);
        int first = half_of(terms[i]);
        for (int a = 0; a < ONE_HALF; a++) {
            found[first + a] += own[a] * lean[i];
            for (int b = 0; b < ONE_HALF; b++) normal[first + a][first + b] += own[a] * own[b];
        }
    }
    factor_terms(normal);
    solve_terms_down(normal, found);
    solve_terms_up(normal, found);
    for (int64_t i = 0; i < count; i++) {
        smooth[i] = 0;
        for (int a = 0; a < TERMS; a++) smooth[i] += terms[i][a] * found[a];
    }
}

void no_leans(Leans *leans, int64_t lines) {
    memset(leans->shifts, 0, (size_t)lines * sizeof *leans->shifts);
    memset(leans->own, 0, sizeof leans->own);
    memset(leans->right, 0, sizeof leans->right);
    for (int a = 0; a < TERMS; a++) leans->own[a][a] = 1.0 / (ANY_LEAN * ANY_LEAN);
}

WIDE void add_leans(Leans *leans, const double *terms, double squares, double right) {
    int first = half_of(terms);
    for (int a = first; a < first + ONE_HALF; a++) {
        leans->right[a] += right * terms[a];
        for (int b = first; b < first + ONE_HALF; b++) leans->own[a][b] += squares * terms[a] * terms[b];
    }
}

/* L⁻¹ of what ties leans to shifts, all terms side by side. */
WIDE static void solve_all_down(const Band *lower, Terms *restrict half) {
    for (int64_t j = 0; j < lower->count; j++) {
        const double *own = lower->values + j * lower->height, scale = 1.0 / own[0];
        for (int a = 0; a < TERMS; a++) half[j][a] *= scale;
        for (int64_t k = 1; k < at_most(lower->height, lower->count - j); k++)
            for (int a = 0; a < TERMS; a++) half[j + k][a] -= own[k] * half[j][a];
    }
}

WIDE static void solve_all_up(const Band *lower, Terms *restrict whole) {
    for (int64_t j = lower->count - 1; j >= 0; j--) {
        const double *own = lower->values + j * lower->height, scale = 1.0 / own[0];
        for (int64_t k = 1; k < at_most(lower->height, lower->count - j); k++)
            for (int a = 0; a < TERMS; a++) whole[j][a] -= own[k] * whole[j + k][a];
        for (int a = 0; a < TERMS; a++) whole[j][a] *= scale;
    }
}

WIDE static void take_off(const Terms *restrict half, const double *solved, int64_t count, Leans *restrict leans) {
    for (int64_t j = 0; j < count; j++)
        for (int a = 0; a < TERMS; a++) {
            leans->rest[a] -= half[j][a] * solved[j];
            for (int b = 0; b < TERMS; b++) leans->root[a][b] -= half[j][a] * half[j][b];
        }
}

void eliminate_shifts(Leans *leans, const Band *lower, const double *solved) {
    memcpy(leans->half, leans->shifts, (size_t)lower->count * sizeof *leans->half);
    memcpy(leans->root, leans->own, sizeof leans->root);
    memcpy(leans->rest, leans->right, sizeof leans->rest);
    solve_all_down(lower, leans->half);
    take_off(leans->half, solved, lower->count, leans);
    factor_terms(leans->root);
    solve_terms_down(leans->root, leans->rest);
}

void solve_leans(const Leans *leans, int64_t count, double *solved) {
    Terms found;
    memcpy(found, leans->rest, sizeof found);
    solve_terms_up(leans->root, found);
    for (int64_t j = 0; j < count; j++)
        for (int a = 0; a < TERMS; a++) solved[j] -= leans->half[j][a] * found[a];
}

/* The inverse of the factor, its columns one after the other. */
static void invert_terms(const Terms *root, Terms *columns) {
    memset(columns, 0, TERMS * sizeof *columns);
    for (int a = 0; a < TERMS; a++) {
        columns[a][a] = 1.0;
        solve_terms_down(root, columns[a]);
    }
}

/* Each of these by the matrix of such columns, which is a lower triangle. */
WIDE static void multiply_all(const Terms *restrict columns, int64_t count, Terms *restrict values) {
    for (int64_t j = 0; j < count; j++) {
        Terms sum = {0};
        for (int a = 0; a < TERMS; a++)
            for (int b = 0; b < TERMS; b++) sum[b] += columns[a][b] * values[j][a];
        memcpy(values[j], sum, sizeof sum);
    }
}

void spread_of(Leans *leans, const Band *lower) {
    Terms columns[TERMS];
    solve_all_up(lower, leans->half);
    invert_terms(leans->root, columns);
    multiply_all(columns, lower->count, leans->half);
}
