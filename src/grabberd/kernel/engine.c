/* From a packed field to its points, in one call (as processes.measure and Tracker.step): what happens in almost every
   field. What is rare is left to Python, with all that is known by then: identification, and targets that move otherwise
   than the track says. */
#include "engine.h"

#include "module.h"

static int locate_binary(const Engine *engine, const GreyPicture *taken, Way *way) {
    Outcome outcome;
    Picture picture = {taken->data, taken->length, taken->rows, taken->stride, taken->columns, taken->parity, taken->y0, taken->y_step};
    int status = grabberd_locate(&picture, engine->binary, way->blobs, engine->room, &outcome);
    way->head->blobs = (double)outcome.count, way->head->common_reach_px = outcome.common_reach_px;
    way->head->jitter_px = NAN;
    memcpy(way->head->missing, outcome.missing, sizeof outcome.missing);
    return status;
}

static int locate_grey(const Engine *engine, const GreyPicture *picture, Way *way) {
    GreyOutcome outcome;
    int status = grabberd_locate_grey(picture, engine->grey, way->blobs, engine->room, &outcome);
    way->head->blobs = (double)outcome.count, way->head->common_reach_px = outcome.common_reach_px;
    way->head->jitter_px = outcome.jitter_px;
    return status;
}

/* The blobs that lie in the columns of a view as a whole (as measure.whole_blobs), less its local field. */
static int64_t whole_ones(const Engine *engine, int view, const Way *way) {
    const LocalField *local = engine->world->rig.local + view;
    const double *xy = way->blobs, *sigma = xy + 2 * engine->room, *rest = sigma + 2 * engine->room;
    double *out = way->half[view], *out_sigma = out + 2 * engine->room, *common = out_sigma + 2 * engine->room;
    double first = engine->following->columns[view][0] - 0.5, end = engine->following->columns[view][1] - 0.5;
    int64_t kept = 0, count = (int64_t)way->head->blobs;
    for (int64_t i = 0; i < count; i++) {
        double x = xy[2 * i], width = rest[2 * engine->room + i] / 2;
        if (rest[4 * engine->room + i] != 0 || !(x - width >= first) || !(x + width <= end)) continue;
        for (int c = 0; c < 2; c++) {
            out[2 * kept + c] = xy[2 * i + c];
            if (local->rows) out[2 * kept + c] -= local_value(local, local->shift_px, xy + 2 * i, c);
            out_sigma[2 * kept + c] = sigma[2 * i + c];
        }
        common[kept++] = rest[i];
    }
    return kept;
}

/* As ViewBlobs.__post_init__, which says what is wrong. */
static bool are_sound(const ViewBlobs *blobs) {
    for (int64_t i = 0; i < 2 * blobs->count; i++)
        if (!isfinite(blobs->xy_px[i]) || !(blobs->sigma_px[i] > 0)) return false;
    return true;
}

static bool choose(const Engine *engine, const Way *way, ViewBlobs blobs[VIEWS]) {
    bool sound = true;
    for (int v = 0; v < VIEWS; v++) {
        double *half = way->half[v];
        int64_t count = whole_ones(engine, v, way);
        way->head->half[v] = (double)count;
        blobs[v] = (ViewBlobs){half, half + 2 * engine->room, half + 4 * engine->room, count};
        sound &= are_sound(blobs + v);
    }
    return sound;
}

static const Say *say_of(const Following *following, const int64_t *target, int64_t count) {
    for (int64_t i = following->say_count - 1; i >= 0; i--) {
        const Say *say = following->says + i;
        if (say->count == count && !memcmp(say->seen, target, (size_t)count * sizeof *target)) return say;
    }
    return NULL;
}

static void drop(Found *found, int64_t worst, int64_t count) {
    for (int64_t i = worst; i + 1 < count; i++) {
        take_over(found, i + 1, i);
        memcpy(found->displacement_mm + 3 * i, found->displacement_mm + 3 * (i + 1), 3 * sizeof(double));
        memcpy(found->variance_mm2 + 3 * i, found->variance_mm2 + 3 * (i + 1), 3 * sizeof(double));
    }
}

/* A search, and what was found. */
typedef struct {
    int64_t count;
    double surprise;
    const Say *say;
} Sighting;

/* Searches near these places, and drops those that the others contradict, the worst first (as compiled_search.Nearby.near);
   `room` is for seven numbers a target. */
static int sight(const Engine *engine, const double *places_mm, const double *sigma_mm, const ViewBlobs blobs[VIEWS], Way *way,
                 double *room, Sighting *sighting) {
    const World *world = engine->world;
    Found *found = &way->found;
    int status = near(world, places_mm, sigma_mm, blobs, way->head->common_reach_px, found, &sighting->count, &sighting->surprise);
    for (bool all_stay = true; status == DONE; all_stay = false) {
        if (!sighting->count) return UNFOLLOWED;
        way->head->found = (double)sighting->count;
        sighting->say = say_of(engine->following, found->target, sighting->count);
        if (!sighting->say) return NO_SAY;
        int64_t worst = worst_of(world, sighting->say->weights, sighting->say->sigma_mm, sighting->count, found->target,
                                 found->displacement_mm, found->variance_mm2, way->expected_mm, room);
        if (worst < 0) {
            if (!all_stay) sighting->surprise = surprise_of(places_mm, sigma_mm, sighting->count, found);
            break;
        }
        found->miss[found->target[worst]] = OFF_PLACE;
        drop(found, worst, sighting->count--);
    }
    return status;
}

