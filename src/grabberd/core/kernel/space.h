/* What tracking and intersection share: the rig, the object, and one field's targets. */
#ifndef GRABBERD_SPACE_H
#define GRABBERD_SPACE_H

#include "kernel.h"

/* As points.Miss; where both views have no blob, both bits are set. */
enum { NO_BLOB = 1, RAYS_APART = 4, OFF_PLACE = 5, TAKEN = 10, CROWDED, TURNED_AWAY, HIDDEN, MERGED };
/* In place of a blob: none is near, or the one there is nearer to another target. */
enum { NO_BLOB_NEAR = -1, BLOB_TAKEN = -2 };
enum { VIEWS = 2, PARAMETERS = 18, MOST_ERRORS = 2 * PARAMETERS, FOUR = 4, FOUND_NUMBERS = 32, FOUND_INDICES = 5 };
typedef double Four __attribute__((vector_size(32)));

/* As `LocalField`: splines of a displacement and of its standard deviation over one view. */
typedef struct {
    double origin_px[2], step_px;
    const double *shift_px, *sigma_px; /* (rows, columns, 2) each */
    int64_t rows, columns;
} LocalField;

/* As `Rig`. */
typedef struct {
    double rotation[VIEWS][3][3], rates[3][VIEWS][3][3], center_mm[VIEWS][3], f_mm[VIEWS];
    double origin_px[2][VIEWS], pixel_mm[2][VIEWS], image[VIEWS][8][15];
    const double *factor; /* (VIEWS, PARAMETERS, errors), or none */
    int64_t errors;
    LocalField local[VIEWS]; /* of 0 rows where there is none */
    double correlation[2];   /* correlation of their errors, in x and in y */
} Rig;

/* The grid of targets as a wall (facing.Facing): three targets of each slope, along the rows and along the columns; and
   the targets of every row and column. */
typedef struct {
    const int64_t *slope_of;     /* (2, 3, targets) */
    const double *slope_weight;  /* (2, 3, targets) */
    double side, half_pitch_px;
    int64_t lines;
    const int64_t *line_begin, *line; /* (lines + 1,), and all of them one after the other */
} Wall;

/* Which targets the views cannot show, as `Miss`, and what that is found with. */
typedef struct {
    int64_t *unseen;         /* (VIEWS, targets), as the two below */
    double *toward, *length2;
    double *away_mm;         /* (targets,) */
} Facing;

/* What is known of the object and of the noise. */
typedef struct {
    Rig rig;
    int64_t targets, pairs;
    const double *nominal_mm;             /* (targets, 3) */
    const int64_t *neighbours;            /* (pairs, 2) */
    const double *apart_mm;               /* (pairs,) */
    double gate, stretch, unmodelled_px, noise_mm, blob_jitter_px, radius_lines;
    Wall wall;
} World;

/* N blobs of one view; `common_px` may be none. */
typedef struct {
    const double *xy_px, *sigma_px, *common_px;
    int64_t count;
} ViewBlobs;

/* What was found of K targets, each array with room for all targets of the object. */
typedef struct {
    int64_t *target, *blob[VIEWS];
    double *xyz_mm, *covariance, *calibration, *image_px, *residual_px; /* 3, 9, 9, 4, 1 each */
    double *displacement_mm, *variance_mm2;                             /* 3, 3 each */
    int64_t *miss;                                                      /* of every target, as `Miss` */
    double *predicted_px;                                               /* (VIEWS, targets, 2), of every target */
} Found;

/* Pictures and slopes of four points at once, of one view: coordinate; coordinate and X, Y, Z. */
typedef struct {
    Four pixel[2], slope[2][3];
    Four ideal[2], away[3], closeness, own[2], other[2];
} Image4;

int near(const World *, const double *places_mm, const double *sigma_mm, const ViewBlobs blobs[VIEWS], double reach_px,
         Found *, int64_t *found, double *surprise);
