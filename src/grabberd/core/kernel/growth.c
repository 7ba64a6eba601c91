/* The largest set of hypotheses that agree (as agreement.Agreement.largest). */
#include "agreement.h"

enum { MOST_STARTS = 3, LEAST_SUPPORT = 3 };
static const double AROUND = 1.6, TORN = 1e6, SUREST_FIRST[] = {0.4, 0.6, 1.0};

typedef struct {
    double value;
    int64_t index;
} Ranked;

/* One growth: which hypotheses are chosen, in order, and what they tell. */
typedef struct {
    const World *world;
    const Judge *judge;
    const Hypotheses *known;
    Expectation field;
    int64_t *chosen, count, *first; /* first: of each target, the best hypothesis of a wave, or −1 */
    double *far;                    /* of each hypothesis, χ² */
    double *expected_mm, *sigma_mm; /* of each target */
    Ranked *ranked;
    bool *allowed, *taken[VIEWS], *doubtful, *torn;
} Growth;

static int by_value(const void *one, const void *other) {
    const Ranked *first = one, *second = other;
    if (first->value != second->value) return first->value < second->value ? -1 : 1;
    return (first->index > second->index) - (first->index < second->index);
}

static void foresee(Growth *growth) {
    for (int64_t i = 0; i < growth->field.targets; i++)
        growth->sigma_mm[i] = sqrt(expected_of(&growth->field, i, growth->expected_mm + 3 * i));
}

/* χ² of a hypothesis against the expected position of its target. */
static double far_of(const Growth *growth, int64_t index) {
    int64_t target = growth->known->target[index];
    double sum = 0, sigma_mm = growth->sigma_mm[target];
    for (int k = 0; k < 3; k++) {
        double off = growth->known->displacement_mm[3 * index + k] - growth->expected_mm[3 * target + k];
        sum += off * off / (growth->known->variance_mm2[3 * index + k] + sigma_mm * sigma_mm);
    }
    return sum;
}

static void choose(Growth *growth, int64_t index) {
    const Hypotheses *known = growth->known;
    growth->chosen[growth->count++] = index;
    for (int v = 0; v < VIEWS; v++) growth->taken[v][known->blob[v][index]] = true;
    see(&growth->field, known->target[index], known->displacement_mm + 3 * index);
}

static void drop(Growth *growth, int64_t place) {
    int64_t index = growth->chosen[place];
    for (int v = 0; v < VIEWS; v++) growth->taken[v][growth->known->blob[v][index]] = false;
    forget(&growth->field, growth->known->target[index]);
    growth->allowed[index] = false;
    growth->count--;
    memmove(growth->chosen + place, growth->chosen + place + 1, (size_t)(growth->count - place) * sizeof *growth->chosen);
}

/* Chooses the best hypotheses whose runner-up for the same target is clearly worse; each blob once. */
static bool add_undoubted(Growth *growth, int64_t free_ones) {
    const Hypotheses *known = growth->known;
    int64_t best = 0, before = growth->count;
    qsort(growth->ranked, (size_t)free_ones, sizeof *growth->ranked, by_value);
    for (int64_t i = 0; i < growth->field.targets; i++) growth->first[i] = -1, growth->doubtful[i] = false;
    for (int64_t i = 0; i < free_ones; i++) {
        Ranked own = growth->ranked[i];
        int64_t target = known->target[own.index], first = growth->first[target];
        if (first < 0) growth->first[target] = own.index, growth->ranked[best++] = own;
        else if (own.value - growth->far[first] < growth->judge->margin) growth->doubtful[target] = true;
    }
    for (int64_t i = 0; i < best; i++) {
        int64_t index = growth->ranked[i].index;
        if (growth->doubtful[known->target[index]]) continue;
        if (!growth->taken[0][known->blob[0][index]] && !growth->taken[1][known->blob[1][index]]) choose(growth, index);
    }
    return growth->count > before;
}

