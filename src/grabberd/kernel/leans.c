/* Leans of discs as a quadratic in their places, for either half of the picture (as leans.py). */
#include "grey.h"

enum { TERMS = 6, ENOUGH = 12 };
static const double RIDGE = 0.01;

/* Normal equations of one half, their right side in the last column. */
typedef struct {
    int64_t count;
    double normal[TERMS][TERMS + 1];
} Half;

static int half_of(double column, const double size[2]) { return column >= size[1] / 2; }

static void terms_of(double column, double line, const double size[2], double terms[TERMS]) {
    double u = 4.0 * column / size[1] - (half_of(column, size) ? 3.0 : 1.0), v = 2.0 * line / size[0] - 1.0;
    const double own[TERMS] = {1.0, u, v, u * u, u * v, v * v};
    memcpy(terms, own, sizeof own);
}

/* By elimination, without pivots: the matrix is positive definite. The solution replaces the right side. */
static void solve_half(Half *half) {
    for (int i = 0; i < TERMS; i++) half->normal[i][i] += RIDGE;
    for (int i = 0; i < TERMS; i++)
        for (int k = i + 1; k < TERMS; k++) {
            double share = half->normal[k][i] / half->normal[i][i];
            for (int m = i; m <= TERMS; m++) half->normal[k][m] -= share * half->normal[i][m];
        }
    for (int i = TERMS - 1; i >= 0; i--) {
        for (int k = i + 1; k < TERMS; k++) half->normal[i][TERMS] -= half->normal[i][k] * half->normal[k][TERMS];
        half->normal[i][TERMS] /= half->normal[i][i];
    }
}

void leans_by_place(const double *lean, const double *column, const double *line, int64_t count, const double size[2], double *smooth) {
    Half halves[2] = {{0}};
    double terms[TERMS];
    for (int64_t i = 0; i < count; i++) {
        Half *half = halves + half_of(column[i], size);
        terms_of(column[i], line[i], size, terms);
        half->count++;
        for (int a = 0; a < TERMS; a++) {
            for (int b = 0; b < TERMS; b++) half->normal[a][b] += terms[a] * terms[b];
            half->normal[a][TERMS] += terms[a] * lean[i];
        }
    }
    for (int k = 0; k < 2; k++) solve_half(halves + k);
    for (int64_t i = 0; i < count; i++) {
        const Half *half = halves + half_of(column[i], size);
        terms_of(column[i], line[i], size, terms);
        smooth[i] = 0;
        for (int a = 0; a < TERMS && half->count >= ENOUGH; a++) smooth[i] += terms[a] * half->normal[a][TERMS];
    }
}
