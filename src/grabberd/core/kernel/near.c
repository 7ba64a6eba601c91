/* Search for targets near their expected positions in both views (as correspondence.near), and their agreement. */
#include "space.h"

/* As `Prediction.of`: (targets, 2) images and reaches of one view. */
WIDE static void predict(const World *world, int view, const double *places_mm, const double *sigma_mm,
                         const double typical_px[2], double *image_px, double *reach_px) {
    for (int64_t first = 0; first < world->targets; first += FOUR) {
        const double *place[FOUR];
        for (int lane = 0; lane < FOUR; lane++) place[lane] = places_mm + 3 * at_most(first + lane, world->targets - 1);
        Four point[3];
        for (int k = 0; k < 3; k++) point[k] = (Four){place[0][k], place[1][k], place[2][k], place[3][k]};
        Image4 seen;
        linearise(&world->rig, view, point, &seen);
        for (int c = 0; c < 2; c++) {
            Four slopes = seen.slope[c][0] * seen.slope[c][0] + seen.slope[c][1] * seen.slope[c][1] + seen.slope[c][2] * seen.slope[c][2];
            for (int lane = 0; lane < FOUR && first + lane < world->targets; lane++) {
                int64_t target = first + lane;
                double at = seen.pixel[c][lane], moved = sqrt(slopes[lane]) * sigma_mm[target];
                image_px[2 * target + c] = isfinite(at) ? at : INFINITY;
                reach_px[2 * target + c] = isfinite(at) ? world->gate * sqrt(moved * moved + typical_px[c] * typical_px[c]) : 1.0;
            }
        }
    }
}

static void typical_of(const World *world, const ViewBlobs *blobs, double typical_px[2]) {
    double variance[2] = {0};
    for (int64_t i = 0; i < blobs->count; i++)
        for (int c = 0; c < 2; c++) variance[c] += blobs->sigma_px[2 * i + c] * blobs->sigma_px[2 * i + c];
    for (int c = 0; c < 2; c++)
        typical_px[c] = sqrt(variance[c] / (double)(blobs->count ? blobs->count : 1) + world->unmodelled_px * world->unmodelled_px);
}

Found found_in(int64_t *index, double *number, double *predicted_px, int64_t room) {
    return (Found){.target = index, .blob = {index + room, index + 2 * room}, .xyz_mm = number,
                   .covariance = number + 3 * room, .calibration = number + 12 * room, .image_px = number + 21 * room,
                   .residual_px = number + 25 * room, .displacement_mm = number + 26 * room,
                   .variance_mm2 = number + 29 * room, .miss = index + 3 * room, .predicted_px = predicted_px};
}

void take_over(Found *found, int64_t from, int64_t to) {
    if (from == to) return;
    found->target[to] = found->target[from];
    for (int v = 0; v < VIEWS; v++) found->blob[v][to] = found->blob[v][from];
    memcpy(found->xyz_mm + 3 * to, found->xyz_mm + 3 * from, 3 * sizeof(double));
    memcpy(found->covariance + 9 * to, found->covariance + 9 * from, 9 * sizeof(double));
    memcpy(found->calibration + 9 * to, found->calibration + 9 * from, 9 * sizeof(double));
    memcpy(found->image_px + 4 * to, found->image_px + 4 * from, 4 * sizeof(double));
    found->residual_px[to] = found->residual_px[from];
}

/* Keeps the pairs whose rays meet. */
static int64_t meeting(const World *world, const ViewBlobs blobs[VIEWS], int64_t count, Found *found) {
    int64_t kept = 0;
    for (int64_t i = 0; i < count; i++) {
        const double *left = blobs[0].sigma_px + 2 * found->blob[0][i], *right = blobs[1].sigma_px + 2 * found->blob[1][i];
        double located = left[0] * left[0] + left[1] * left[1] + (right[0] * right[0] + right[1] * right[1]);
        double blurring = 1.0 + 4.0 * (world->unmodelled_px * world->unmodelled_px) / located;
        double across = sqrt(left[1] * left[1] + right[1] * right[1]) * sqrt(blurring / 8.0);
        if (!(found->residual_px[i] <= world->gate * across)) {
            found->miss[found->target[i]] = RAYS_APART;
            continue;
        }
        take_over(found, i, kept);
        for (int k = 0; k < 3; k++) {
            found->displacement_mm[3 * kept + k] = found->xyz_mm[3 * kept + k] - world->nominal_mm[3 * found->target[kept] + k];
            found->variance_mm2[3 * kept + k] = found->covariance[9 * kept + 4 * k] * blurring;
        }
        kept++;
    }
    return kept;
}

