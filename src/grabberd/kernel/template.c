/* One Gauss–Newton step from the moments to the image of a disc, and chords against that (as template.py, disc_image.py). */
#include "grey.h"
#include "lanes.h"

/* What describes a disc's picture, the places last; and what the fit leaves. */
enum { CONTRAST, BACKGROUND, HALF_WIDTH, HALF_HEIGHT, LEAN, BLURRING, X, Y, NUMBERS, REST = NUMBERS, ROWS };
static const double LONGEST_STEP[NUMBERS] = {INFINITY, INFINITY, 0.7, 0.7, 0.3, 0.3, 1.5, 1.5};
static const double PRIOR_SIGMA[NUMBERS] = {255.0, 255.0, 1.0, 1.0, 0.1, 0.3, 3.0, 3.0};
static const double PIXEL = 1.0 / 12.0, ROW = 0.2, LEAST = 1e-6, VAGUEST = 4.0;
static const float SMALLEST_PX = 0.4f;

enum { ABREAST = 4 };
typedef double Quad __attribute__((vector_size(32)));
typedef uint64_t Pairs __attribute__((vector_size(32)));

/* A window's pixels, in eights (padded with black, and eight more may be read): places, grey values, and the rows of the design with what is left below them. */
typedef struct {
    int64_t lines, columns, pixels, padded;
    float *x, *y, *grey, *design; /* the last: (ROWS, padded) */
} Sheet;

/* The middle one of the window's grey values, whole numbers below 256: more than half of it is no target. */
WIDE static float background_of(const Sheet *sheet) {
    int64_t wanted = sheet->pixels / 2 + 1 + sheet->padded - sheet->pixels;
    float value = -1.0f;
    for (float step = 128.0f; step >= 1.0f; step /= 2) {
        WholeLanes below = {0};
        for (int64_t i = 0; i < sheet->padded; i += EIGHT) below -= lanes_at(sheet->grey + i) <= value + step;
        int64_t count = 0;
        for (int lane = 0; lane < EIGHT; lane++) count += below[lane];
        if (count < wanted) value += step;
    }
    return value + 1.0f;
}

/* Mean and variance from a sum of weights, and of these times places and their squares (as weighted.moments). */
static void moments(double total, double first, double second, double *mean, double *variance) {
    double least = (double)1e-6f;
    *mean = first / (total + least);
    *variance = larger(second / (total + least) - *mean * *mean, least);
}

/* Which of the eight columns from this one on the window has. */
INLINE WholeLanes columns_from(const Sheet *sheet, int64_t first) {
    const WholeLanes each = {0, 1, 2, 3, 4, 5, 6, 7};
    return each < (int32_t)at_most(sheet->columns - first, EIGHT);
}

INLINE Lanes those(WholeLanes which, Lanes lanes) { return (Lanes)(which & (WholeLanes)lanes); }

/* Sums of eight columns' weights, and of these times line and line squared: whole numbers, and so exact. */
INLINE void sum_columns(const Sheet *sheet, int64_t first, float background, Lanes sum[3], Lanes *most) {
    const WholeLanes own = columns_from(sheet, first);
    const float *grey = sheet->grey + first;
    for (int64_t line = 0; line < sheet->lines; line++, grey += sheet->columns) {
        Lanes height = those(own, greater(lanes_at(grey), all(background)) - background), weight = height * height;
        *most = greater(*most, height);
        sum[0] += weight, sum[1] += (float)line * weight, sum[2] += (float)(line * line) * weight;
    }
}

/* From the moments of the grey values' squares. */
WIDE static void start_of(const Sheet *sheet, double spread_px, float disc[NUMBERS]) {
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
    moments(total, LINES_APART * y, LINES_APART * LINES_APART * yy, &y, &yy);
    disc[X] = (float)x, disc[HALF_WIDTH] = (float)(2.0 * sqrt(xx));
    disc[Y] = (float)y, disc[HALF_HEIGHT] = (float)(2.0 * sqrt(yy));
    disc[BACKGROUND] = background, disc[CONTRAST] = greatest_of(most);
    disc[LEAN] = 0.0f, disc[BLURRING] = (float)(spread_px * spread_px + ROW);
}

INLINE Lanes root_of(Lanes value) {
    float one[EIGHT];
    memcpy(one, &value, sizeof one);
    for (int i = 0; i < EIGHT; i++) one[i] = sqrtf(one[i]);
    memcpy(&value, one, sizeof one);
    return value;
}

