/* Shift of each field line, common to all blobs of both views (as line_shifts.py). */
#include "equations.h"

enum { TRIED = 7, REFINED = 5, ASKED_BESIDE = 8 };
static const double ANY_LEAN = 0.5, LEAN_SIGMA = 0.03, APART = 2.0, UNSURE = 2.0, OUTLYING = 4.0;
static const double TINY = 2.2250738585072014e-308;

static void solve_shifts(System *system, double jitter_px, bool leaning) {
    factor(&system->band, 1.0 / (jitter_px * jitter_px), &system->lower);
    solve_down(&system->lower, system->right, system->shift);
    if (leaning) {
        eliminate_shifts(&system->leans, &system->lower, system->shift);
        solve_leans(&system->leans, system->band.count, system->shift);
    }
    solve_up(&system->lower, system->shift);
}

/* Of the chords of a blob, in units of their σ, and its lean. */
INLINE void blob_residuals(System *system, int64_t i, int64_t height) {
    int64_t from = i * height;
    double *own = system->residual + from, x;
    for (int64_t k = 0; k < height; k++) own[k] = system->centre[from + k] - system->shift[system->at[from + k]];
    straight_line(system, from, height, own, &x, system->lean + i);
    for (int64_t k = 0; k < height; k++)
        own[k] = (own[k] - x - system->lean[i] * system->beside[from + k]) * sqrt(system->weight[from + k]);
}

WIDE static void residuals(System *system) {
#define LEFT(height) \
    for (int64_t i = 0; i < system->chords->count; i++) blob_residuals(system, i, height)
    BY_HEIGHT(system->chords->height, LEFT)
#undef LEFT
}

/* Weights outlying chords down, and draws the blobs upright by the leans of discs at their places. */
static void straighten(System *system, const double size[2], double jitter_px) {
    int64_t count = system->chords->count, height = system->chords->height;
    double squares = 0;
    solve_shifts(system, jitter_px, false);
    residuals(system);
    terms_by_place(system->column, system->chords->middle, count, size, system->terms);
    smooth_leans(system->terms, system->lean, count, system->smooth);
    for (int64_t i = 0; i < count; i++) {
        double left = system->lean[i] - system->smooth[i];
        squares += left * left;
        for (int64_t k = i * height; k < (i + 1) * height; k++) {
            double trust = OUTLYING / larger(fabs(system->residual[k]), OUTLYING);
            system->weight[k] *= trust * trust;
            system->centre[k] -= system->smooth[i] * system->beside[k];
        }
    }
    set_up(system, larger(sqrt(squares / (double)count), LEAN_SIGMA));
    tie_leans(system);
}

/* Of the data, with x, leans and shifts integrated out, and of this jitter beforehand; leans by place as they are, or unknown. */
static double log_likelihood(System *system, double jitter_px, double expected_px, bool leaning) {
    double fit = 0, logs = 0, unlike = log(jitter_px / expected_px) / UNSURE;
    factor(&system->band, 1.0 / (jitter_px * jitter_px), &system->lower);
    solve_down(&system->lower, system->right, system->shift);
    for (int64_t j = 0; j < system->band.count; j++) {
        fit += system->shift[j] * system->shift[j];
        logs += log(*band_at(&system->lower, j, j));
    }
    if (leaning) eliminate_shifts(&system->leans, &system->lower, system->shift);
    for (int a = 0; a < TERMS && leaning; a++) {
        fit += system->leans.rest[a] * system->leans.rest[a];
        logs += log(system->leans.root[a][a]);
    }
    return 0.5 * fit - (logs + (double)system->band.count * log(jitter_px)) - 0.5 * unlike * unlike;
}

static int64_t likeliest_of(System *system, const double *tried_px, int64_t count, double expected_px, bool leaning, double *value) {
    int64_t best = 0;
    for (int64_t i = 0; i < count; i++) {
        value[i] = log_likelihood(system, tried_px[i], expected_px, leaning);
        if (value[i] > value[best]) best = i;
    }
    return best;
}

/* Most likely jitter: among a few values, then a few around the best, and between these by a parabola. */
static double likeliest_px(System *system, double expected_px) {
    double tried_px[TRIED], value[TRIED];
    for (int i = 0; i < TRIED; i++) tried_px[i] = expected_px * exp2(i - 4.0);
    double roughly_px = tried_px[likeliest_of(system, tried_px, TRIED, expected_px, false, value)];
    for (int i = 0; i < REFINED; i++) tried_px[i] = roughly_px * exp2((i - 2.0) / 4.0);
    int64_t greatest = likeliest_of(system, tried_px, REFINED, expected_px, true, value);
    int64_t best = within(greatest, 1, REFINED - 2);
    double bend = value[best - 1] - 2.0 * value[best] + value[best + 1];
    if (!(bend < 0)) return tried_px[greatest];
    double steps = smaller(larger(0.5 * (value[best - 1] - value[best + 1]) / bend, -1.0), 1.0);
    return tried_px[best] * pow(tried_px[1] / tried_px[0], steps);
}

