/* Pairs of blobs whose rays meet, and the targets that may be there (as agreement.hypotheses). */
#include "agreement.h"

/* The right view's rays as coordinate arrays, with what each pair needs of them. */
typedef struct {
    double *direction[3], *normal[3], *variance_px2;
    bool *meets;
} Columns;

static void across(const double one[3], const double other[3], double product[3]) {
    for (int k = 0; k < 3; k++) product[k] = one[(k + 1) % 3] * other[(k + 2) % 3] - one[(k + 2) % 3] * other[(k + 1) % 3];
}

static double dot(const double one[3], const double other[3]) { return one[0] * other[0] + one[1] * other[1] + one[2] * other[2]; }

static void fill(const Rays *right, const ViewBlobs *blobs, const double base[3], Columns *columns) {
    for (int64_t i = 0; i < blobs->count; i++) {
        double normal[3], sigma_px = blobs->sigma_px[2 * i + 1];
        across(right->direction + 3 * i, base, normal);
        for (int k = 0; k < 3; k++) columns->direction[k][i] = right->direction[3 * i + k], columns->normal[k][i] = normal[k];
        columns->variance_px2[i] = sigma_px * sigma_px;
    }
}

/* Which rays of the right view pass one of the left within the gate: squares, so that no root is drawn. */
WIDE static void mark(const double left[3], double variance_px2, double gate_mm, const Columns *columns, int64_t count) {
    const double *x = columns->direction[0], *y = columns->direction[1], *z = columns->direction[2];
    const double *u = columns->normal[0], *v = columns->normal[1], *w = columns->normal[2], *own = columns->variance_px2;
    for (int64_t i = 0; i < count; i++) {
        double cosine = left[0] * x[i] + left[1] * y[i] + left[2] * z[i];
        double slenderness = 1.0 - cosine * cosine, volume = left[0] * u[i] + left[1] * v[i] + left[2] * w[i];
        /* Rays less than 1e-6 rad apart: their closest approach is rounding alone. */
        columns->meets[i] = (slenderness > 1e-12) &
                            (volume * volume <= gate_mm * gate_mm * (variance_px2 + own[i]) * slenderness);
    }
}

/* Middle of the shortest connection of two rays (as functional_model.approach). */
static void middle(const Rays rays[VIEWS], const double base[3], int64_t in_left, int64_t in_right, double middle_mm[3]) {
    const double *left = rays[0].direction + 3 * in_left, *right = rays[1].direction + 3 * in_right;
    double cosine = dot(left, right), along_left = dot(left, base), along_right = dot(right, base);
    double slenderness = 1.0 - cosine * cosine;
    double reach_left = (along_left - cosine * along_right) / slenderness, reach_right = (cosine * along_left - along_right) / slenderness;
    for (int k = 0; k < 3; k++)
        middle_mm[k] = rays[0].center_mm[k] + 0.5 * (reach_left * left[k] + reach_right * right[k] + base[k]);
}

/* P pairs, in the arrays of what will be found of them; each is its own target. */
typedef struct {
    int64_t count, room;
    double *middle_mm;
    Found found;
} Met;

static bool make_room(Met *met) {
    size_t room = met->room ? 2 * (size_t)met->room : 512;
    int64_t **whole[] = {&met->found.target, &met->found.blob[0], &met->found.blob[1]};
    for (size_t i = 0; i < 3; i++) {
        int64_t *more = realloc(*whole[i], room * sizeof *more);
        if (!more) return false;
        *whole[i] = more;
    }
    double *more = realloc(met->middle_mm, 3 * room * sizeof *more);
    if (!more) return false;
    met->middle_mm = more, met->room = (int64_t)room;
    return true;
}

