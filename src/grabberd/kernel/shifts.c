/* Shift of each field line, common to all blobs of both views (as line_shifts.py). */
#include "band.h"
#include "grey.h"
#include "leans.h"

enum { TRIED = 7, REFINED = 5, ASKED_BESIDE = 8 };
static const double ANY_LEAN = 0.5, LEAN_SIGMA = 0.03, APART = 2.0, UNSURE = 2.0, OUTLYING = 4.0;
static const double TINY = 2.2250738585072014e-308;

/* The normal equations in the shifts of those lines that touch a blob; what they are made from and solved in. */
typedef struct {
    const Chords *chords;
    int64_t *at;                          /* (count, height): the equation of each chord */
    double *beside, *tilt_x, *tilt_lean;  /* likewise: Δy, and what gives x and lean from the chords' middles */
    double *weight, *centre, *residual;   /* likewise; weights as they are trusted, middles from the surest one's */
    double *right, *shift, *scratch;      /* (equations,); `scratch` also (count,) */
    double *column, *lean, *smooth;       /* (count,): where blobs are, their leans, and those of discs at such places */
    Terms *terms;                         /* (count,): of these, by their places */
    Leans leans;
    Band band, lower, inverse;
} System;

static double *carve(double **from, int64_t count) {
    double *own = *from;
    *from += count;
    return own;
}

static bool make_system(const Chords *chords, int64_t lines, System *system, void **memory) {
    int64_t cells = chords->count * chords->height, height = chords->height;
    size_t numbers = (size_t)(7 * cells + 2 * lines + lines + 4 * chords->count + (3 * height + 1) * lines + TERMS * (2 * lines + chords->count));
    double *from = *memory = malloc(numbers * sizeof *from);
    if (!from) return false;
    *system = (System){.chords = chords};
    system->at = (int64_t *)carve(&from, cells);
    system->beside = carve(&from, cells), system->tilt_x = carve(&from, cells), system->tilt_lean = carve(&from, cells);
    system->weight = carve(&from, cells), system->centre = carve(&from, cells), system->residual = carve(&from, cells);
    system->right = carve(&from, lines), system->shift = carve(&from, lines);
    system->scratch = carve(&from, lines + chords->count);
    system->column = carve(&from, chords->count), system->lean = carve(&from, chords->count);
    system->smooth = carve(&from, chords->count);
    system->terms = (Terms *)carve(&from, TERMS * chords->count);
    system->leans.shifts = (Terms *)carve(&from, TERMS * lines), system->leans.half = (Terms *)carve(&from, TERMS * lines);
    system->band = (Band){0, height, carve(&from, height * lines)};
    system->lower = (Band){0, height, carve(&from, height * lines)};
    system->inverse = (Band){0, height + 1, carve(&from, (height + 1) * lines)};
    return true;
}

/* Middles of the chords relative to each blob's best one: small numbers round less. */
static void from_the_surest(const Chords *chords, System *system) {
    for (int64_t i = 0; i < chords->count; i++) {
        const double *weight = chords->weight + i * chords->height, *centre = chords->centre + i * chords->height;
        int64_t surest = 0;
        for (int64_t k = 1; k < chords->height; k++)
            if (weight[k] > weight[surest]) surest = k;
        system->column[i] = centre[surest];
        for (int64_t k = 0; k < chords->height; k++) system->centre[i * chords->height + k] = centre[k] - centre[surest];
    }
    memcpy(system->weight, chords->weight, (size_t)(chords->count * chords->height) * sizeof *system->weight);
}

/* Numbers the lines that touch a blob. */
static void number_lines(int64_t lines, System *system) {
    const Chords *chords = system->chords;
    int64_t *number = (int64_t *)system->scratch, equations = 0, height = chords->height;
    memset(number, 0, (size_t)lines * sizeof *number);
    for (int64_t i = 0; i < chords->count; i++)
        for (int64_t k = 0; k < height; k++)
            if (chords->weight[i * height + k] > 0 || chords->share[i * height + k] > 0)
                number[within(chords->line[i] + k, 0, lines - 1)] = 1;
    for (int64_t line = 0; line < lines; line++) {
        equations += number[line];
        number[line] = equations ? equations - 1 : 0;
    }
    for (int64_t i = 0; i < chords->count; i++)
        for (int64_t k = 0; k < height; k++) {
            system->at[i * height + k] = number[within(chords->line[i] + k, 0, lines - 1)];
            system->beside[i * height + k] = APART * ((double)(chords->line[i] + k) - chords->middle[i]);
        }
    system->band.count = system->lower.count = system->inverse.count = equations;
}

/* Least squares for a straight line of slope near 0; zero where all weights are. */
static void tilts_of(System *system, int64_t from, double lean) {
    const double *weight = system->weight + from, *beside = system->beside + from;
    double a = 0, b = 0, c = 0;
    for (int64_t k = 0; k < system->chords->height; k++) {
        double tilted = weight[k] * beside[k];
        a += weight[k], b += tilted, c += tilted * beside[k];
    }
    c += 1.0 / (lean * lean);
    double scale = 1.0 / larger(a * c - b * b, TINY);
    for (int64_t k = 0; k < system->chords->height; k++) {
        double tilted = weight[k] * beside[k];
        system->tilt_x[from + k] = (c * weight[k] - b * tilted) * scale;
        system->tilt_lean[from + k] = (a * tilted - b * weight[k]) * scale;
    }
}