/* Adds hypotheses predicted well enough by the chosen ones; the most certain first. */
static bool add_wave(Growth *growth) {
    const Hypotheses *known = growth->known;
    double gate = growth->world->gate * growth->world->gate;
    foresee(growth);
    for (int64_t i = 0; i < known->count; i++) {
        bool is_free = growth->allowed[i] && !growth->field.seen[known->target[i]] && !growth->taken[0][known->blob[0][i]] &&
                       !growth->taken[1][known->blob[1][i]];
        double far = is_free ? far_of(growth, i) : INFINITY;
        growth->far[i] = far <= gate ? far : INFINITY;
    }
    for (size_t step = 0; step < sizeof SUREST_FIRST / sizeof *SUREST_FIRST; step++) {
        double most_mm = SUREST_FIRST[step] * growth->judge->trust * growth->judge->pitch_mm;
        int64_t free_ones = 0;
        for (int64_t i = 0; i < known->count; i++)
            if (isfinite(growth->far[i]) && growth->sigma_mm[known->target[i]] <= most_mm)
                growth->ranked[free_ones++] = (Ranked){growth->far[i], i};
        if (add_undoubted(growth, free_ones)) return true;
    }
    return false;
}

/* Drops chosen hypotheses that the others contradict, the worst first; they are not allowed again. */
static void drop_contradicted(Growth *growth) {
    while (true) {
        double worst = growth->world->gate * growth->world->gate;
        int64_t place = -1;
        foresee(growth);
        memset(growth->torn, 0, (size_t)growth->field.targets * sizeof *growth->torn);
        mark_torn(growth->world, growth->field.seen_mm, growth->field.seen, growth->torn);
        for (int64_t i = 0; i < growth->count; i++) {
            int64_t index = growth->chosen[i];
            double far = far_of(growth, index) + (growth->torn[growth->known->target[index]] ? TORN : 0.0);
            if (far > worst) worst = far, place = i;
        }
        if (place < 0) return;
        drop(growth, place);
    }
}

/* Grows from a start, checks, and grows again. */
static void grow(Growth *growth, int64_t start, const int64_t blobs[VIEWS]) {
    expect_nothing(&growth->field, growth->judge->covariance_mm2);
    growth->count = 0;
    for (int v = 0; v < VIEWS; v++) memset(growth->taken[v], 0, (size_t)blobs[v] * sizeof *growth->taken[v]);
    for (int64_t i = 0; i < growth->known->count; i++) growth->allowed[i] = true;
    choose(growth, start);
    while (true) {
        while (add_wave(growth)) continue;
        int64_t grown = growth->count;
        drop_contradicted(growth);
        if (growth->count == grown) return;
    }
}

static double length(const double one[3], const double other[3]) {
    double x = one[0] - other[0], y = one[1] - other[1], z = one[2] - other[2];
    return sqrt(x * x + y * y + z * z);
}

static bool supports(const Growth *growth, int64_t one, int64_t other) {
    const Hypotheses *known = growth->known;
    if (known->target[one] == known->target[other] || known->blob[0][one] == known->blob[0][other] ||
        known->blob[1][one] == known->blob[1][other])
        return false;
    const double *nominal_mm = growth->world->nominal_mm;
    return length(nominal_mm + 3 * known->target[one], nominal_mm + 3 * known->target[other]) <= AROUND * growth->judge->pitch_mm &&
           length(known->displacement_mm + 3 * one, known->displacement_mm + 3 * other) <=
               growth->judge->trust * growth->judge->pitch_mm;
}

/* Hypotheses to start from, the most certain first: near nominal, and supported by neighbours. */
static int64_t rank_starts(const Growth *growth, Ranked *starts) {
    const double nominal[3] = {0};
    int64_t near_ones = 0, count = 0;
    for (int64_t i = 0; i < growth->known->count; i++) {
        double away = length(growth->known->displacement_mm + 3 * i, nominal);
        if (away <= 0.5 * growth->judge->pitch_mm) starts[near_ones++] = (Ranked){away, i};
    }
    int64_t *support = growth->chosen;
    memset(support, 0, (size_t)near_ones * sizeof *support);
    for (int64_t i = 0; i < near_ones; i++)
        for (int64_t k = 0; k < i; k++)
            if ((support[i] < LEAST_SUPPORT || support[k] < LEAST_SUPPORT) && supports(growth, starts[i].index, starts[k].index)) support[i]++, support[k]++;
    for (int64_t i = 0; i < near_ones; i++)
        if (support[i] >= LEAST_SUPPORT) starts[count++] = starts[i];
    qsort(starts, (size_t)count, sizeof *starts, by_value);
    return count;
}