static int pair_up(const Rays rays[VIEWS], const ViewBlobs blobs[VIEWS], double gate_mm, double *scratch, Met *met) {
    int64_t count = blobs[1].count;
    double base[3];
    Columns columns = {{scratch, scratch + count, scratch + 2 * count}, {scratch + 3 * count, scratch + 4 * count, scratch + 5 * count},
                       scratch + 6 * count, (bool *)(scratch + 7 * count)};
    for (int k = 0; k < 3; k++) base[k] = rays[1].center_mm[k] - rays[0].center_mm[k];
    fill(rays + 1, blobs + 1, base, &columns);
    for (int64_t i = 0; i < blobs[0].count; i++) {
        double sigma_px = blobs[0].sigma_px[2 * i + 1];
        mark(rays[0].direction + 3 * i, sigma_px * sigma_px, gate_mm, &columns, count);
        for (int64_t k = 0; k < count; k++) {
            if (!columns.meets[k]) continue;
            if (met->count == met->room && !make_room(met)) return NO_MEMORY;
            middle(rays, base, i, k, met->middle_mm + 3 * met->count);
            met->found.target[met->count] = met->count;
            met->found.blob[0][met->count] = i, met->found.blob[1][met->count++] = k;
        }
    }
    return DONE;
}

static void note(const Met *met, int64_t pair, int64_t target, const double apart_mm[3], Hypotheses *known) {
    int64_t k = known->count++;
    if (k >= known->room) return;
    known->target[k] = target;
    for (int v = 0; v < VIEWS; v++) known->blob[v][k] = met->found.blob[v][pair];
    for (int c = 0; c < 3; c++) {
        known->displacement_mm[3 * k + c] = apart_mm[c];
        known->variance_mm2[3 * k + c] = met->found.covariance[9 * pair + 4 * c];
    }
}

static void list(const World *world, const Met *met, double farthest_mm, Hypotheses *known) {
    for (int64_t target = 0; target < world->targets; target++)
        for (int64_t pair = 0; pair < met->count; pair++) {
            double apart_mm[3];
            for (int k = 0; k < 3; k++) apart_mm[k] = met->found.xyz_mm[3 * pair + k] - world->nominal_mm[3 * target + k];
            if (dot(apart_mm, apart_mm) <= farthest_mm * farthest_mm) note(met, pair, target, apart_mm, known);
        }
}

/* The calibration's share of their covariance decides nothing here, and is not computed. */
static int intersect_alone(const World *world, const ViewBlobs blobs[VIEWS], double reach_px, Met *met) {
    World alone = *world;
    alone.rig.factor = NULL;
    for (int v = 0; v < VIEWS; v++) alone.rig.local[v].rows = 0;
    double *number = malloc((size_t)met->count * 26 * sizeof *number + 1);
    if (!number) return NO_MEMORY;
    Found *found = &met->found;
    found->xyz_mm = number, found->covariance = number + 3 * met->count, found->calibration = number + 12 * met->count;
    found->image_px = number + 21 * met->count, found->residual_px = number + 25 * met->count;
    return intersect(&alone, met->count, met->middle_mm, blobs, reach_px, found);
}

int list_hypotheses(const World *world, const ViewBlobs blobs[VIEWS], double reach_px, double gate_mm, double farthest_mm,
                    Hypotheses *known) {
    Met met = {0};
    Rays rays[VIEWS];
    double *scratch = malloc((size_t)(3 * blobs[0].count + 11 * blobs[1].count) * sizeof *scratch + 1);
    double *direction[VIEWS] = {scratch, scratch ? scratch + 3 * blobs[0].count : NULL};
    for (int v = 0; v < VIEWS && scratch; v++) {
        directions_of(&world->rig, v, blobs + v, direction[v]);
        rays[v] = (Rays){world->rig.center_mm[v], direction[v]};
    }
    int status = scratch ? pair_up(rays, blobs, gate_mm, direction[1] + 3 * blobs[1].count, &met) : NO_MEMORY;
    if (status == DONE) status = intersect_alone(world, blobs, reach_px, &met);
    known->count = 0;
    if (status == DONE) list(world, &met, farthest_mm, known);
    if (known->count > known->room) status = MORE_ROOM;
    free(scratch);
    free(met.middle_mm);
    free(met.found.xyz_mm);
    free(met.found.target);
    for (int v = 0; v < VIEWS; v++) free(met.found.blob[v]);
    return status;
}
