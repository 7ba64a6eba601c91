/* Whether, where and how far rows are shifted sideways, by the means of small blocks (as shifted_rows.py). All sums
   are of whole numbers, so their order is of no importance. */
#include "field.h"

enum { LEAST_BINS = 2, MOST_BLOCKS = LONGEST_SIDE / BLOCK_ROWS, MOST_BINS = LONGEST_SIDE / BIN_COLUMNS };
static const double LEAST_SIGMA = 2.0, LEAST_SHARE = 0.02, LEAST_LIKENESS = 0.6, LEAST_COARSE_GAIN = 0.05;

WIDE static int32_t product_of(const int16_t *one, const int16_t *other, int64_t count) {
    int32_t sum = 0;
    for (int64_t i = 0; i < count; i++) sum += one[i] * other[i];
    return sum;
}

WIDE static int32_t sum_of_bins(const int16_t *values, int64_t count) {
    int32_t sum = 0;
    for (int64_t i = 0; i < count; i++) sum += values[i];
    return sum;
}

/* From a block to the last: contrast, and how much of it is where it was. */
typedef struct {
    double power, unshifted;
} Below;

static double sum_blocks(const Profiles *now, const Profiles *then, Below *below) {
    int64_t bins = now->bins;
    double most = 0;
    Below sum = {0, 0};
    for (int64_t b = now->blocks - 1; b >= 0; b--) {
        const int16_t *one = now->means + b * bins, *other = then->means + b * bins;
        int64_t total = sum_of_bins(one, bins), earlier = sum_of_bins(other, bins);
        double own = (double)(bins * product_of(one, one, bins) - total * total);
        double power = sqrt(own * (double)(bins * product_of(other, other, bins) - earlier * earlier));
        most = larger(power, most);
        sum.power += power, sum.unshifted += (double)(bins * product_of(one, other, bins) - total * earlier);
        below[b] = sum;
    }
    return most;
}

/* Whether there is contrast above that has not moved, and contrast below that has. */
static bool is_candidate(const Below *below, int64_t b) {
    double above = below[0].power - below[b].power, unshifted_above = below[0].unshifted - below[b].unshifted;
    return smaller(below[b].power, above) >= LEAST_SHARE * below[0].power && unshifted_above >= LEAST_LIKENESS * above &&
           below[b].power - below[b].unshifted >= LEAST_COARSE_GAIN * below[b].power;
}

/* Adds a block's products with the earlier one shifted right by each number of bins, less the unshifted one. */
static void add_gains(const int16_t *now, const int16_t *then, int64_t bins, int64_t *gains) {
    int16_t twice[2 * MOST_BINS];
    memcpy(twice, then, (size_t)bins * sizeof *then);
    memcpy(twice + bins, then, (size_t)bins * sizeof *then);
    int32_t unshifted = product_of(now, then, bins);
    for (int64_t shift = LEAST_BINS; shift <= bins - LEAST_BINS; shift++)
        gains[shift] += product_of(now, twice + bins - shift, bins) - unshifted;
}

Coarse coarse_shift(const Profiles *now, const Profiles *then) {
    int64_t bins = now->bins, first = 0, gains[MOST_BINS] = {0}, most = 0;
    Below below[MOST_BLOCKS];
    Coarse best = {-1, 0}, none = {-1, 0};
    if (!now->blocks || sum_blocks(now, then, below) < LEAST_SIGMA * LEAST_SIGMA * (double)bins * (double)bins) return none;
    while (first < now->blocks && !is_candidate(below, first)) first++;
    for (int64_t b = now->blocks - 1; b >= first; b--) {
        add_gains(now->means + b * bins, then->means + b * bins, bins, gains);
        if (!is_candidate(below, b)) continue;
        for (int64_t shift = bins - LEAST_BINS; shift >= LEAST_BINS; shift--)
            if (gains[shift] >= most && gains[shift] > 0) most = gains[shift], best = (Coarse){b, shift};
    }
    return best.block >= 0 && (double)(bins * most) >= LEAST_COARSE_GAIN * below[best.block].power ? best : none;
}
