/* Effect of line jitter on x if the shifts are not solved for (as chords.binary_shares, line_shifts.unsolved). */
#include "kernel.h"

static const double LINES_APART = 2.0, TINY = 2.2250738585072014e-308;

/* The share of every line in a low blob's x, (height,); of a doubled picture rows between lines belong to both. */
static void shares_of(const Picture *picture, const Run *run, int32_t runs, int64_t line, int64_t height,
                      double *share, double *amount) {
    int64_t lines = picture->rows * picture->y_step / 2;
    for (int64_t k = 0; k < height; k++) share[k] = amount[k] = 0;
    for (int32_t i = 0; i < runs; i++) {
        int64_t half_lines = run[i].row * picture->y_step - first_row(picture);
        int64_t before = within(half_lines >> 1, 0, lines - 1) - line;
        if (before < 0 || before >= height) continue;
        if ((half_lines & 1) == 0) amount[before] += run[i].last - run[i].first + 1;
    }
    for (int32_t i = 0; i < runs; i++) {
        int64_t half_lines = run[i].row * picture->y_step - first_row(picture);
        int64_t before = within(half_lines >> 1, 0, lines - 1) - line;
        int64_t after = within((half_lines + 1) >> 1, 0, lines - 1) - line;
        if (before < 0 || after < 0 || before >= height || after >= height) continue;
        double length = run[i].last - run[i].first + 1;
        double part = 0.5 + 0.5 * ((amount[before] > 0) - (amount[after] > 0));
        share[before] += length * part;
        share[after] += length - length * part;
    }
    double total = 0;
    for (int64_t k = 0; k < height; k++) total += share[k];
    for (int64_t k = 0; k < height; k++) share[k] /= total;
}

int line_shares(const Picture *picture, const Settings *settings, const Seen *seen, double *common_px,
                double *reach_px) {
    int64_t low = 0, count = seen->component_count;
    double jitter = settings->line_jitter_px;
    *reach_px = LINES_APART;
    for (int64_t i = 0; i < count; i++) {
        common_px[i] = jitter;
        low += seen->components[i].low;
    }
    if (jitter == 0 || !low) return DONE;
    int64_t most = picture->rows + 1;
    double *correlation = malloc((size_t)low * sizeof *correlation);
    double *share = malloc((size_t)(2 * most) * sizeof *share);
    if (!correlation || !share) {
        free(correlation);
        free(share);
        return NO_MEMORY;
    }
    int64_t lines = picture->rows * picture->y_step / 2, asked = 0;
    for (int64_t i = 0; i < count; i++) {
        const Component *own = seen->components + i;
        if (!own->low) continue;
        int64_t top = own->first_row * picture->y_step - first_row(picture);
        int64_t bottom = own->last_row * picture->y_step - first_row(picture);
        int64_t line = within(top >> 1, 0, lines - 1);
        int64_t height = within((bottom + 1) >> 1, 0, lines - 1) - line + 1;
        shares_of(picture, seen->runs + own->begin, own->count, line, at_most(height, most), share, share + most);
        double square = 0, beside = 0;
        for (int64_t k = 0; k < height; k++) square += share[k] * share[k];
        for (int64_t k = 0; k + 1 < height; k++) beside += share[k + 1] * share[k];
        double common = jitter * jitter * square;
        common_px[i] = sqrt(common);
        correlation[asked++] = jitter * jitter * beside / larger(common, TINY);
    }
    double middle = smaller(larger(median_of(correlation, low), 0.05), 0.99);
    *reach_px = LINES_APART / sqrt(-2.0 * log(middle));
    free(correlation);
    free(share);
    return DONE;
}

static double greatest(const double *values, int64_t count) {
    double most = values[0];
    for (int64_t i = 1; i < count; i++)
        if (values[i] > most) most = values[i];
    return most;
}

double ranked(double *values, int64_t count, int64_t rank) {
    int64_t low = 0, high = count - 1;
    while (low < high) {
        double pivot = values[low + (high - low) / 2];
        int64_t i = low, j = high;
        while (i <= j) {
            while (i <= high && values[i] < pivot) i++;
            while (j >= low && values[j] > pivot) j--;
            if (i > j) break;
            double kept = values[i];
            values[i++] = values[j], values[j--] = kept;
        }
        if (rank <= j) high = j;
        else if (rank >= i) low = i;
        else break;
    }
    return values[rank];
}

double median_of(double *values, int64_t count) {
    double middle = ranked(values, count, count / 2);
    return count % 2 ? middle : (greatest(values, count / 2) + middle) / 2;
}
