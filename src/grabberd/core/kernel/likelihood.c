/* Weights of all places that explain a blob's bits, and their mean (as locale.py). */
#include "likelihood.h"

#include "lanes.h"

enum { LOW = 2 * REACH_Y(1) + 1, HIGH = HEIGHT, ABREAST = 3 };
static const double STEPS_X = 10, STEPS_Y = 8;
static const float NEVER = -115.0f, BITS = 1.44269504f; /* of a natural unit */

/* One part of every column: nine sums wait for one another less than they do for the memory. */
INLINE void add_up(const float *values, int64_t rows, const int64_t *entry, int64_t entries, Lanes columns[WIDTH]) {
    for (int column = 0; column < WIDTH; column++) columns[column] = lanes_at(values + entry[0] + column * rows);
    for (int64_t k = 1; k < entries; k++) {
        const float *from = values + entry[k];
        for (int column = 0; column < WIDTH; column++) columns[column] += lanes_at(from + column * rows);
    }
}

/* The last place of every column. */
INLINE void add_last(const float *values, int64_t rows, const int64_t *entry, int64_t entries, float *last) {
    float sum[WIDTH];
    for (int column = 0; column < WIDTH; column++) sum[column] = values[entry[0] + column * rows];
    for (int64_t k = 1; k < entries; k++) {
        const float *from = values + entry[k];
        for (int column = 0; column < WIDTH; column++) sum[column] += from[column * rows];
    }
    memcpy(last, sum, sizeof sum);
}

INLINE float larger_of(float one, float other) { return one > other ? one : other; }

INLINE float greatest_in(const Lanes *columns, int count) {
    Lanes most = columns[0];
    for (int i = 1; i < count; i++) most = greater(most, columns[i]);
    return greatest_of(most);
}

/* Logarithms to weights; the greatest one's is 1. */
INLINE void to_weights(Lanes *columns, int count, float greatest) {
    for (int i = 0; i < count; i++) columns[i] = greater((columns[i] - greatest) * BITS, all(NEVER));
    for (int i = 0; i + ABREAST <= count; i += ABREAST) powers_of_two(columns + i, ABREAST);
    if (count % ABREAST) powers_of_two(columns + count - count % ABREAST, count % ABREAST);
}

INLINE Lanes total_of(const Lanes *columns) {
    Lanes sum = columns[0];
    for (int i = 1; i < WIDTH; i++) sum += columns[i];
    return sum;
}

INLINE void sum_along(const Lanes *columns, float along[WIDTH]) {
    const Lanes sums = sums_of_eight(columns);
    memcpy(along, &sums, sizeof sums);
    along[EIGHT] = sum_of(columns[EIGHT]);
}

/* The last place of the columns lies beside the others, and takes one or two of eight lanes in all. */
WIDE static void weigh_low(const float *values, int64_t rows, const int64_t *entry, int64_t entries, Weighed *found) {
    Lanes upper[WIDTH], last[2] = {all(-INFINITY), all(-INFINITY)};
    float rest[WIDTH];
    add_up(values, rows, entry, entries, upper);
    add_last(values + EIGHT, rows, entry, entries, rest);
    memcpy(last, rest, sizeof rest);
    found->greatest = larger_of(greatest_in(upper, WIDTH), greatest_in(last, 2));
    to_weights(upper, WIDTH, found->greatest);
    to_weights(last, 2, found->greatest);
    const Lanes down = total_of(upper);
    sum_along(upper, found->along);
    for (int column = 0; column < WIDTH; column++) found->along[column] += last[column / EIGHT][column % EIGHT];
    memcpy(found->down, &down, sizeof down);
    found->down[EIGHT] = sum_of(last[0] + last[1]);
}

/* The lower eight overlap the upper ones, and count where they do not. */
WIDE static void weigh_high(const float *values, int64_t rows, const int64_t *entry, int64_t entries, Weighed *found) {
    enum { APART = HIGH - EIGHT };
    const WholeLanes each = {0, 1, 2, 3, 4, 5, 6, 7}, beyond = each >= EIGHT - APART;
    Lanes upper[WIDTH], lower[WIDTH];
    add_up(values, rows, entry, entries, upper);
    add_up(values + APART, rows, entry, entries, lower);
    found->greatest = larger_of(greatest_in(upper, WIDTH), greatest_in(lower, WIDTH));
    to_weights(upper, WIDTH, found->greatest);
    to_weights(lower, WIDTH, found->greatest);
    const Lanes down[2] = {total_of(upper), total_of(lower)};
    for (int column = 0; column < WIDTH; column++) upper[column] += only(beyond, lower[column]);
    sum_along(upper, found->along);
    memcpy(found->down + APART, down + 1, sizeof *down);
    memcpy(found->down, down, sizeof *down);
}

Weighed weigh(const float *values, int64_t rows, const int64_t *entry, int64_t entries, int height) {
    Weighed found;
    if (height == LOW) weigh_low(values, rows, entry, entries, &found);
    else weigh_high(values, rows, entry, entries, &found);
    return found;
}

static double total(const Weighed *found) {
    double sum = 0;
    for (int column = 0; column < WIDTH; column++) sum += (double)found->along[column];
    return sum;
}

double evidence_of(const Weighed *found) { return (double)found->greatest + log(total(found)); }

/* Mean and variance of places counted from the middle one on. */
INLINE void moments(const float *weight, int count, double sum, double *mean, double *variance) {
    double first = 0, second = 0;
    for (int i = 0; i < count; i++) {
        double place = (double)(count / 2 - i);
        first += (double)weight[i] * place, second += (double)weight[i] * (place * place);
    }
    *mean = first / sum, *variance = second / sum - *mean * *mean;
}

Posterior posterior_of(const Weighed *found, int height) {
    Posterior posterior = {.evidence = evidence_of(found)};
    double sum = total(found);
    moments(found->along, WIDTH, sum, &posterior.x, &posterior.variance_x);
    if (height == LOW) moments(found->down, LOW, sum, &posterior.y, &posterior.variance_y);
    else moments(found->down, HIGH, sum, &posterior.y, &posterior.variance_y);
    posterior.x /= STEPS_X, posterior.y /= STEPS_Y;
    posterior.variance_x /= STEPS_X * STEPS_X, posterior.variance_y /= STEPS_Y * STEPS_Y;
    return posterior;
}
