/* Identification, from the blobs of a field alone to a sighting (as Correspondence.identify). */
#include "tracking.h"

static const int64_t MOST_AT_FIRST = 2048;

static bool make_room(Hypotheses *known, int64_t room) {
    int64_t *index = realloc(known->target, 3 * (size_t)room * sizeof *index);
    if (index) known->target = index;
    double *number = realloc(known->displacement_mm, 6 * (size_t)room * sizeof *number);
    if (number) known->displacement_mm = number;
    if (!index || !number) return false;
    known->blob[0] = index + room, known->blob[1] = index + 2 * room;
    known->variance_mm2 = number + 3 * room, known->room = room;
    return true;
}

static int list_all(const Identifying *how, const ViewBlobs blobs[VIEWS], double reach_px, Hypotheses *known) {
    int status = MORE_ROOM;
    for (int64_t room = MOST_AT_FIRST; status == MORE_ROOM; room = known->count) {
        if (!make_room(known, room)) return NO_MEMORY;
        status = list_hypotheses(how->world, blobs, reach_px, how->gate_mm, how->farthest_mm, known);
    }
    return status;
}

/* The blobs, with the unmodelled error in their σ. */
static bool blur(const World *world, const ViewBlobs blobs[VIEWS], ViewBlobs blurred[VIEWS], double **sigma_px) {
    double *sigma = *sigma_px = malloc(2 * (size_t)(blobs[0].count + blobs[1].count) * sizeof *sigma + 1);
    if (!sigma) return false;
    for (int v = 0; v < VIEWS; v++) {
        blurred[v] = blobs[v], blurred[v].sigma_px = sigma;
        for (int64_t i = 0; i < 2 * blobs[v].count; i++) *sigma++ = hypot(blobs[v].sigma_px[i], world->unmodelled_px);
    }
    return true;
}

/* What the largest set of pairs of blobs that agree tells of all targets; how many are in it. */
static int expect(const Identifying *how, const ViewBlobs blobs[VIEWS], double reach_px, double *expected_mm, double *sigma_mm,
                  int64_t *count) {
    ViewBlobs blurred[VIEWS];
    Hypotheses known = {0};
    double *sigma_px = NULL;
    const int64_t blob_counts[VIEWS] = {blobs[0].count, blobs[1].count};
    int64_t *chosen = malloc((size_t)how->world->targets * sizeof *chosen);
    int status = chosen && blur(how->world, blobs, blurred, &sigma_px) ? DONE : NO_MEMORY;
    if (status == DONE) status = list_all(how, blurred, reach_px, &known);
    if (status == DONE) status = largest(how->world, &how->judge, &known, blob_counts, chosen, count, expected_mm, sigma_mm);
    free(chosen);
    free(sigma_px);
    free(known.target);
    free(known.displacement_mm);
    return status;
}

/* Afterwards `expected_mm` is what those found tell as they move, not as they may be taken for each other: what is cautious
   about telling targets apart would be rash about where to look for the others. */
int identify(const Following *following, const World *world, const ViewBlobs blobs[VIEWS], double reach_px, Found *found,
             double *expected_mm, double *scratch, Sighting *sighting) {
    const Identifying *how = &following->identifying;
    int64_t targets = world->targets, count = 0;
    double *places_mm = scratch, *sigma_mm = scratch + 3 * targets, *room = scratch + 4 * targets;
    *sighting = (Sighting){0};
    int status = expect(how, blobs, reach_px, places_mm, sigma_mm, &count);
    if (status != DONE || !count) return status;
    for (int64_t i = 0; i < 3 * targets; i++) places_mm[i] += world->nominal_mm[i];
    status = sight(how->world, how->predictors, places_mm, sigma_mm, blobs, reach_px, found, expected_mm, room, sighting);
    if (status != DONE || !sighting->count) return status;
    status = recall(following->predictors, found->target, sighting->count, &sighting->say);
    if (status == DONE) expect_all(targets, sighting->say.weights, sighting->count, found->displacement_mm, expected_mm, room);
    return status;
}
