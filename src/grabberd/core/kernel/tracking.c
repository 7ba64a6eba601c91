/* A step of the track from field to field (as Tracker.step). */
#include "tracking.h"

static const double CLEARLY = 1.05, OFTEN_S = 0.02, SHORTEST_S = 0.002;

int recall(Predictors *kept, const int64_t *target, int64_t count, Say *say) {
    int64_t targets = kept->smooth.targets, slot = 0;
    while (slot < kept->room &&
           (kept->count[slot] != count || memcmp(kept->seen + slot * targets, target, (size_t)count * sizeof *target)))
        slot++;
    if (slot == kept->room) {
        double *scratch = malloc((size_t)(targets * (targets + 2)) * sizeof *scratch);
        if (!scratch) return NO_MEMORY;
        uint8_t *seen = (uint8_t *)(scratch + targets * (targets + 1));
        memset(seen, 0, (size_t)targets);
        for (int64_t i = 0; i < count; i++) seen[target[i]] = 1;
        slot = kept->next, kept->next = (slot + 1) % kept->room;
        kept->count[slot] = count;
        memcpy(kept->seen + slot * targets, target, (size_t)count * sizeof *target);
        predictor_of(&kept->smooth, seen, count, kept->weights + slot * targets * targets, kept->sigma_mm + slot * targets, scratch);
        free(scratch);
    }
    *say = (Say){kept->weights + slot * targets * targets, kept->sigma_mm + slot * targets};
    return DONE;
}

static void drop(Found *found, int64_t worst, int64_t count) {
    for (int64_t i = worst; i + 1 < count; i++) {
        take_over(found, i + 1, i);
        memcpy(found->displacement_mm + 3 * i, found->displacement_mm + 3 * (i + 1), 3 * sizeof(double));
        memcpy(found->variance_mm2 + 3 * i, found->variance_mm2 + 3 * (i + 1), 3 * sizeof(double));
    }
}

/* Searches near these places, and drops those that the others contradict, the worst first (as compiled_search.Nearby.near);
   `room` is for seven numbers a target. */
int sight(const World *world, Predictors *predictors, const double *places_mm, const double *sigma_mm, const ViewBlobs blobs[VIEWS],
          double reach_px, Found *found, double *expected_mm, double *room, Sighting *sighting) {
    int status = near(world, places_mm, sigma_mm, blobs, reach_px, found, &sighting->count, &sighting->surprise);
    for (bool all_stay = true; status == DONE && sighting->count; all_stay = false) {
        status = recall(predictors, found->target, sighting->count, &sighting->say);
        if (status != DONE) break;
        const Say *say = &sighting->say;
        int64_t worst = worst_of(world, say->weights, say->sigma_mm, sighting->count, found->target, found->displacement_mm,
                                 found->variance_mm2, expected_mm, room);
        if (worst < 0) {
            if (!all_stay) sighting->surprise = surprise_of(places_mm, sigma_mm, sighting->count, found);
            break;
        }
        found->miss[found->target[worst]] = OFF_PLACE;
        drop(found, worst, sighting->count--);
    }
    return status;
}

/* What was identified in a field, apart from what was followed. */
typedef struct {
    bool is_known;
    void *memory;
    Found found;
    double *expected_mm;
    Sighting sighting;
} Anew;

static int identify_anew(Step *step, double *scratch, Anew *anew) {
    int64_t targets = step->world->targets;
    if (anew->is_known) return DONE;
    double *number = anew->memory = malloc((size_t)(targets * (FOUND_NUMBERS + 7 + FOUND_INDICES)) * sizeof *number);
    if (!number) return NO_MEMORY;
    double *predicted_px = number + FOUND_NUMBERS * targets;
    anew->expected_mm = predicted_px + 4 * targets;
    anew->found = found_in((int64_t *)(anew->expected_mm + 3 * targets), number, predicted_px, targets);
    anew->is_known = true;
    return identify(step->following, step->world, step->blobs, step->reach_px, &anew->found, anew->expected_mm, scratch,
                    &anew->sighting);
}