/* Profile of an edge and its slope at a distance in σ. */
INLINE void look_up(const GreySettings *settings, Lanes distance, Lanes *inside, Lanes *density) {
    Lanes entry = (distance + 5.0f) * 512.0f + 0.5f;
    entry = choose(entry > 0.0f, entry, all(0.0f));
    entry = choose(entry < EDGE_VALUES - 1.0f, entry, all(EDGE_VALUES - 1.0f));
    WholeLanes at = __builtin_convertvector(entry, WholeLanes);
    Pairs left = {settings->edge[at[0]], settings->edge[at[1]], settings->edge[at[2]], settings->edge[at[3]]};
    Pairs right = {settings->edge[at[4]], settings->edge[at[5]], settings->edge[at[6]], settings->edge[at[7]]};
    const Lanes whole = __builtin_convertvector(at, Lanes), z = whole * (1.0f / 512.0f) - 5.0f;
    Lanes beyond = (entry - whole - 0.5f) * (1.0f / 512.0f), steep = PICK((Lanes)left, (Lanes)right, 1, 3, 5, 7, 9, 11, 13, 15);
    *inside = PICK((Lanes)left, (Lanes)right, 0, 2, 4, 6, 8, 10, 12, 14) - steep * beyond * (1.0f - 0.5f * z * beyond);
    *density = steep * (1.0f - z * beyond);
}

/* What the slopes at eight pixels are made of. */
typedef struct {
    Lanes v, u, down, across, along, sharp, distance, edge, inside;
} Edge;

/* Of some eights at once, step by step: each one's steps wait for one another. */
INLINE void edges_of(const float disc[NUMBERS], float blurring_x, const GreySettings *settings, const Sheet *sheet, int64_t first, int count,
                     Edge *edge) {
    const float narrow = 1.0f / disc[HALF_WIDTH], low = 1.0f / disc[HALF_HEIGHT];
    Lanes radius2[count], root[count], spread[count], density[count];
    for (int i = 0; i < count; i++) {
        edge[i].v = lanes_at(sheet->y + first + i * EIGHT) - disc[Y];
        edge[i].u = (lanes_at(sheet->x + first + i * EIGHT) - disc[X] - disc[LEAN] * edge[i].v) * narrow;
    }
    for (int i = 0; i < count; i++) edge[i].down = edge[i].v * low, edge[i].across = edge[i].u * narrow;
    for (int i = 0; i < count; i++) radius2[i] = edge[i].u * edge[i].u + edge[i].down * edge[i].down + 1e-6f;
    for (int i = 0; i < count; i++) edge[i].along = edge[i].down * low - disc[LEAN] * edge[i].u * narrow;
    for (int i = 0; i < count; i++)
        spread[i] = blurring_x * (edge[i].across * edge[i].across) + disc[BLURRING] * (edge[i].along * edge[i].along) + 1e-6f;
    for (int i = 0; i < count; i++) spread[i] = root_of(spread[i]), root[i] = root_of(radius2[i]);
    for (int i = 0; i < count; i++) edge[i].sharp = 1.0f / spread[i];
    for (int i = 0; i < count; i++) edge[i].distance = (radius2[i] - root[i]) * edge[i].sharp;
    for (int i = 0; i < count; i++) look_up(settings, edge[i].distance, &edge[i].inside, density + i);
    for (int i = 0; i < count; i++) edge[i].edge = disc[CONTRAST] * density[i] * edge[i].sharp;
}

INLINE void write_eight(float *design, int64_t padded, int row, Lanes values) { memcpy(design + row * padded, &values, sizeof values); }

/* What is left of eight pixels' grey values, and their slopes by the place along x; or by all eight numbers. */
INLINE void write_slopes(const float disc[NUMBERS], const Edge *edge, Lanes grey, bool all_of_them, float *design, int64_t padded) {
    const float low = 1.0f / disc[HALF_HEIGHT];
    Lanes by_x = edge->edge * edge->across;
    write_eight(design, padded, X, by_x);
    write_eight(design, padded, REST, grey - (disc[BACKGROUND] + disc[CONTRAST] * edge->inside));
    if (!all_of_them) return;
    write_eight(design, padded, CONTRAST, edge->inside);
    write_eight(design, padded, BACKGROUND, all(1.0f));
    write_eight(design, padded, HALF_WIDTH, edge->edge * edge->u * edge->across);
    write_eight(design, padded, HALF_HEIGHT, edge->edge * edge->down * edge->down * low);
    write_eight(design, padded, BLURRING, 0.5f * edge->edge * edge->sharp * edge->distance * (edge->along * edge->along));
    write_eight(design, padded, Y, edge->edge * edge->along);
    write_eight(design, padded, LEAN, by_x * edge->v);
}

