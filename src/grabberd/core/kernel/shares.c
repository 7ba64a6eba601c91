/* Effect of line jitter on x to be expected if lines keep their shifts (as line_jitter.binary_shares, line_shifts.unsolved). */
#include "kernel.h"

static const double LINES_APART = 2.0, TINY = 2.2250738585072014e-308;

/* One row alone is a line, too. */
static int64_t last_line(const Picture *picture) { return within(picture->rows * picture->y_step / 2, 1, INT64_MAX) - 1; }

/* The share of every line in a low blob's x, in half pixels, of a doubled picture: rows between lines belong to both, but to
   the one alone where the other has nothing. `length` has room for the blob's rows. */
static void shares_of(const Picture *picture, const Component *own, const Run *run, int64_t line, double *share, double *length) {
    int64_t last = last_line(picture), rows = own->last_row - own->first_row + 1;
    for (int64_t k = 0; k < rows; k++) length[k] = 0;
    for (int32_t i = 0; i < own->count; i++) length[run[i].row - own->first_row] += run[i].last - run[i].first + 1;
    for (int64_t k = 0; k < rows; k++) {
        int64_t half_lines = own->first_row + k - first_row(picture);
        int64_t before = within(half_lines >> 1, 0, last) - line, after = within((half_lines + 1) >> 1, 0, last) - line;
        double part = (half_lines & 1) ? 1.0 + (k > 0) - (k + 1 < rows) : 2.0;
        share[before] += length[k] * part, share[after] += length[k] * (2.0 - part);
    }
}

/* The square sum of a blob's shares, and the sum of the products of neighbours. */
static void share_products(const Picture *picture, const Seen *seen, const Component *own, double *share, double *square, double *beside) {
    int64_t last = last_line(picture), top = own->first_row - first_row(picture), bottom = own->last_row - first_row(picture);
    int64_t line = within(top >> 1, 0, last), height = within((bottom + 1) >> 1, 0, last) - line + 1;
    double total = (double)own->pixels * (double)own->pixels;
    *square = own->row_squares / total, *beside = own->row_products / total;
    if (picture->y_step == 2) return;
    for (int64_t k = 0; k < height; k++) share[k] = 0;
    shares_of(picture, own, seen->runs + own->begin, line, share, share + height);
    *square = share[0] * share[0], *beside = 0;
    for (int64_t k = 1; k < height; k++) *square += share[k] * share[k], *beside += share[k] * share[k - 1];
    *square /= 4 * total, *beside /= 4 * total;
}

int line_shares(const Picture *picture, const Settings *settings, const Seen *seen, double *common_px,
                double *reach_px) {
    int64_t low = 0, count = seen->component_count, asked = 0;
    double jitter = settings->line_jitter_px;
    *reach_px = LINES_APART;
    for (int64_t i = 0; i < count; i++) {
        common_px[i] = jitter;
        low += seen->components[i].low;
    }
    if (jitter == 0 || !low) return DONE;
    double *correlation = malloc((size_t)low * sizeof *correlation);
    double *share = malloc((size_t)(2 * (picture->rows + 1)) * sizeof *share);
    bool is_room = correlation && share;
    for (int64_t i = 0; i < count && is_room; i++) {
        double square, beside;
        if (!seen->components[i].low) continue;
        share_products(picture, seen, seen->components + i, share, &square, &beside);
        double common = jitter * jitter * square;
        common_px[i] = sqrt(common);
        correlation[asked++] = jitter * jitter * beside / larger(common, TINY);
    }
    if (is_room) {
        double middle = smaller(larger(median_of(correlation, low), 0.05), 0.99);
        *reach_px = LINES_APART / sqrt(-2.0 * log(middle));
    }
    free(correlation);
    free(share);
    return is_room ? DONE : NO_MEMORY;
}

static double greatest(const double *values, int64_t count) {
    double most = values[0];
    for (int64_t i = 1; i < count; i++)
        if (values[i] > most) most = values[i];
    return most;
}

/* The middle one of three, so that values that stand in order already are halved. */
static double pivot_of(const double *values, int64_t low, int64_t high) {
    double first = values[low], middle = values[low + (high - low) / 2], last = values[high];
    return larger(smaller(first, middle), smaller(larger(first, middle), last));
}

/* Every value is moved, whichever side it belongs to: half of the branches that ask would be guessed wrong. */
double ranked(double *values, int64_t count, int64_t rank) {
    int64_t low = 0, high = count - 1;
    while (low < high) {
        double pivot = pivot_of(values, low, high);
        int64_t below = low, equal;
        for (int64_t i = low; i <= high; i++) {
            double own = values[i];
            values[i] = values[below], values[below] = own;
            below += own < pivot;
        }
        if (rank < below) {
            high = below - 1;
            continue;
        }
        equal = below;
        for (int64_t i = below; i <= high; i++) {
            double own = values[i];
            values[i] = values[equal], values[equal] = own;
            equal += !(own > pivot);
        }
        if (rank < equal) break;
        low = equal;
    }
    return values[rank];
}

double median_of(double *values, int64_t count) {
    double middle = ranked(values, count, count / 2);
    return count % 2 ? middle : (greatest(values, count / 2) + middle) / 2;
}