/* Takes over what was identified. */
static void adopt(Step *step, const Anew *anew) {
    size_t targets = (size_t)step->world->targets;
    const Found *own = &step->found, *other = &anew->found;
    step->sighting = anew->sighting;
    if (!anew->sighting.count) return;
    for (int v = -1; v < VIEWS; v++)
        memcpy(v < 0 ? own->target : own->blob[v], v < 0 ? other->target : other->blob[v], targets * sizeof(int64_t));
    memcpy(own->miss, other->miss, targets * sizeof(int64_t));
    memcpy(own->xyz_mm, other->xyz_mm, FOUND_NUMBERS * targets * sizeof(double));
    memcpy(own->predicted_px, other->predicted_px, 4 * targets * sizeof(double));
    memcpy(step->expected_mm, anew->expected_mm, 3 * targets * sizeof(double));
}

/* True if the followed targets agree with the identified ones about blobs and are clearly more (as tracking._better). */
static bool are_better(const Step *step, const Anew *anew) {
    const Found *own = &step->found, *other = &anew->found;
    int64_t common = 0, k = 0;
    for (int64_t i = 0; i < step->sighting.count; i++) {
        while (k < anew->sighting.count && other->target[k] < own->target[i]) k++;
        if (k == anew->sighting.count || other->target[k] != own->target[i]) continue;
        if (own->blob[0][i] != other->blob[0][k] || own->blob[1][i] != other->blob[1][k]) return false;
        common++;
    }
    return common && (double)step->sighting.count > CLEARLY * (double)anew->sighting.count;
}

/* As Tracker._follow. */
static int follow(Step *step, double elapsed_s, double *scratch, Anew *anew) {
    const World *world = step->world;
    const Following *following = step->following;
    const Track *track = step->before;
    Sighting *sighting = &step->sighting;
    int64_t targets = world->targets;
    double *places = scratch, *sigma = scratch + 3 * targets, *room = scratch + 4 * targets;
    double moved = track->rest[0] * elapsed_s;
    for (int64_t i = 0; i < 3 * targets; i++) places[i] = track->xyz_mm[i] + track->velocity_mm_s[i] * elapsed_s;
    for (int64_t i = 0; i < targets; i++) sigma[i] = hypot(track->sigma_mm[i], moved);
    int status = sight(world, following->predictors, places, sigma, step->blobs, step->reach_px, &step->found, step->expected_mm,
                       room, sighting);
    if (status != DONE || !sighting->count) return status;
    double astray_mm = sighting->surprise * moved;
    if (moved > following->vague_mm || astray_mm > following->otherwise_mm) {
        for (int64_t i = 0; i < 3 * targets; i++) places[i] = world->nominal_mm[i] + step->expected_mm[i];
        memcpy(sigma, sighting->say.sigma_mm, (size_t)targets * sizeof *sigma);
        status = sight(world, following->predictors, places, sigma, step->blobs, step->reach_px, &step->found, step->expected_mm,
                       room, sighting);
    }
    if (status != DONE || !(astray_mm > following->astray_mm)) return status;
    status = identify_anew(step, scratch, anew);
    if (status == DONE && !are_better(step, anew)) adopt(step, anew);
    return status;
}

/* As Tracker._believed. */
static void believe(Step *step) {
    for (int64_t i = 0; i < step->sighting.count; i++) {
        int64_t target = step->found.target[i];
        step->believed[i] = !step->found.miss[target] && (step->before->unseen_s[target] <= step->following->longest_gap_s ||
                                                          step->sighting.say.sigma_mm[target] <= step->following->firm_mm);
    }
}

/* From a predicted place to a measured one is no movement, and would lose the target again. */
static void even_out(const Track *track, const Track *after, int64_t targets) {
    double mean[3] = {0};
    int64_t same = 0;
    for (int64_t i = 0; i < targets; i++) {
        if (track->unseen_s[i] != 0 || after->unseen_s[i] != 0) continue;
        for (int k = 0; k < 3; k++) mean[k] += after->velocity_mm_s[3 * i + k];
        same++;
    }
    for (int64_t i = 0; i < targets && same; i++)
        if ((track->unseen_s[i] == 0) != (after->unseen_s[i] == 0))
            for (int k = 0; k < 3; k++) after->velocity_mm_s[3 * i + k] = mean[k] / (double)same;
}