INLINE void picture_of(const float *restrict disc, float blurring_x, const GreySettings *settings, bool all_of_them, Sheet *sheet) {
    enum { SEVERAL = 4 };
    const int64_t padded = sheet->padded;
    Edge edge[SEVERAL];
    int64_t first = 0;
    for (; first + SEVERAL * EIGHT <= padded; first += SEVERAL * EIGHT) {
        edges_of(disc, blurring_x, settings, sheet, first, SEVERAL, edge);
        for (int i = 0; i < SEVERAL; i++)
            write_slopes(disc, edge + i, lanes_at(sheet->grey + first + i * EIGHT), all_of_them, sheet->design + first + i * EIGHT, padded);
    }
    for (; first < padded; first += EIGHT) {
        edges_of(disc, blurring_x, settings, sheet, first, 1, edge);
        write_slopes(disc, edge, lanes_at(sheet->grey + first), all_of_them, sheet->design + first, padded);
    }
    for (int k = 0; k < ROWS; k++)
        for (int64_t i = sheet->pixels; i < padded; i++) sheet->design[k * padded + i] = 0.0f;
}

WIDE static void picture_disc(const float *disc, float blurring_x, const GreySettings *settings, Sheet *sheet) {
    picture_of(disc, blurring_x, settings, true, sheet);
}

/* As much of it as chords are cut from. */
WIDE static void picture_chords(const float *disc, float blurring_x, const GreySettings *settings, Sheet *sheet) {
    picture_of(disc, blurring_x, settings, false, sheet);
}

/* Sums of products of three rows with three. */
INLINE void nine_products(const float *one, const float *other, int64_t padded, int lane, Quad *sums) {
    Lanes sum[3][3] = {{{0}}};
    for (int64_t i = 0; i < padded; i += EIGHT, one += EIGHT, other += EIGHT) {
        Lanes left[3] = {lanes_at(one), lanes_at(one + padded), lanes_at(one + 2 * padded)};
        Lanes right[3] = {lanes_at(other), lanes_at(other + padded), lanes_at(other + 2 * padded)};
        for (int a = 0; a < 3; a++)
            for (int b = 0; b < 3; b++) sum[a][b] += left[a] * right[b];
    }
    for (int a = 0; a < 3; a++)
        for (int b = 0; b < 3; b++) sums[ROWS * a + b][lane] = (double)sum_of(sum[a][b]);
}

/* The upper triangle of the normal matrix, its right side in the last column. */
WIDE static void products_of(const Sheet *sheet, int lane, Quad normal[ROWS][ROWS]) {
    for (int a = 0; a < ROWS; a += 3)
        for (int b = a; b < ROWS; b += 3)
            nine_products(sheet->design + a * sheet->padded, sheet->design + b * sheet->padded, sheet->padded, lane, &normal[a][b]);
}

/* The steps of four discs at once, and the variances of x and y for noise 1: these are the last, and so cheap. */
WIDE static void solve(Quad normal[NUMBERS][ROWS], Quad step[NUMBERS], Quad *variance_x, Quad *variance_y) {
    Quad inverse[NUMBERS], lower[NUMBERS][NUMBERS], scaled[NUMBERS];
    for (int i = 0; i < NUMBERS; i++) {
        Quad pivot = normal[i][i];
        step[i] = normal[i][REST];
        for (int k = 0; k < i; k++) {
            Quad sum = normal[k][i];
            for (int m = 0; m < k; m++) sum -= scaled[m] * lower[k][m];
            scaled[k] = sum, lower[i][k] = sum * inverse[k];
            pivot -= sum * lower[i][k];
            step[i] -= lower[i][k] * step[k];
        }
        inverse[i] = 1.0 / pivot;
    }
    for (int i = NUMBERS - 1; i >= 0; i--) {
        step[i] *= inverse[i];
        for (int m = i + 1; m < NUMBERS; m++) step[i] -= lower[m][i] * step[m];
    }
    *variance_y = inverse[Y];
    *variance_x = inverse[X] + lower[Y][X] * lower[Y][X] * inverse[Y];
}

/* The disc after a step. */
static void improve(const double step[NUMBERS], float disc[NUMBERS]) {
    for (int k = 0; k < NUMBERS; k++) disc[k] += (float)smaller(larger(step[k], -LONGEST_STEP[k]), LONGEST_STEP[k]);
    for (int k = HALF_WIDTH; k <= HALF_HEIGHT; k++) disc[k] = disc[k] > SMALLEST_PX ? disc[k] : SMALLEST_PX;
}

/* Each line's own shift against the disc (as template._chords). */
WIDE static void cut(const Sheet *sheet, const float disc[NUMBERS], double noise, int64_t column, double *centre, double *weight, double *share) {
    const float *slope = sheet->design + X * sheet->padded, *rest = sheet->design + REST * sheet->padded;
    double all_of_them = 0;
    for (int64_t line = 0; line < sheet->lines; line++, slope += sheet->columns, rest += sheet->columns) {
        Lanes squares = {0}, products = {0};
        for (int64_t first = 0; first < sheet->columns; first += EIGHT) {
            Lanes own = those(columns_from(sheet, first), lanes_at(slope + first));
            squares += own * own, products += own * lanes_at(rest + first);
        }
        double own = (double)sum_of(squares), along = (double)(disc[X] + disc[LEAN] * ((float)(LINES_APART * line) - disc[Y]));
        centre[line] = (double)column + (along + (double)sum_of(products) / larger(own, LEAST));
        weight[line] = own / (noise * noise) > VAGUEST ? own / (noise * noise) : 0;
        share[line] = own;
        all_of_them += own;
    }
    for (int64_t line = 0; line < sheet->lines; line++) share[line] /= larger(all_of_them, LEAST);
}

