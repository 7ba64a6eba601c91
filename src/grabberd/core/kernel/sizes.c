/* Apparent size of targets over the picture (as locale_sizes.py). */
#include "kernel.h"

enum { TERMS = 6 };
static const double STIFFNESS = 6.0, LEAST_PX2 = 0.25, POINTING_X_PX2 = 0.009, POINTING_Y_PX2 = 0.013;

/* The quadratic of one half of the picture. */
typedef struct {
    double middle_x, middle_row, extent_x, extent_row;
    double mean[3], factor[TERMS][3];
} Surface;

INLINE void terms_of(const Surface *surface, const Component *own, double terms[TERMS]) {
    double x = (own->x - surface->middle_x) / surface->extent_x;
    double y = (own->row - surface->middle_row) / surface->extent_row;
    terms[0] = 1.0, terms[1] = x, terms[2] = y, terms[3] = x * y, terms[4] = x * x - 1, terms[5] = y * y - 1;
}

/* Gauss with pivots; the matrix is symmetric and held regular. */
static void solve(double matrix[TERMS][TERMS], double right[TERMS][3], double solution[TERMS][3]) {
    for (int step = 0; step < TERMS; step++) {
        int pivot = step;
        for (int i = step + 1; i < TERMS; i++)
            if (fabs(matrix[i][step]) > fabs(matrix[pivot][step])) pivot = i;
        for (int k = 0; k < TERMS && pivot != step; k++) {
            double kept = matrix[step][k];
            matrix[step][k] = matrix[pivot][k], matrix[pivot][k] = kept;
        }
        for (int k = 0; k < 3 && pivot != step; k++) {
            double kept = right[step][k];
            right[step][k] = right[pivot][k], right[pivot][k] = kept;
        }
        for (int i = step + 1; i < TERMS; i++) {
            double share = matrix[i][step] / matrix[step][step];
            for (int k = step; k < TERMS; k++) matrix[i][k] -= share * matrix[step][k];
            for (int k = 0; k < 3; k++) right[i][k] -= share * right[step][k];
        }
    }
    for (int i = TERMS - 1; i >= 0; i--)
        for (int k = 0; k < 3; k++) {
            double sum = right[i][k];
            for (int j = i + 1; j < TERMS; j++) sum -= matrix[i][j] * solution[j][k];
            solution[i][k] = sum / matrix[i][i];
        }
}

static bool is_right(const Picture *picture, const Component *own) {
    return own->x >= (double)(picture->columns - 1) / 2;
}

/* The targets of one half, in the order of the components, which does not tell the halves apart. */
typedef struct {
    const Component **own;
    Size **size;
    int64_t count;
} Half;

static void frame_surface(const Half *half, Surface *surface, double *total) {
    double x = 0, row = 0, xx = 0, rr = 0;
    *total = 0;
    for (int64_t i = 0; i < half->count; i++) *total += half->size[i]->delivered;
    *total = larger(*total, 1e-9);
    for (int64_t i = 0; i < half->count; i++) {
        const Component *own = half->own[i];
        double share = half->size[i]->delivered / *total;
        x += share * own->x, row += share * own->row;
        xx += share * (own->x * own->x), rr += share * (own->row * own->row);
    }
    surface->middle_x = x, surface->middle_row = row;
    surface->extent_x = sqrt(larger(xx - x * x, 1.0));
    surface->extent_row = sqrt(larger(rr - row * row, 1.0));
}

INLINE void values_of(const Size *size, double values[3]) {
    values[0] = size->half_width_px, values[1] = size->half_height_px, values[2] = size->lean;
}

/* `sizes` hold the moments yet: half width xx, half height yy, lean xy. */
static void fit(const Half *half, Surface *surface) {
    double total, values[3], normal[TERMS][TERMS] = {{0}}, sums[TERMS][3] = {{0}}, terms[TERMS];
    frame_surface(half, surface, &total);
    for (int k = 0; k < 3; k++) surface->mean[k] = 0;
    for (int64_t i = 0; i < half->count; i++) {
        values_of(half->size[i], values);
        for (int k = 0; k < 3; k++) surface->mean[k] += values[k];
    }
    for (int k = 0; k < 3; k++) surface->mean[k] /= total;
    for (int64_t i = 0; i < half->count; i++) {
        double weight = half->size[i]->delivered;
        values_of(half->size[i], values);
        terms_of(surface, half->own[i], terms);
        for (int k = 0; k < 3; k++) values[k] -= surface->mean[k] * weight;
        for (int a = 0; a < TERMS; a++) {
            double weighted = terms[a] * weight;
            for (int b = 0; b < TERMS; b++) normal[a][b] += weighted * terms[b];
            for (int k = 0; k < 3; k++) sums[a][k] += terms[a] * values[k];
        }
    }
    normal[0][0] += 1e-9;
    for (int a = 1; a < TERMS; a++) normal[a][a] += STIFFNESS * total / larger((double)half->count, 1);
    solve(normal, sums, surface->factor);
}

static void smooth(const Picture *picture, const Component *own, const Surface *surface, Size *size) {
    double terms[TERMS], value[3] = {0};
    terms_of(surface, own, terms);
    for (int a = 0; a < TERMS; a++)
        for (int k = 0; k < 3; k++) value[k] += surface->factor[a][k] * terms[a];
    for (int k = 0; k < 3; k++) value[k] += surface->mean[k];
    double y_step = (double)picture->y_step;
    double yy = larger(value[1] + POINTING_Y_PX2 * (y_step * y_step), LEAST_PX2);
    double across = larger(value[0] + POINTING_X_PX2 * y_step - value[2] * value[2] / yy, LEAST_PX2);
    size->half_width_px = 2 * sqrt(across);
    size->half_height_px = 2 * sqrt(yy);
    size->lean = value[2] / yy;
}

/* Whole components with delivered rows in one half: those without any count for nothing but are told their size. */
static void gather(const Picture *picture, const Seen *seen, Size *sizes, bool right, bool delivered, Half *half) {
    half->count = 0;
    for (int64_t i = 0; i < seen->component_count; i++) {
        const Component *own = seen->components + i;
        half->own[half->count] = own, half->size[half->count] = sizes + i;
        half->count += own->whole && is_right(picture, own) == right && (!delivered || sizes[i].delivered > 0);
    }
}

int sizes_of(const Picture *picture, const Seen *seen, Size *sizes) {
    size_t room = (size_t)seen->component_count + 1;
    Half half = {malloc(room * sizeof *half.own), malloc(room * sizeof *half.size), 0};
    int status = half.own && half.size ? DONE : NO_MEMORY;
    for (int64_t i = 0; i < seen->component_count; i++) {
        if (!seen->components[i].whole) continue;
        const Moments *own = &seen->components[i].moments;
        sizes[i] = (Size){own->xx, own->yy, own->xy, own->pixels};
    }
    for (int right = 0; right < 2 && status == DONE; right++) {
        Surface surface;
        gather(picture, seen, sizes, right, true, &half);
        fit(&half, &surface);
        gather(picture, seen, sizes, right, false, &half);
        for (int64_t i = 0; i < half.count; i++) smooth(picture, half.own[i], &surface, half.size[i]);
    }
    free(half.own);
    free(half.size);
    return status;
}
