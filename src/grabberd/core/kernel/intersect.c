/* Intersection of pairs of blobs to points (as intersection.py), four at once. */
#include "space.h"

static const double SETTLED_MM = 5e-3;
enum { MOST_STEPS = 10 };

/* Four pairs of blobs: coordinate and view, left before right. */
typedef struct {
    Four point[3], observed[2][VIEWS], scale[2][VIEWS], mixed;
    Four inverse[6], design[2][VIEWS][3], residual[2][VIEWS];
} Pairs;

static const int SQUARE[3][3] = {{0, 1, 2}, {1, 3, 4}, {2, 4, 5}};

INLINE void invert(const Four six[6], Four inverse[6]) {
    static const int FACTORS[4][6] = {{3, 2, 1, 0, 1, 0}, {5, 4, 4, 5, 2, 3}, {4, 1, 2, 2, 0, 1}, {4, 5, 3, 2, 4, 1}};
    Four cofactor[6];
    for (int i = 0; i < 6; i++)
        cofactor[i] = six[FACTORS[0][i]] * six[FACTORS[1][i]] - six[FACTORS[2][i]] * six[FACTORS[3][i]];
    Four determinant = six[0] * cofactor[0] + six[1] * cofactor[1] + six[2] * cofactor[2];
    for (int i = 0; i < 6; i++) inverse[i] = cofactor[i] / determinant;
}

INLINE void whiten(const Pairs *pairs, Four value[2][VIEWS]) {
    for (int c = 0; c < 2; c++)
        for (int v = 0; v < VIEWS; v++) value[c][v] *= pairs->scale[c][v];
    value[0][1] -= pairs->mixed * value[0][0];
}

/* One Gauss–Newton step; true if it was a long one. */
INLINE bool step(const Rig *rig, Pairs *pairs) {
    Four misfit[2][VIEWS], right[3] = {{0}}, six[6] = {{0}}, along[3];
    Image4 seen[VIEWS];
    for (int v = 0; v < VIEWS; v++) {
        linearise(rig, v, pairs->point, seen + v);
        for (int c = 0; c < 2; c++) {
            misfit[c][v] = pairs->residual[c][v] = pairs->observed[c][v] - seen[v].pixel[c];
            for (int k = 0; k < 3; k++) pairs->design[c][v][k] = seen[v].slope[c][k];
        }
    }
    whiten(pairs, misfit);
    for (int k = 0; k < 3; k++) {
        Four slopes[2][VIEWS];
        for (int c = 0; c < 2; c++)
            for (int v = 0; v < VIEWS; v++) slopes[c][v] = pairs->design[c][v][k];
        whiten(pairs, slopes);
        for (int c = 0; c < 2; c++)
            for (int v = 0; v < VIEWS; v++) pairs->design[c][v][k] = slopes[c][v];
    }
    for (int c = 0; c < 2; c++)
        for (int v = 0; v < VIEWS; v++) {
            const Four *row = pairs->design[c][v];
            for (int i = 0; i < 3; i++) {
                right[i] += row[i] * misfit[c][v];
                for (int k = i; k < 3; k++) six[SQUARE[i][k]] += row[i] * row[k];
            }
        }
    invert(six, pairs->inverse);
    bool is_long = false;
    for (int i = 0; i < 3; i++) {
        along[i] = pairs->inverse[SQUARE[i][0]] * right[0] + pairs->inverse[SQUARE[i][1]] * right[1] +
                   pairs->inverse[SQUARE[i][2]] * right[2];
        pairs->point[i] += along[i];
        for (int lane = 0; lane < FOUR; lane++) is_long |= fabs(along[i][lane]) > SETTLED_MM;
    }
    for (int v = 0; v < VIEWS; v++)
        for (int c = 0; c < 2; c++)
            pairs->residual[c][v] -= seen[v].slope[c][0] * along[0] + seen[v].slope[c][1] * along[1] + seen[v].slope[c][2] * along[2];
    return is_long;
}

WIDE static void adjust(const Rig *rig, Pairs *pairs, int64_t groups) {
    for (int i = 0; i < MOST_STEPS; i++) {
        bool is_long = false;
        for (int64_t group = 0; group < groups; group++) is_long |= step(rig, pairs + group);
        if (!is_long) return;
    }
}

/* As view_blobs.ImageNoise.whitening: pointing, and what both views share by line jitter. */
static void weigh(const World *world, const double *sigma[VIEWS], const double *common[VIEWS], const double y[VIEWS],
                  double reach_px, Pairs *pairs, int lane) {
    double shared[VIEWS], variance[VIEWS], overlap, apart = y[0] - y[1];
    for (int v = 0; v < VIEWS; v++) {
        shared[v] = common[0] && common[1] ? *common[v] : world->blob_jitter_px;
        variance[v] = sigma[v][0] * sigma[v][0] + shared[v] * shared[v];
        pairs->scale[1][v][lane] = 1.0 / sigma[v][1];
    }
    if (common[0] && common[1]) overlap = exp(-0.5 * (apart / reach_px * (apart / reach_px)));
    else overlap = larger(1.0 - fabs(apart) / (2.0 * world->radius_lines), 0.0);
    double first = 1.0 / sqrt(variance[0]), mixed = shared[0] * shared[1] * overlap * first;
    double second = 1.0 / sqrt(variance[1] - mixed * mixed);
    pairs->scale[0][0][lane] = first, pairs->scale[0][1][lane] = second;
    pairs->mixed[lane] = mixed * second;
}