static double reach_px(const double *common, const double *beside, int64_t step, int64_t count, double *scratch) {
    for (int64_t i = 0; i < count; i++) scratch[i] = beside[i] / larger(common[i * step], TINY);
    double middle = smaller(larger(median_of(scratch, count), 0.05), 0.99);
    return APART / sqrt(-2.0 * log(middle));
}

/* What the shifts' errors do to a blob's x, and that's covariance with x so many lines down. */
INLINE double covariance_of(const System *system, int64_t from, int64_t height, int64_t down) {
    const double *share = system->chords->share + from;
    const int64_t *at = system->at + from;
    double sum = 0;
    for (int64_t i = 0; i < height; i++)
        for (int64_t k = 0; k < height && share[i] != 0; k++)
            sum += share[i] * share[k] * band_value(&system->inverse, at[i], at_most(at[k] + down, system->band.count - 1));
    return sum;
}

static double covariance(const System *system, int64_t from, int64_t down) {
    double found;
#define FIND(height) found = covariance_of(system, from, height, down)
    BY_HEIGHT(system->chords->height, FIND)
#undef FIND
    return found;
}

/* How the leans' errors move a blob's x so many lines down. */
WIDE static void by_leans(const System *system, int64_t from, int64_t down, Terms moved) {
    Terms sum = {0};
    for (int64_t k = 0; k < system->chords->height; k++) {
        const double *line = system->leans.half[at_most(system->at[from + k] + down, system->band.count - 1)];
        for (int a = 0; a < TERMS; a++) sum[a] += system->chords->share[from + k] * line[a];
    }
    memcpy(moved, sum, sizeof sum);
}

static double product(const Terms one, const Terms other) {
    double sum = 0;
    for (int a = 0; a < TERMS; a++) sum += one[a] * other[a];
    return sum;
}

static void correct(System *system, double jitter_px, LineShifts *found) {
    int64_t count = system->chords->count, height = system->chords->height, asked = 0;
    double *beside = system->residual;
    Terms here, below;
    solve_shifts(system, jitter_px, true);
    inverse_of(&system->lower, &system->inverse);
    spread_of(&system->leans, &system->lower);
    for (int64_t i = 0; i < count; i++) {
        int64_t from = i * height;
        found->x_px[i] = 0;
        for (int64_t k = from; k < from + height; k++) found->x_px[i] += system->chords->share[k] * system->shift[system->at[k]];
        by_leans(system, from, 0, here);
        found->common_px[i] = larger(covariance(system, from, 0), 0.0) + product(here, here);
        if (i % ASKED_BESIDE) continue;
        by_leans(system, from, 1, below);
        beside[asked++] = covariance(system, from, 1) + product(here, below);
    }
    found->reach_px = reach_px(found->common_px, beside, ASKED_BESIDE, asked, system->scratch);
    for (int64_t i = 0; i < count; i++) found->common_px[i] = sqrt(found->common_px[i]);
}

/* One blob at least, one chord that weighs at least. */
int line_shifts(const Chords *chords, const GreySettings *settings, int64_t lines, int64_t columns, LineShifts *found) {
    const double size[2] = {(double)lines, (double)columns};
    System system;
    void *memory;
    if (!make_system(chords, lines, &system, &memory)) return NO_MEMORY;
    begin(lines, &system);
    set_up(&system, ANY_LEAN);
    straighten(&system, size, settings->line_jitter_px);
    double jitter_px = settings->jitter_known ? settings->line_jitter_px : likeliest_px(&system, settings->line_jitter_px);
    correct(&system, jitter_px, found);
    found->jitter_px = settings->jitter_known ? NAN : jitter_px;
    free(memory);
    return DONE;
}

/* While nobody solves for the shifts; `found->x_px` is used on the way. */
void shifts_unsolved(const Chords *chords, double jitter_px, LineShifts *found) {
    double *beside = chords->centre, *scratch = chords->weight, square = jitter_px * jitter_px;
    for (int64_t i = 0; i < chords->count; i++) {
        const double *share = chords->share + i * chords->height;
        double own = 0, other = 0;
        for (int64_t k = 0; k < chords->height; k++) own += share[k] * share[k];
        for (int64_t k = 0; k + 1 < chords->height; k++) other += share[k + 1] * share[k];
        found->x_px[i] = 0, found->common_px[i] = square * own;
        beside[i] = square * other;
    }
    found->reach_px = reach_px(found->common_px, beside, 1, chords->count, scratch);
    found->jitter_px = NAN;
    for (int64_t i = 0; i < chords->count; i++) found->common_px[i] = sqrt(found->common_px[i]);
}
