/* From a packed field to its points, in one call (as measure.measure_fields and Tracker.step). */
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

/* The blobs that lie in the columns of a view as a whole (as locating.whole_blobs), less its local field. */
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

static Step step_of(const Engine *engine, double passed_s, const Track *before, const Way *way) {
    return (Step){.world = engine->world, .following = engine->following, .before = before, .reach_px = way->head->common_reach_px,
                  .passed_s = passed_s, .found = way->found, .believed = way->believed, .expected_mm = way->expected_mm,
                  .after = way->after};
}

/* What Python is told of the step. */
static void tell(const Step *step, Way *way) {
    const Sighting *sighting = &step->sighting;
    double believed = 0;
    for (int64_t i = 0; i < sighting->count; i++) believed += (double)way->believed[i];
    way->head->found = (double)sighting->count, way->head->believed = believed, way->head->surprise = sighting->surprise;
    if (sighting->count) memcpy(way->expected_sigma_mm, sighting->say.sigma_mm, (size_t)step->world->targets * sizeof(double));
}

int measure_field(const Engine *engine, const Taken *taken, const Track *before, Way *way, double *scratch) {
    int status = engine->grey ? locate_grey(engine, &taken->picture, way) : locate_binary(engine, &taken->picture, way);
    Step step = step_of(engine, taken->passed_s, before, way);
    if (status == DONE && !choose(engine, way, step.blobs)) status = UNSOUND;
    if (status == DONE) status = track_on(&step, scratch);
    if (status == DONE) tell(&step, way);
    way->head->status = status;
    return status;
}
