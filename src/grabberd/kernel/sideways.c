/* Whether rows may be shifted sideways, by the sums of small blocks (as checks.shifted_rows). */
#include "field.h"

static const double LEAST_SIGMA = 2.0, LEAST_SHARE = 0.02, LEAST_LIKENESS = 0.6, LEAST_COARSE_GAIN = 0.05;

/* A sum of grey values over the highest block, of less than 24 rows, needs no more: so no product overflows. */
enum { SUM_BITS = 0x7fff };

typedef struct {
    int64_t now, then, now_now, then_then, now_then;
} Products;

WIDE static void multiply(const int32_t *restrict now, const int32_t *restrict then, int64_t bins, Products *of) {
    Products sum = {0};
    for (int64_t i = 0; i < bins; i++) {
        int64_t one = now[i] & SUM_BITS, other = then[i] & SUM_BITS;
        sum.now += one, sum.then += other;
        sum.now_now += one * one, sum.then_then += other * other, sum.now_then += one * other;
    }
    *of = sum;
}

/* Contrast of each block's means, and how much of it is where it was; sums from each block to the last. */
typedef struct {
    double power, unshifted;
} Block;

static double sum_blocks(const int32_t *now, const int32_t *then, int64_t rows, int64_t bins, Block *below) {
    int64_t blocks = rows / BLOCK_ROWS;
    double most = 0;
    Block sum = {0, 0};
    for (int64_t b = blocks - 1; b >= 0; b--) {
        int64_t high = b == blocks - 1 ? rows - b * BLOCK_ROWS : BLOCK_ROWS;
        double scale = 1.0 / (double)(bins * (BIN_COLUMNS * high) * (BIN_COLUMNS * high));
        Products of;
        multiply(now + b * bins, then + b * bins, bins, &of);
        double own = (double)(bins * of.now_now - of.now * of.now), other = (double)(bins * of.then_then - of.then * of.then);
        double power = sqrt(own * other) * scale;
        most = larger(power, most);
        sum.power += power, sum.unshifted += (double)(bins * of.now_then - of.now * of.then) * scale;
        below[b] = sum;
    }
    return most;
}

bool may_be_shifted(const int32_t *now, const int32_t *then, int64_t rows, int64_t columns) {
    int64_t blocks = rows / BLOCK_ROWS, bins = columns / BIN_COLUMNS;
    Block below[LONGEST_SIDE / BLOCK_ROWS];
    if (sum_blocks(now, then, rows, bins, below) < LEAST_SIGMA * LEAST_SIGMA * (double)bins) return false;
    for (int64_t b = 0; b < blocks; b++) {
        double above = below[0].power - below[b].power, unshifted_above = below[0].unshifted - below[b].unshifted;
        if (smaller(below[b].power, above) >= LEAST_SHARE * below[0].power && unshifted_above >= LEAST_LIKENESS * above &&
            below[b].power - below[b].unshifted >= LEAST_COARSE_GAIN * below[b].power)
            return true;
    }
    return false;
}
