/* Rays on which observed points lie (as functional_model.rays). */
#include "agreement.h"

enum { MOST_STEPS = 30 };
static const double TOLERANCE_MM = 1e-10;

/* Image of an ideal point, and how it moves with it: own and other coordinate. */
typedef struct {
    double pixel[2], own[2], other[2];
} Seen1;

static Seen1 image_of(const Rig *rig, int view, const double ideal[2]) {
    double x = ideal[0], y = ideal[1], xx = x * x, yy = y * y, xy = x * y, r2 = xx + yy, r4 = r2 * r2, value[8];
    const double one[15] = {1, x, y, xx, yy, xy, r2, r4, r4 * r2, xx * r2, yy * r2, xy * r2, xx * r4, yy * r4, xy * r4};
    Seen1 seen;
    for (int i = 0; i < 8; i++) {
        value[i] = 0;
        for (int k = 0; k < 15; k++) value[i] += rig->image[view][i][k] * one[k];
    }
    for (int c = 0; c < 2; c++) {
        seen.pixel[c] = ideal[c] * value[c] + ideal[1 - c] * value[2 + c] + rig->origin_px[c][view];
        seen.own[c] = value[4 + c], seen.other[c] = value[6 + c];
    }
    return seen;
}

/* Removes the distortion by Newton's iteration; false where it does not converge, or beyond the distortion's fold. */
static bool correct(const Rig *rig, int view, const double xy_px[2], double ideal[2]) {
    double upright = rig->pixel_mm[0][view] * rig->pixel_mm[1][view] < 0 ? -1.0 : 1.0;
    for (int c = 0; c < 2; c++) ideal[c] = (xy_px[c] - rig->origin_px[c][view]) * rig->pixel_mm[c][view];
    for (int turn = 0; turn < MOST_STEPS; turn++) {
        Seen1 seen = image_of(rig, view, ideal);
        double area = seen.own[0] * seen.own[1] - seen.other[0] * seen.other[1], excess[2], farthest = 0;
        for (int c = 0; c < 2; c++) excess[c] = seen.pixel[c] - xy_px[c];
        for (int c = 0; c < 2; c++) {
            double step = (excess[c] * seen.own[1 - c] - seen.other[c] * excess[1 - c]) / area;
            ideal[c] -= step;
            farthest = fabs(step) <= farthest ? farthest : fabs(step); /* NaN stays */
        }
        if (farthest < TOLERANCE_MM) return area * upright > 0.0;
        if (!isfinite(area)) return false;
    }
    return false;
}

void directions_of(const Rig *rig, int view, const ViewBlobs *blobs, double *direction) {
    for (int64_t i = 0; i < blobs->count; i++) {
        double ideal[2], f_mm = rig->f_mm[view];
        bool is_known = correct(rig, view, blobs->xy_px + 2 * i, ideal);
        double length = is_known ? sqrt(ideal[0] * ideal[0] + ideal[1] * ideal[1] + f_mm * f_mm) : NAN;
        const double camera[3] = {ideal[0] / length, ideal[1] / length, -f_mm / length};
        for (int k = 0; k < 3; k++) {
            direction[3 * i + k] = 0;
            for (int j = 0; j < 3; j++) direction[3 * i + k] += rig->rotation[view][j][k] * camera[j];
        }
    }
}