Found found_in(int64_t *index, double *number, double *predicted_px, int64_t room); /* FOUND_NUMBERS · room of them */
void take_over(Found *, int64_t from, int64_t to); /* but for displacement and variance */
double surprise_of(const double *places_mm, const double *sigma_mm, int64_t count, const Found *);
double local_value(const LocalField *, const double *coefficients, const double xy[2], int channel);
int nearest(int64_t targets, const double *image_px, const double *reach_px, const int64_t *unseen, const ViewBlobs *, int64_t *blob);
void find_unseen(const World *, const double *places_mm, const double *image_px, Facing *);
int intersect(const World *, int64_t count, const double *start_mm, const ViewBlobs blobs[VIEWS], double reach_px, Found *);
void mark_torn(const World *, const double *moved_mm, const bool *seen, bool *torn);
void expect_all(int64_t targets, const double *weights, int64_t count, const double *displacement_mm, double *expected_mm,
                double *scratch);
int64_t worst_of(const World *, const double *weights, const double *sigma_mm, int64_t count, const int64_t *target,
                 const double *displacement_mm, const double *variance_mm2, double *expected_mm, double *scratch);
void settle(const World *, const double *expected_mm, const double *sigma_mm, int64_t count, const int64_t *target,
            const double *displacement_mm, const double *covariance, double *places_mm, double *settled_sigma_mm);

INLINE Four root4(Four value) {
    Four root;
    for (int i = 0; i < FOUR; i++) root[i] = sqrt(value[i]);
    return root;
}

/* As functional_model.linearise: what lies in or behind the plane of the projection centre gives NaN. */
INLINE void linearise(const Rig *rig, int view, const Four point[3], Image4 *seen) {
    Four camera[3], one[15], value[8], slope[2][3];
    for (int k = 0; k < 3; k++) seen->away[k] = point[k] - rig->center_mm[view][k];
    for (int i = 0; i < 3; i++) {
        const double *row = rig->rotation[view][i];
        camera[i] = row[0] * seen->away[0] + row[1] * seen->away[1] + row[2] * seen->away[2];
    }
    for (int i = 0; i < FOUR; i++) seen->closeness[i] = camera[2][i] < 0.0 ? -1.0 / camera[2][i] : NAN;
    Four scale = rig->f_mm[view] * seen->closeness, x = camera[0] * scale, y = camera[1] * scale;
    Four xx = x * x, yy = y * y, xy = x * y, r2 = xx + yy, r4 = r2 * r2;
    one[0] = (Four){1, 1, 1, 1}, one[1] = x, one[2] = y, one[3] = xx, one[4] = yy, one[5] = xy;
    one[6] = r2, one[7] = r4, one[8] = r4 * r2, one[9] = xx * r2, one[10] = yy * r2, one[11] = xy * r2;
    one[12] = xx * r4, one[13] = yy * r4, one[14] = xy * r4;
    for (int i = 0; i < 8; i++) {
        value[i] = rig->image[view][i][0] * one[0];
        for (int k = 1; k < 15; k++) value[i] += rig->image[view][i][k] * one[k];
    }
    seen->ideal[0] = x, seen->ideal[1] = y;
    for (int c = 0; c < 2; c++) {
        seen->own[c] = value[4 + c], seen->other[c] = value[6 + c];
        seen->pixel[c] = seen->ideal[c] * value[c] + seen->ideal[1 - c] * value[2 + c] + rig->origin_px[c][view];
        for (int k = 0; k < 3; k++)
            slope[c][k] = (rig->rotation[view][c][k] * rig->f_mm[view] + seen->ideal[c] * rig->rotation[view][2][k]) * seen->closeness;
    }
    for (int c = 0; c < 2; c++)
        for (int k = 0; k < 3; k++) seen->slope[c][k] = seen->own[c] * slope[c][k] + seen->other[c] * slope[1 - c][k];
}

#endif