/* As Tracker._follow; UNFOLLOWED where only identification can tell. */
static int follow(const Engine *engine, const Track *track, double elapsed_s, const ViewBlobs blobs[VIEWS], Way *way,
                  double *scratch, Sighting *sighting) {
    const World *world = engine->world;
    const Following *following = engine->following;
    int64_t targets = world->targets;
    double *places = scratch, *sigma = scratch + 3 * targets, *room = scratch + 4 * targets;
    double moved = track->rest[0] * elapsed_s;
    for (int64_t i = 0; i < 3 * targets; i++) places[i] = track->xyz_mm[i] + track->velocity_mm_s[i] * elapsed_s;
    for (int64_t i = 0; i < targets; i++) sigma[i] = hypot(track->sigma_mm[i], moved);
    int status = sight(engine, places, sigma, blobs, way, room, sighting);
    if (status != DONE) return status;
    double astray_mm = sighting->surprise * moved;
    if (astray_mm > following->astray_mm) return UNFOLLOWED;
    if (!(moved > following->vague_mm || astray_mm > following->otherwise_mm)) return DONE;
    for (int64_t i = 0; i < 3 * targets; i++) places[i] = world->nominal_mm[i] + way->expected_mm[i];
    return sight(engine, places, sighting->say->sigma_mm, blobs, way, room, sighting);
}

static bool are_enough(const Engine *engine, const Track *track, const Sighting *sighting, const ViewBlobs blobs[VIEWS]) {
    int64_t most = at_most(at_most(blobs[0].count, blobs[1].count), engine->world->targets);
    double share = engine->following->least_share, fewest = larger(share * (double)most, 1.0);
    return (double)sighting->count >= larger(fewest, share * track->rest[2]);
}

/* As Tracker._believed. */
static void believe(const Engine *engine, const Track *track, const Sighting *sighting, Way *way) {
    int64_t believed = 0;
    for (int64_t i = 0; i < sighting->count; i++) {
        int64_t target = way->found.target[i];
        way->believed[i] = track->unseen_s[target] <= engine->following->longest_gap_s ||
                           sighting->say->sigma_mm[target] <= engine->following->firm_mm;
        believed += way->believed[i];
    }
    way->head->believed = (double)believed;
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

/* As Tracker._continued. */
static void move_on(const Engine *engine, const Track *track, const Sighting *sighting, const Taken *taken, double elapsed_s,
                    const Way *way) {
    const World *world = engine->world;
    const Found *found = &way->found;
    const Track *after = &way->after;
    int64_t targets = world->targets;
    settle(world, way->expected_mm, sighting->say->sigma_mm, sighting->count, found->target, found->displacement_mm,
           found->covariance, after->xyz_mm, after->sigma_mm);
    for (int64_t i = 0; i < 3 * targets; i++) after->velocity_mm_s[i] = (after->xyz_mm[i] - track->xyz_mm[i]) / elapsed_s;
    for (int64_t i = 0; i < targets; i++) after->unseen_s[i] = track->unseen_s[i] + taken->passed_s;
    for (int64_t i = 0; i < sighting->count; i++) after->unseen_s[found->target[i]] = 0;
    even_out(track, after, targets);
    after->rest[0] = engine->following->acceleration_mm_s2 * elapsed_s, after->rest[1] = 0, after->rest[2] = (double)sighting->count;
}

static int track_on(const Engine *engine, const Taken *taken, const Track *track, Way *way, double *scratch) {
    ViewBlobs blobs[VIEWS];
    Sighting sighting = {0};
    double elapsed_s = track->rest[1] + taken->passed_s;
    if (!choose(engine, way, blobs)) return UNFOLLOWED;
    if (!(elapsed_s <= engine->following->longest_gap_s)) return UNFOLLOWED;
    int status = follow(engine, track, elapsed_s, blobs, way, scratch, &sighting);
    if (status != DONE) return status;
    if (!are_enough(engine, track, &sighting, blobs)) return UNFOLLOWED;
    believe(engine, track, &sighting, way);
    move_on(engine, track, &sighting, taken, elapsed_s, way);
    way->head->say = (double)(sighting.say - engine->following->says), way->head->surprise = sighting.surprise;
    return DONE;
}

int measure_field(const Engine *engine, const Taken *taken, const Track *before, Way *way, double *scratch) {
    int status = DONE;
    if (!taken->is_located)
        status = engine->grey ? locate_grey(engine, &taken->picture, way) : locate_binary(engine, &taken->picture, way);
    if (status == DONE) status = track_on(engine, taken, before, way, scratch);
    way->head->status = status;
    return status;
}