static void fill(const World *world, int64_t pair, const double *start_mm, const ViewBlobs blobs[VIEWS], double reach_px,
                 const Found *found, Pairs *pairs, int lane) {
    const double *sigma[VIEWS], *common[VIEWS];
    double y[VIEWS];
    for (int k = 0; k < 3; k++) pairs->point[k][lane] = start_mm[3 * found->target[pair] + k];
    for (int v = 0; v < VIEWS; v++) {
        int64_t blob = found->blob[v][pair];
        sigma[v] = blobs[v].sigma_px + 2 * blob;
        common[v] = blobs[v].common_px ? blobs[v].common_px + blob : NULL;
        y[v] = blobs[v].xy_px[2 * blob + 1];
        for (int c = 0; c < 2; c++) pairs->observed[c][v][lane] = blobs[v].xy_px[2 * blob + c];
    }
    weigh(world, sigma, common, y, reach_px, pairs, lane);
}

double local_value(const LocalField *field, const double *coefficients, const double xy[2], int channel) {
    double along[2][4], value = 0;
    int64_t first[2], size[2] = {field->columns, field->rows};
    for (int c = 0; c < 2; c++) {
        double place = (xy[c] - field->origin_px[c]) * (1.0 / field->step_px);
        place = smaller(larger(place, 0.0), (double)(size[c] - 3) - 1e-9);
        first[c] = (int64_t)place;
        double t = place - (double)first[c];
        along[c][0] = (1 - 3 * t + 3 * t * t - t * t * t) / 6, along[c][1] = (4 - 6 * t * t + 3 * t * t * t) / 6;
        along[c][2] = (1 + 3 * t + 3 * t * t - 3 * t * t * t) / 6, along[c][3] = t * t * t / 6;
    }
    for (int row = 0; row < 4; row++)
        for (int column = 0; column < 4; column++)
            value += along[1][row] * along[0][column] *
                     coefficients[2 * ((first[1] + row) * field->columns + first[0] + column) + channel];
    return value;
}

/* (2, 18) slopes of the frame pixels of a view by its parameters (as functional_model.linearise_parameters). */
static void parameter_slopes(const Rig *rig, int view, const Image4 *seen, int lane, double slope[2][PARAMETERS]) {
    double x = seen->ideal[0][lane], y = seen->ideal[1][lane], near_by = seen->closeness[lane];
    double ideal[2] = {x, y}, direct[2][PARAMETERS] = {{0}};
    for (int c = 0; c < 2; c++) direct[c][0] = ideal[c] / rig->f_mm[view];
    for (int angle = 0; angle < 3; angle++) {
        double turned[3] = {0};
        for (int i = 0; i < 3; i++)
            for (int k = 0; k < 3; k++) turned[i] += rig->rates[angle][view][i][k] * seen->away[k][lane];
        for (int c = 0; c < 2; c++)
            direct[c][3 + angle] = (turned[c] * rig->f_mm[view] + ideal[c] * turned[2]) * near_by;
    }
    for (int c = 0; c < 2; c++)
        for (int k = 0; k < 6; k++)
            slope[c][k] = seen->own[c][lane] * direct[c][k] + seen->other[c][lane] * direct[1 - c][k];
    double xx = x * x, yy = y * y, r2 = xx + yy;
    double basis[2][9] = {{-x, y, x * r2, x * r2 * r2, x * r2 * r2 * r2, r2 + 2 * xx, 2 * x * y, -x * yy, 0},
                          {y, x, y * r2, y * r2 * r2, y * r2 * r2 * r2, 2 * x * y, r2 + 2 * yy, 0, -xx * y}};
    for (int c = 0; c < 2; c++) {
        slope[c][1] = c == 0, slope[c][2] = c == 1;
        for (int k = 0; k < 3; k++) slope[c][6 + k] = -seen->slope[c][k][lane];
        for (int k = 0; k < 9; k++) slope[c][9 + k] = basis[c][k] / rig->pixel_mm[c][view];
    }
}