/* Mean square distance from the predicted places, in variances of each coordinate; as tracker._surprise. */
double surprise_of(const double *places_mm, const double *sigma_mm, int64_t count, const Found *found) {
    double sum = 0;
    for (int64_t i = 0; i < count; i++)
        for (int k = 0; k < 3; k++) {
            int64_t target = found->target[i];
            double off = found->xyz_mm[3 * i + k] - places_mm[3 * target + k];
            sum += off * off / (found->covariance[9 * i + 4 * k] + sigma_mm[target] * sigma_mm[target]);
        }
    return count ? sqrt(sum / (double)(3 * count)) : 0.0;
}

/* Why a target is not found, or not reported (as Prediction.misses); 0 where nothing speaks against it. */
static int64_t miss_of(int64_t left, int64_t right, int64_t unseen_left, int64_t unseen_right) {
    int64_t unseen = at_least(unseen_left, unseen_right);
    if (unseen > CROWDED) return unseen;
    if (left == BLOB_TAKEN || right == BLOB_TAKEN) return TAKEN;
    return left < 0 || right < 0 ? (left < 0) * NO_BLOB + (right < 0) * 2 * NO_BLOB : unseen;
}

static bool make_facing(int64_t targets, Facing *facing) {
    facing->toward = malloc((size_t)targets * 7 * sizeof *facing->toward);
    if (!facing->toward) return false;
    facing->length2 = facing->toward + 2 * targets, facing->away_mm = facing->length2 + 2 * targets;
    facing->unseen = (int64_t *)(facing->away_mm + targets);
    return true;
}

/* The blob of each target in each view, where it can be seen. */
static int assign(const World *world, const double *places_mm, const double *sigma_mm, const ViewBlobs blobs[VIEWS], double *reach_px,
                  Found *found, Facing *facing, int64_t *blob[VIEWS]) {
    int64_t targets = world->targets;
    int status = DONE;
    double typical_px[2];
    for (int v = 0; v < VIEWS; v++) {
        typical_of(world, blobs + v, typical_px);
        predict(world, v, places_mm, sigma_mm, typical_px, found->predicted_px + 2 * targets * v, reach_px + 2 * targets * v);
    }
    find_unseen(world, places_mm, found->predicted_px, facing);
    for (int v = 0; v < VIEWS && status == DONE; v++)
        status = nearest(targets, found->predicted_px + 2 * targets * v, reach_px + 2 * targets * v, facing->unseen + targets * v, blobs + v, blob[v]);
    return status;
}

int near(const World *world, const double *places_mm, const double *sigma_mm, const ViewBlobs blobs[VIEWS], double reach_px,
         Found *found, int64_t *count, double *surprise) {
    int64_t targets = world->targets, pairs = 0, *blob[VIEWS];
    double *reach = malloc((size_t)targets * 2 * VIEWS * sizeof *reach);
    Facing facing = {0};
    for (int v = 0; v < VIEWS; v++) blob[v] = malloc((size_t)targets * sizeof *blob[v]);
    int status = reach && make_facing(targets, &facing) && blob[0] && blob[1] ? DONE : NO_MEMORY;
    if (status == DONE) status = assign(world, places_mm, sigma_mm, blobs, reach, found, &facing, blob);
    for (int64_t i = 0; i < targets && status == DONE; i++) {
        found->miss[i] = miss_of(blob[0][i], blob[1][i], facing.unseen[i], facing.unseen[targets + i]);
        if (found->miss[i] && found->miss[i] != CROWDED) continue;
        found->target[pairs] = i;
        for (int v = 0; v < VIEWS; v++) found->blob[v][pairs] = blob[v][i];
        pairs++;
    }
    if (status == DONE) status = intersect(world, pairs, places_mm, blobs, reach_px, found);
    if (status == DONE) {
        *count = meeting(world, blobs, pairs, found);
        *surprise = surprise_of(places_mm, sigma_mm, *count, found);
    }
    free(reach);
    free(facing.toward);
    for (int v = 0; v < VIEWS; v++) free(blob[v]);
    return status;
}

/* Places of the neighbours' pairs that are too near to each other, or too far. */
void mark_torn(const World *world, const double *moved_mm, const bool *seen, bool *torn) {
    for (int64_t pair = 0; pair < world->pairs; pair++) {
        int64_t one = world->neighbours[2 * pair], other = world->neighbours[2 * pair + 1];
        if (one < 0 || other < 0 || one >= world->targets || other >= world->targets || !seen[one] || !seen[other]) continue;
        double square = 0;
        for (int k = 0; k < 3; k++) {
            double apart = world->nominal_mm[3 * one + k] + moved_mm[3 * one + k] -
                           (world->nominal_mm[3 * other + k] + moved_mm[3 * other + k]);
            square += apart * apart;
        }
        if (fabs(sqrt(square) - world->apart_mm[pair]) > world->stretch * world->apart_mm[pair]) torn[one] = torn[other] = true;
    }
}

