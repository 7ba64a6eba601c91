/* Mean of all positions that explain a blob's bits (as locale.py). */
#include "likelihood.h"

enum { NOISE_BLOBS = 24 };
static const double UNEXPLAINED = 20.0, MOST_JITTER = 0.7, JITTER_OF_CENTRE = 0.54;

static bool fits(const Table *table, const int64_t *entry, int64_t entries, int height) {
    for (int64_t k = 0; k < entries; k++)
        if (entry[k] < 0 || entry[k] + 2 * REACH_X * table->rows + height > table->length) return false;
    return true;
}

/* Everything that is carried from blob to blob. */
typedef struct {
    const Picture *picture;
    const Seen *seen;
    const Size *sizes;
    const Kinds *kinds;
    double fraction;
    int64_t *entry;
    int height;
} Work;

static int64_t looked_up(const Work *work, int64_t blob, const Kind *kind, Pattern *pattern) {
    const Component *own = work->seen->components + blob;
    pattern_of(work->picture, own, work->sizes + blob, kind, pattern);
    int64_t entries = entries_of(work->picture, work->seen->runs, own, work->sizes + blob, pattern, kind->table, work->entry);
    return fits(kind->table, work->entry, entries, work->height) ? entries : -1;
}

/* Some blobs of the most frequent kind, weighed by each of the noises. */
static int64_t ask_some(const Work *work, Weighed some[NOISES][NOISE_BLOBS]) {
    const Kind *kind = work->kinds->kinds + work->kinds->first;
    int64_t asked = at_most(kind->blobs, NOISE_BLOBS);
    for (int64_t k = 0; k < asked; k++) {
        Pattern pattern;
        int64_t entries = looked_up(work, work->kinds->order[kind->begin + k], kind, &pattern);
        if (entries < 0) return -1;
        for (int noise = 0; noise < NOISES; noise++)
            some[noise][k] = weigh(kind->table->values[noise], kind->table->rows, work->entry, entries, work->height);
    }
    return asked;
}

/* The one of the noises that explains these blobs best, and what they then say. */
static int likeliest_noise(const Work *work, int *likeliest, Posterior found[NOISE_BLOBS]) {
    Weighed some[NOISES][NOISE_BLOBS];
    double evidence[NOISE_BLOBS], best = -INFINITY;
    int64_t asked = ask_some(work, some);
    if (asked <= 0) return REFUSED;
    *likeliest = 0;
    for (int noise = 0; noise < NOISES; noise++) {
        for (int64_t k = 0; k < asked; k++) evidence[k] = evidence_of(&some[noise][k]);
        double least = median_of(evidence, asked) - UNEXPLAINED, sum = 0;
        for (int64_t k = 0; k < asked; k++) sum += larger(evidence[k], least);
        if (noise && !(sum > best)) continue;
        best = sum, *likeliest = noise;
    }
    for (int64_t k = 0; k < asked; k++) found[k] = posterior_of(&some[*likeliest][k], work->height);
    return DONE;
}

static void place(const Work *work, const Settings *settings, int64_t blob, const Posterior *found, Place *at) {
    const Component *own = work->seen->components + blob;
    const Picture *picture = work->picture;
    double y_step = (double)picture->y_step;
    Pattern pattern;
    pattern_of(picture, own, work->sizes + blob, work->kinds->kinds + work->kinds->of[blob], &pattern);
    at->x = pattern.middle_x / 10.0 + found->x / pattern.wider;
    at->row = pattern.middle_y / (8.0 * y_step) + (double)first_row(picture) + found->y / pattern.higher / y_step;
    double xx = found->variance_x / (pattern.wider * pattern.wider);
    double lines = sqrt(4 / PI) / 2 * sqrt(own->area_px) / 2;
    double jitter = JITTER_OF_CENTRE * (settings->line_jitter_px * settings->line_jitter_px) / lines;
    xx -= smaller((is_doubled(picture) ? 0.25 : 0.5) * jitter, MOST_JITTER * xx);
    at->sigma_x = sqrt(xx);
    at->sigma_y = sqrt(found->variance_y / (pattern.higher * pattern.higher));
}

/* A field has one noise, told by its most frequent kind: of the other kinds only that one's tables are needed. */
static int find_tables(const Work *work, const Settings *settings, int noise, Outcome *outcome) {
    int status = DONE;
    for (int64_t k = 0; k < work->kinds->count && status == DONE; k++)
        status = find_table(settings, work->fraction, noise, work->kinds->kinds + k, outcome);
    return status;
}

static int posteriors_of(const Work *work, const Settings *settings, Posterior *found, double *evidence, Outcome *outcome) {
    Posterior some[NOISE_BLOBS];
    Kind *asked = work->kinds->kinds + work->kinds->first;
    int noise, status = find_table(settings, work->fraction, ANY_NOISE, asked, outcome);
    if (status == DONE) status = likeliest_noise(work, &noise, some);
    if (status == DONE) status = find_tables(work, settings, noise, outcome);
    for (int64_t k = 0; k < work->kinds->blobs && status == DONE; k++) {
        int64_t blob = work->kinds->order[k], before = k - asked->begin;
        const Kind *kind = work->kinds->kinds + work->kinds->of[blob];
        if (kind == asked && before < NOISE_BLOBS) {
            found[blob] = some[before];
            evidence[k] = some[before].evidence;
            continue;
        }
        Pattern pattern;
        int64_t entries = looked_up(work, blob, kind, &pattern);
        if (entries < 0) return REFUSED;
        Weighed weighed = weigh(kind->table->values[noise], kind->table->rows, work->entry, entries, work->height);
        found[blob] = posterior_of(&weighed, work->height);
        evidence[k] = found[blob].evidence;
    }
    return status;
}

static int decode(const Work *work, const Settings *settings, bool *discs, Place *places, Outcome *outcome) {
    size_t count = (size_t)work->seen->component_count;
    Posterior *found = malloc(count * sizeof *found);
    double *evidence = malloc(count * sizeof *evidence);
    int status = found && evidence ? posteriors_of(work, settings, found, evidence, outcome) : NO_MEMORY;
    if (status == DONE) {
        double least = median_of(evidence, work->kinds->blobs) - UNEXPLAINED;
        for (size_t blob = 0; blob < count; blob++) {
            discs[blob] = work->kinds->of[blob] >= 0 && found[blob].evidence > least;
            if (discs[blob]) place(work, settings, (int64_t)blob, found + blob, places + blob);
        }
    }
    free(found);
    free(evidence);
    return status;
}

int locate_by_locale(const Picture *picture, const Settings *settings, const Seen *seen, const Size *sizes, bool *discs,
                     Place *places, Outcome *outcome) {
    Kinds kinds = {0};
    double fraction;
    int64_t *entry = malloc((size_t)(2 * picture->rows + 2) * sizeof *entry);
    int status = entry ? DONE : NO_MEMORY;
    if (status == DONE) status = threshold_fraction(picture, settings, seen, sizes, &fraction, outcome);
    if (status == DONE) status = kinds_of(seen, sizes, &kinds);
    if (status == DONE && kinds.blobs) {
        Work work = {picture, seen, sizes, &kinds, fraction, entry, 2 * REACH_Y(picture->y_step) + 1};
        status = decode(&work, settings, discs, places, outcome);
    }
    free_kinds(&kinds);
    free(entry);
    return status;
}
