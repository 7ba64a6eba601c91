/* How a field's lines are shifted follows from the chords of all blobs: the equations for it (as line_shifts.py). */
#include "equations.h"

static const double APART = 2.0, TINY = 2.2250738585072014e-308;

static double *carve(double **from, int64_t count) {
    double *own = *from;
    *from += count;
    return own;
}

bool make_system(const Chords *chords, int64_t lines, System *system, void **memory) {
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
static void from_the_surest(System *system) {
    const Chords *chords = system->chords;
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

void begin(int64_t lines, System *system) {
    from_the_surest(system);
    number_lines(lines, system);
}

/* Least squares for a straight line of slope near 0; zero where all weights are. */
INLINE void tilts_of(System *system, int64_t from, int64_t height, double lean) {
    const double *weight = system->weight + from, *beside = system->beside + from;
    double a = 0, b = 0, c = 0;
    for (int64_t k = 0; k < height; k++) {
        double tilted = weight[k] * beside[k];
        a += weight[k], b += tilted, c += tilted * beside[k];
    }
    c += 1.0 / (lean * lean);
    double scale = 1.0 / larger(a * c - b * b, TINY);
    for (int64_t k = 0; k < height; k++) {
        double tilted = weight[k] * beside[k];
        system->tilt_x[from + k] = (c * weight[k] - b * tilted) * scale;
        system->tilt_lean[from + k] = (a * tilted - b * weight[k]) * scale;
    }
}

INLINE void add_blob(System *system, int64_t from, int64_t height, double lean_sigma) {
    const double *weight = system->weight + from, *beside = system->beside + from, *centre = system->centre + from;
    const int64_t *at = system->at + from;
    double x, lean;
    tilts_of(system, from, height, lean_sigma);
    straight_line(system, from, height, centre, &x, &lean);
    for (int64_t row = 0; row < height; row++) {
        if (!(weight[row] > 0)) continue;
        system->right[at[row]] += weight[row] * (centre[row] - x - beside[row] * lean);
        for (int64_t column = 0; column <= row; column++) {
            double explained = system->tilt_x[from + column] + beside[row] * system->tilt_lean[from + column];
            *band_at(&system->band, at[row], at[column]) += weight[row] * ((row == column) - explained);
        }
    }
}

INLINE void add_blobs(System *system, int64_t height, double lean) {
    for (int64_t i = 0; i < system->chords->count; i++) add_blob(system, i * height, height, lean);
}

WIDE void set_up(System *system, double lean) {
    memset(system->right, 0, (size_t)system->band.count * sizeof *system->right);
    memset(system->band.values, 0, (size_t)(system->band.count * system->band.height) * sizeof *system->right);
#define ADD(height) add_blobs(system, height, lean)
    BY_HEIGHT(system->chords->height, ADD)
#undef ADD
}

/* How the chords of a blob move with the leans at its place. */
static void add_blob_leans(System *system, int64_t i) {
    const int64_t height = system->chords->height, from = i * height;
    const double *beside = system->beside + from;
    double x, lean, squares = 0, right = 0;
    straight_line(system, from, height, beside, &x, &lean);
    for (int64_t k = 0; k < height; k++) {
        double steep = system->weight[from + k] * (beside[k] - x - lean * beside[k]);
        squares += steep * beside[k], right += steep * system->centre[from + k];
        for (int a = 0; a < TERMS; a++) system->leans.shifts[system->at[from + k]][a] += steep * system->terms[i][a];
    }
    add_leans(&system->leans, system->terms[i], squares, right);
}

void tie_leans(System *system) {
    no_leans(&system->leans, system->band.count);
    for (int64_t i = 0; i < system->chords->count; i++) add_blob_leans(system, i);
}