/* Four of them, side by side. */
static bool make_sheets(const Windows *windows, Sheet sheets[ABREAST]) {
    int64_t pixels = windows->lines * windows->columns, padded = (pixels + EIGHT - 1) / EIGHT * EIGHT;
    float *from = calloc((size_t)((2 + ABREAST * (1 + ROWS)) * padded + EIGHT), sizeof *from);
    if (!from) return false;
    for (int k = 0; k < ABREAST; k++) {
        float *own = from + (2 + k * (1 + ROWS)) * padded;
        sheets[k] = (Sheet){windows->lines, windows->columns, pixels, padded, from, from + padded, own, own + padded};
    }
    for (int64_t i = 0; i < pixels; i++)
        from[i] = (float)(i % windows->columns), from[padded + i] = (float)(LINES_APART * (i / windows->columns));
    return true;
}

static void read_window(const GreyPicture *picture, const Windows *windows, int64_t i, Sheet *sheet) {
    int64_t apart = LINES_APART / picture->y_step, row = windows->line[i] * apart + first_delivered(picture);
    for (int64_t line = 0; line < windows->lines; line++, row += apart)
        greys_of(picture, row, windows->column[i], windows->columns, sheet->grey + line * windows->columns);
}

/* What becomes of the fitted disc of a window. */
static void write_down(const GreyPicture *picture, const Windows *windows, int64_t i, const Sheet *sheet, const float disc[NUMBERS],
                       double noise, Place *places, Chords *chords) {
    int64_t at = i * windows->lines;
    double line = (double)windows->line[i] + (double)disc[Y] / LINES_APART;
    places[i].x = (double)windows->column[i] + (double)disc[X], places[i].row = row_of_line(picture, line);
    cut(sheet, disc, noise, windows->column[i], chords->centre + at, chords->weight + at, chords->share + at);
    chords->line[i] = windows->line[i];
    chords->middle[i] = line_of_row(picture, places[i].row);
}

/* So many discs, four at most, from this one on. */
static void fit_abreast(const GreyPicture *picture, const GreySettings *settings, const Windows *windows, double noise,
                        int64_t first, int count, Sheet sheets[ABREAST], Place *places, Chords *chords) {
    float disc[ABREAST][NUMBERS];
    Quad normal[ROWS][ROWS] = {{{0}}}, steps[NUMBERS], variance_x, variance_y;
    const float blurring_x = (float)(settings->spread_px * settings->spread_px + PIXEL);
    /* One kind of work after the other: what was just written is not read at once in other pieces. */
    for (int k = 0; k < count; k++) read_window(picture, windows, first + k, sheets + k);
    for (int k = 0; k < count; k++) start_of(sheets + k, settings->spread_px, disc[k]);
    for (int k = 0; k < count; k++) picture_disc(disc[k], blurring_x, settings, sheets + k);
    for (int k = 0; k < count; k++) products_of(sheets + k, k, normal);
    for (int k = 0; k < NUMBERS; k++) normal[k][k] += noise / PRIOR_SIGMA[k] * (noise / PRIOR_SIGMA[k]);
    solve(normal, steps, &variance_x, &variance_y);
    for (int k = 0; k < count; k++) {
        double step[NUMBERS];
        for (int i = 0; i < NUMBERS; i++) step[i] = steps[i][k];
        improve(step, disc[k]);
        places[first + k].sigma_x = noise * sqrt(variance_x[k]), places[first + k].sigma_y = noise * sqrt(variance_y[k]);
    }
    for (int k = 0; k < count; k++) picture_chords(disc[k], blurring_x, settings, sheets + k);
    for (int k = 0; k < count; k++) write_down(picture, windows, first + k, sheets + k, disc[k], noise, places, chords);
}

int fit_discs(const GreyPicture *picture, const GreySettings *settings, const Windows *windows, double noise,
              Place *places, Chords *chords) {
    Sheet sheets[ABREAST];
    if (!make_sheets(windows, sheets)) return NO_MEMORY;
    for (int64_t i = 0; i < windows->count; i += ABREAST)
        fit_abreast(picture, settings, windows, noise, i, (int)at_most(ABREAST, windows->count - i), sheets, places, chords);
    free(sheets[0].x);
    return DONE;
}