static double squares_of(const Growth *growth) {
    double sum = 0;
    for (int64_t i = 0; i < growth->count; i++) {
        const double *own = growth->known->displacement_mm + 3 * growth->chosen[i];
        sum += own[0] * own[0] + own[1] * own[1] + own[2] * own[2];
    }
    return sum;
}

/* The starts that the others contradict. */
static int64_t contradicted(const Growth *growth, Ranked *starts, int64_t count) {
    int64_t kept = 0;
    for (int64_t i = 0; i < count; i++)
        if (far_of(growth, starts[i].index) > growth->world->gate * growth->world->gate) starts[kept++] = starts[i];
    return kept;
}

static int by_number(const void *one, const void *other) {
    int64_t first = *(const int64_t *)one, second = *(const int64_t *)other;
    return (first > second) - (first < second);
}

/* Room for all arrays, in one block of numbers and one of flags. */
static bool make(Growth *growth, const int64_t blobs[VIEWS], double **numbers, bool **flags, Ranked **starts) {
    size_t targets = (size_t)growth->world->targets, known = (size_t)growth->known->count;
    double *number = *numbers = malloc((targets * (targets + 12) + 6 * known + 8) * sizeof *number);
    bool *flag = *flags = malloc(3 * targets + known + (size_t)blobs[0] + (size_t)blobs[1] + 1);
    if (!number || !flag) return false;
    Expectation *field = &growth->field;
    *field = (Expectation){growth->world->targets, growth->world->noise_mm * growth->world->noise_mm, number, 0, 0, 0, flag};
    field->value = number += targets * targets, field->seen_mm = number += 3 * targets, field->row = number += 3 * targets;
    growth->expected_mm = number += targets, growth->sigma_mm = number += 3 * targets;
    growth->far = number += targets;
    growth->ranked = (Ranked *)(number += known), *starts = growth->ranked + known;
    growth->chosen = (int64_t *)(number += 4 * known), growth->first = growth->chosen + known;
    growth->doubtful = flag += targets, growth->torn = flag += targets, growth->allowed = flag += targets;
    growth->taken[0] = flag += known, growth->taken[1] = flag + blobs[0];
    return true;
}

int largest(const World *world, const Judge *judge, const Hypotheses *known, const int64_t blobs[VIEWS], int64_t *chosen,
            int64_t *count, double *expected_mm, double *sigma_mm) {
    Growth growth = {.world = world, .judge = judge, .known = known};
    double *numbers, least = INFINITY;
    bool *flags;
    Ranked *starts;
    int status = make(&growth, blobs, &numbers, &flags, &starts) ? DONE : NO_MEMORY;
    int64_t left = status == DONE ? rank_starts(&growth, starts) : 0;
    *count = 0;
    for (int turn = 0; turn < MOST_STARTS && left; turn++) {
        grow(&growth, starts[0].index, blobs);
        double squares = squares_of(&growth);
        if (growth.count > *count || (growth.count == *count && squares < least)) {
            *count = growth.count, least = squares;
            memcpy(chosen, growth.chosen, (size_t)growth.count * sizeof *chosen);
            memcpy(expected_mm, growth.expected_mm, 3 * (size_t)world->targets * sizeof *expected_mm);
            memcpy(sigma_mm, growth.sigma_mm, (size_t)world->targets * sizeof *sigma_mm);
        }
        starts++;
        left = contradicted(&growth, starts, left - 1);
    }
    qsort(chosen, (size_t)*count, sizeof *chosen, by_number);
    free(numbers);
    free(flags);
    return status;
}