/* Sums of one column of displacements, some weights abreast: in the same order, with fewer passes over the sums. */
INLINE void add_weighted(const double *weights, int64_t targets, int abreast, const double *displacement_mm, double *sums) {
    for (int k = 0; k < 3; k++, sums += targets)
        for (int64_t i = 0; i < targets; i++)
            for (int beside = 0; beside < abreast; beside++) sums[i] += weights[beside * targets + i] * displacement_mm[3 * beside + k];
}

WIDE static void weighted_sum(const double *weights, int64_t targets, int64_t count, const double *displacement_mm, double *sums) {
    enum { ABREAST = 4 };
    memset(sums, 0, (size_t)(3 * targets) * sizeof *sums);
    for (; count >= ABREAST; count -= ABREAST, weights += ABREAST * targets, displacement_mm += 3 * ABREAST)
        add_weighted(weights, targets, ABREAST, displacement_mm, sums);
    for (; count; count--, weights += targets, displacement_mm += 3) add_weighted(weights, targets, 1, displacement_mm, sums);
}

/* What some targets expect of all: (targets, 3). `scratch` has room for 3 · targets numbers. */
void expect_all(int64_t targets, const double *weights, int64_t count, const double *displacement_mm, double *expected_mm,
                double *scratch) {
    weighted_sum(weights, targets, count, displacement_mm, scratch);
    for (int64_t i = 0; i < targets; i++)
        for (int k = 0; k < 3; k++) expected_mm[3 * i + k] = scratch[k * targets + i];
}

/* Which of the chosen the others contradict most, −1 where none is (as agreement.consistent's loop); and what they
   expect of all: (targets, 3), where there are weights, (count, targets); else it is known. `scratch` has room for
   7 · targets numbers. */
int64_t worst_of(const World *world, const double *weights, const double *sigma_mm, int64_t count, const int64_t *target,
                 const double *displacement_mm, const double *variance_mm2, double *expected_mm, double *scratch) {
    int64_t targets = world->targets, worst = -1;
    bool *seen = (bool *)(scratch + 6 * targets), *torn = seen + targets;
    double far = world->gate * world->gate, *moved = scratch + 3 * targets;
    bool is_known = !weights && count; /* nobody has no weights either, and expects nothing */
    if (!is_known) expect_all(targets, weights, count, displacement_mm, expected_mm, scratch);
    memset(seen, 0, 2 * (size_t)targets);
    for (int64_t i = 0; i < count; i++) {
        seen[target[i]] = true;
        memcpy(moved + 3 * target[i], displacement_mm + 3 * i, 3 * sizeof *moved);
    }
    mark_torn(world, moved, seen, torn);
    for (int64_t i = 0; i < count; i++) {
        double own = torn[target[i]] ? 1e6 : 0.0, sigma = sigma_mm[target[i]];
        for (int k = 0; k < 3; k++) {
            double off = displacement_mm[3 * i + k] - expected_mm[3 * target[i] + k];
            own += off * off / (variance_mm2[3 * i + k] + sigma * sigma);
        }
        if (own > far) far = own, worst = i;
    }
    return worst;
}

/* Places and σ of all targets after a field (as Tracker._begun). */
void settle(const World *world, const double *expected_mm, const double *sigma_mm, int64_t count, const int64_t *target,
            const double *displacement_mm, const double *covariance, double *places_mm, double *settled_sigma_mm) {
    double square = world->noise_mm * world->noise_mm;
    for (int64_t i = 0; i < 3 * world->targets; i++) places_mm[i] = world->nominal_mm[i] + expected_mm[i];
    memcpy(settled_sigma_mm, sigma_mm, (size_t)world->targets * sizeof *sigma_mm);
    for (int64_t i = 0; i < count; i++) {
        int64_t own = target[i];
        double share = square / (sigma_mm[own] * sigma_mm[own] + square), depth = 0;
        for (int k = 0; k < 3; k++) {
            double measured = displacement_mm[3 * i + k];
            places_mm[3 * own + k] = world->nominal_mm[3 * own + k] + (measured - share * (measured - expected_mm[3 * own + k]));
            depth = larger(depth, covariance[9 * i + 4 * k]);
        }
        settled_sigma_mm[own] = smaller(settled_sigma_mm[own], sqrt(depth));
    }
}
