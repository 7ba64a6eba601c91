/* Where the fit of a disc begins: at the moments of its window (as template.py). */
#include "disc.h"

static const double ROW = 0.2;

/* The middle one of the window's grey values, whole numbers below 256: more than half of it is no target. */
WIDE float background_of(const Sheet *sheet) {
    int64_t wanted = sheet->pixels / 2 + 1 + sheet->padded - sheet->pixels;
    float value = -1.0f;
    for (float step = 128.0f; step >= 1.0f; step /= 2) {
        WholeLanes below = {0};
        for (int64_t i = 0; i < sheet->padded; i += EIGHT) below -= lanes_at(sheet->grey + i) <= value + step;
        value += sum_of_whole(below) < wanted ? step : 0.0f;
    }
    return value + 1.0f;
}

/* Mean and variance from a sum of weights, and of these times places and their squares (as centroid.moments). */
static void moments(double total, double first, double second, double *mean, double *variance) {
    double least = (double)1e-6f;
    *mean = first / (total + least);
    *variance = larger(second / (total + least) - *mean * *mean, least);
}

/* Sums of eight columns' weights, and of these times line and line squared: whole numbers, and so exact. */
INLINE void sum_columns(const Sheet *sheet, int64_t first, float background, Lanes sum[3], Lanes *most) {
    const WholeLanes own = columns_from(sheet, first);
    const float *grey = sheet->grey + first;
    for (int64_t line = 0; line < sheet->lines; line++, grey += sheet->columns) {
        Lanes height = only(own, greater(lanes_at(grey), all(background)) - background), weight = height * height;
        *most = greater(*most, height);
        sum[0] += weight, sum[1] += (float)line * weight, sum[2] += (float)(line * line) * weight;
    }
}

WIDE void start_of(const Sheet *sheet, double spread_px, float disc[NUMBERS]) {
    float background = background_of(sheet);
    double total = 0, x = 0, y = 0, xx = 0, yy = 0, one;
    Lanes most = {0};
    for (int64_t first = 0; first < sheet->columns; first += EIGHT) {
        Lanes sum[3] = {{0}};
        sum_columns(sheet, first, background, sum, &most);
        for (int lane = 0; lane < EIGHT; lane++) {
            double place = (double)(first + lane);
            one = (double)sum[0][lane];
            total += one, x += one * place, xx += one * (place * place);
            y += (double)sum[1][lane], yy += (double)sum[2][lane];
        }
    }
    moments(total, x, xx, &x, &xx);
    double apart = (double)sheet->apart;
    moments(total, apart * y, apart * apart * yy, &y, &yy);
    disc[X] = (float)x, disc[HALF_WIDTH] = (float)(2.0 * sqrt(xx));
    disc[Y] = (float)y, disc[HALF_HEIGHT] = (float)(2.0 * sqrt(yy));
    disc[BACKGROUND] = background, disc[CONTRAST] = greatest_of(most);
    disc[LEAN] = 0.0f, disc[BLURRING] = (float)(spread_px * spread_px + ROW);
}