/* As Tracker._after, but for velocities. */
static void move_on(Step *step, double speed_sigma_mm_s) {
    const World *world = step->world;
    const Found *found = &step->found;
    const Track *track = step->before, *after = &step->after;
    settle(world, step->expected_mm, step->sighting.say.sigma_mm, step->sighting.count, found->target, found->displacement_mm,
           found->covariance, after->xyz_mm, after->sigma_mm);
    for (int64_t i = 0; i < world->targets; i++) after->unseen_s[i] = track->unseen_s[i] + step->passed_s;
    for (int64_t i = 0; i < step->sighting.count; i++) after->unseen_s[found->target[i]] = 0;
    after->rest[0] = speed_sigma_mm_s, after->rest[1] = 0, after->rest[2] = (double)step->sighting.count;
}

/* The predictor may have given way to others since it was looked up. */
static int recall_own(Step *step) {
    return recall(step->following->predictors, step->found.target, step->sighting.count, &step->sighting.say);
}

/* As tracking._unsteady_s. */
static double unsteady_s(double elapsed_s) { return larger(elapsed_s, OFTEN_S * OFTEN_S / larger(elapsed_s, SHORTEST_S)); }

/* As Tracker._continued. */
static int go_on(Step *step, double elapsed_s) {
    const Track *track = step->before, *after = &step->after;
    if (recall_own(step) != DONE) return NO_MEMORY;
    believe(step);
    move_on(step, step->following->acceleration_mm_s2 * unsteady_s(elapsed_s));
    for (int64_t i = 0; i < 3 * step->world->targets; i++)
        after->velocity_mm_s[i] = (after->xyz_mm[i] - track->xyz_mm[i]) / elapsed_s;
    even_out(track, after, step->world->targets);
    return DONE;
}

/* As Tracker._begun: at rest until the next field shows more. */
static int begin(Step *step, const Anew *anew) {
    adopt(step, anew);
    if (recall_own(step) != DONE) return NO_MEMORY;
    for (int64_t i = 0; i < step->sighting.count; i++) step->believed[i] = !step->found.miss[step->found.target[i]];
    move_on(step, step->following->speed_mm_s * larger(1.0, OFTEN_S / larger(step->passed_s, SHORTEST_S)));
    for (int64_t i = 0; i < 3 * step->world->targets; i++) step->after.velocity_mm_s[i] = 0;
    return DONE;
}

/* The track as it was, only older. */
static void wait_on(Step *step, double elapsed_s) {
    const Track *track = step->before, *after = &step->after;
    size_t targets = (size_t)step->world->targets;
    memcpy(after->xyz_mm, track->xyz_mm, 3 * targets * sizeof(double));
    memcpy(after->sigma_mm, track->sigma_mm, targets * sizeof(double));
    memcpy(after->velocity_mm_s, track->velocity_mm_s, 3 * targets * sizeof(double));
    for (size_t i = 0; i < targets; i++) after->unseen_s[i] = track->unseen_s[i] + step->passed_s;
    after->rest[0] = track->rest[0], after->rest[1] = elapsed_s, after->rest[2] = track->rest[2];
    step->sighting = (Sighting){0};
}

static int track_or_identify(Step *step, double *scratch, Anew *anew) {
    const Following *following = step->following;
    int64_t most = at_most(at_most(step->blobs[0].count, step->blobs[1].count), step->world->targets);
    double elapsed_s = step->before->rest[1] + step->passed_s, fewest = larger(following->least_share * (double)most, 1.0);
    int status = DONE;
    if (elapsed_s <= following->longest_gap_s) {
        status = follow(step, elapsed_s, scratch, anew);
        bool are_enough = (double)step->sighting.count >= larger(fewest, following->least_share * step->before->rest[2]);
        if (status == DONE && are_enough) return go_on(step, elapsed_s);
    }
    if (status == DONE) status = identify_anew(step, scratch, anew);
    if (status != DONE) return status;
    if ((double)anew->sighting.count >= fewest) return begin(step, anew);
    wait_on(step, elapsed_s);
    return DONE;
}

int track_on(Step *step, double *scratch) {
    Anew anew = {0};
    int status = track_or_identify(step, scratch, &anew);
    free(anew.memory);
    return status;
}