/* Shift of the point by 1 px, not whitened, in each coordinate: (3, 4), coordinate and view. */
static void pulls_of(const Pairs *pairs, int lane, double pull[3][2][VIEWS]) {
    for (int i = 0; i < 3; i++) {
        for (int c = 0; c < 2; c++)
            for (int v = 0; v < VIEWS; v++) {
                pull[i][c][v] = 0;
                for (int k = 0; k < 3; k++)
                    pull[i][c][v] += pairs->inverse[SQUARE[i][k]][lane] * pairs->design[c][v][k][lane];
            }
        pull[i][0][0] -= pairs->mixed[lane] * pull[i][0][1];
        for (int c = 0; c < 2; c++)
            for (int v = 0; v < VIEWS; v++) pull[i][c][v] *= pairs->scale[c][v][lane];
    }
}

WIDE static void add_errors(const double *factor, int64_t errors, double slope, double *moved) {
    for (int64_t k = 0; k < errors; k++) moved[k] += slope * factor[k];
}

/* J·C·Jᵀ of one point (as intersection._calibration_share). */
static void calibration_share(const Rig *rig, const Pairs *pairs, const Image4 seen[VIEWS], int lane, double share[9]) {
    double pull[3][2][VIEWS], moved[3][MOST_ERRORS + 4] = {{0}};
    int64_t errors = rig->factor ? rig->errors : 0;
    pulls_of(pairs, lane, pull);
    for (int v = 0; v < VIEWS && rig->factor; v++) {
        double slope[2][PARAMETERS];
        parameter_slopes(rig, v, seen + v, lane, slope);
        for (int p = 0; p < PARAMETERS; p++)
            for (int i = 0; i < 3; i++)
                add_errors(rig->factor + (v * PARAMETERS + p) * errors, errors,
                           pull[i][0][v] * slope[0][p] + pull[i][1][v] * slope[1][p], moved[i]);
    }
    for (int v = 0; v < VIEWS; v++) {
        if (!rig->local[v].rows) continue;
        double xy[2] = {pairs->observed[0][v][lane], pairs->observed[1][v][lane]};
        for (int c = 0; c < 2; c++) {
            double sigma = local_value(rig->local + v, rig->local[v].sigma_px, xy, c), correlation = rig->correlation[c];
            /* As Rig.local_errors_px: the left one's error, of which the right one has a share beside its own. */
            for (int i = 0; i < 3; i++) {
                double *to = moved[i] + errors + 2 * c, by = sigma * pull[i][c][v];
                to[0] += v ? correlation * by : by;
                if (v) to[1] = sqrt(1.0 - correlation * correlation) * by;
            }
        }
    }
    if (rig->local[0].rows || rig->local[1].rows) errors += 4;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            share[3 * i + j] = 0;
            for (int64_t k = 0; k < errors; k++) share[3 * i + j] += moved[i][k] * moved[j][k];
        }
}

static void write_out(const World *world, const Pairs *pairs, const Image4 *seen, int64_t pair, int lane, Found *found) {
    double squares = 0;
    for (int i = 0; i < 3; i++) {
        found->xyz_mm[3 * pair + i] = pairs->point[i][lane];
        for (int k = 0; k < 3; k++) found->covariance[9 * pair + 3 * i + k] = pairs->inverse[SQUARE[i][k]][lane];
    }
    for (int v = 0; v < VIEWS; v++)
        for (int c = 0; c < 2; c++) {
            found->image_px[4 * pair + 2 * v + c] = pairs->observed[c][v][lane];
            squares += pairs->residual[c][v][lane] * pairs->residual[c][v][lane];
        }
    found->residual_px[pair] = sqrt(squares / 4);
    if (seen) calibration_share(&world->rig, pairs, seen, lane, found->calibration + 9 * pair);
    else memset(found->calibration + 9 * pair, 0, 9 * sizeof(double));
}

static void finish(const World *world, const Pairs *pairs, int64_t groups, int64_t count, Found *found) {
    const Rig *rig = &world->rig;
    bool is_uncertain = rig->factor || rig->local[0].rows || rig->local[1].rows;
    Image4 seen[VIEWS];
    for (int64_t group = 0; group < groups; group++) {
        for (int v = 0; v < VIEWS && is_uncertain; v++) linearise(rig, v, pairs[group].point, seen + v);
        for (int lane = 0; lane < FOUR && FOUR * group + lane < count; lane++)
            write_out(world, pairs + group, is_uncertain ? seen : NULL, FOUR * group + lane, lane, found);
    }
}

int intersect(const World *world, int64_t count, const double *start_mm, const ViewBlobs blobs[VIEWS], double reach_px, Found *found) {
    if (!count) return DONE;
    int64_t groups = (count + FOUR - 1) / FOUR;
    Pairs *pairs = aligned_alloc(32, (size_t)groups * sizeof *pairs);
    if (!pairs) return NO_MEMORY;
    for (int64_t i = 0; i < FOUR * groups; i++)
        fill(world, at_most(i, count - 1), start_mm, blobs, reach_px, found, pairs + i / FOUR, (int)(i % FOUR));
    adjust(&world->rig, pairs, groups);
    finish(world, pairs, groups, count, found);
    free(pairs);
    return DONE;
}