/* x and lean that the middles of a blob's chords give. */
static void straight_line(const System *system, int64_t from, const double *centre, double *x, double *lean) {
    *x = *lean = 0;
    for (int64_t k = 0; k < system->chords->height; k++)
        *x += system->tilt_x[from + k] * centre[k], *lean += system->tilt_lean[from + k] * centre[k];
}

static void add_blob(System *system, int64_t from, double lean_sigma) {
    const double *weight = system->weight + from, *beside = system->beside + from, *centre = system->centre + from;
    const int64_t *at = system->at + from;
    double x, lean;
    tilts_of(system, from, lean_sigma);
    straight_line(system, from, centre, &x, &lean);
    for (int64_t row = 0; row < system->chords->height; row++) {
        if (!(weight[row] > 0)) continue;
        system->right[at[row]] += weight[row] * (centre[row] - x - beside[row] * lean);
        for (int64_t column = 0; column <= row; column++) {
            double explained = system->tilt_x[from + column] + beside[row] * system->tilt_lean[from + column];
            *band_at(&system->band, at[row], at[column]) += weight[row] * ((row == column) - explained);
        }
    }
}

/* How the chords of a blob move with the leans at its place. */
static void add_blob_leans(System *system, int64_t i) {
    const int64_t height = system->chords->height, from = i * height;
    const double *beside = system->beside + from;
    double x, lean, squares = 0, right = 0;
    straight_line(system, from, beside, &x, &lean);
    for (int64_t k = 0; k < height; k++) {
        double steep = system->weight[from + k] * (beside[k] - x - lean * beside[k]);
        squares += steep * beside[k], right += steep * system->centre[from + k];
        for (int a = 0; a < TERMS; a++) system->leans.shifts[system->at[from + k]][a] += steep * system->terms[i][a];
    }
    add_leans(&system->leans, system->terms[i], squares, right);
}

static void set_up(System *system, double lean) {
    int64_t height = system->chords->height;
    memset(system->right, 0, (size_t)system->band.count * sizeof *system->right);
    memset(system->band.values, 0, (size_t)(system->band.count * height) * sizeof *system->right);
    for (int64_t i = 0; i < system->chords->count; i++) add_blob(system, i * height, lean);
}

static void solve_shifts(System *system, double jitter_px, bool leaning) {
    factor(&system->band, 1.0 / (jitter_px * jitter_px), &system->lower);
    solve_down(&system->lower, system->right, system->shift);
    if (leaning) {
        eliminate_shifts(&system->leans, &system->lower, system->shift);
        solve_leans(&system->leans, system->band.count, system->shift);
    }
    solve_up(&system->lower, system->shift);
}

/* Of the chords, in units of their σ, and the blobs' leans. */
static void residuals(System *system, double jitter_px) {
    int64_t height = system->chords->height;
    solve_shifts(system, jitter_px, false);
    for (int64_t i = 0; i < system->chords->count; i++) {
        int64_t from = i * height;
        double *own = system->residual + from, x;
        for (int64_t k = 0; k < height; k++) own[k] = system->centre[from + k] - system->shift[system->at[from + k]];
        straight_line(system, from, own, &x, system->lean + i);
        for (int64_t k = 0; k < height; k++)
            own[k] = (own[k] - x - system->lean[i] * system->beside[from + k]) * sqrt(system->weight[from + k]);
    }
}

/* Weights outlying chords down, and draws the blobs upright by the leans of discs at their places. */
static void straighten(System *system, const double size[2], double jitter_px) {
    int64_t count = system->chords->count, height = system->chords->height;
    double squares = 0;
    residuals(system, jitter_px);
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
    no_leans(&system->leans, system->band.count);
    for (int64_t i = 0; i < count; i++) add_blob_leans(system, i);
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
static double covariance(const System *system, int64_t from, int64_t down) {
    const double *share = system->chords->share + from;
    const int64_t *at = system->at + from;
    double sum = 0;
    for (int64_t i = 0; i < system->chords->height; i++)
        for (int64_t k = 0; k < system->chords->height && share[i] != 0; k++)
            sum += share[i] * share[k] * band_value(&system->inverse, at[i], at_most(at[k] + down, system->band.count - 1));
    return sum;
}

/* How the leans' errors move a blob's x so many lines down. */
static void by_leans(const System *system, int64_t from, int64_t down, Terms moved) {
    memset(moved, 0, sizeof(Terms));
    for (int64_t k = 0; k < system->chords->height; k++) {
        const double *whole = system->leans.half[at_most(system->at[from + k] + down, system->band.count - 1)];
        for (int a = 0; a < TERMS; a++) moved[a] += system->chords->share[from + k] * whole[a];
    }
    solve_terms_down(system->leans.root, moved);
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
    whole_of(&system->leans, &system->lower);
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
    from_the_surest(chords, &system);
    number_lines(lines, &system);
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
