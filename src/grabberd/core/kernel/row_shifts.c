/* Shift of each line from how its rows' middles differ from those of their discs (as row_shifts.py). */
#include "kernel.h"

static const double MIDDLE_PX2 = 1.0 / 24.0, FURTHEST_PX = 0.75;

/* Half lines from the first line on: lines, and what lies between one and the next. */
typedef struct {
    double rows, off; /* how many, and how far off in all; `off` then is the shift */
} HalfLine;

typedef struct {
    double middle;
    int32_t half, length;
} Row;

/* Adds the rows of a disc, upright; a gap between two runs of a row is taken as set. Returns how many there are. */
static int64_t add_rows(const Picture *picture, const Run *run, const Component *own, double lean, int64_t last_half,
                        Row *rows, HalfLine *halves) {
    int64_t count = 0, step = picture->y_step, top = first_row(picture);
    double slope = lean * (double)step, mean = 0;
    for (int32_t i = 0; i < own->count; i++) {
        int32_t first = run[i].first;
        while (i + 1 < own->count && run[i + 1].row == run[i].row) i++;
        double middle = ((double)first + run[i].last) / 2 - slope * (run[i].row - own->row);
        rows[count].middle = middle, mean += middle;
        rows[count].half = (int32_t)within((run[i].row - top) * step, 0, last_half);
        rows[count++].length = run[i].last - first + 1;
    }
    mean /= (double)count;
    for (int64_t k = 0; k < count; k++) {
        HalfLine *half = halves + rows[k].half;
        half->rows += 1;
        half->off += larger(smaller(rows[k].middle - mean, FURTHEST_PX), -FURTHEST_PX);
    }
    return count;
}

/* Down and up a tridiagonal matrix; `reciprocal` has room for its diagonal. A half line between two has the mean shift.
   Lines with nothing between them do not wait for one another. */
static void solve(HalfLine *halves, int64_t lines, double prior, double *reciprocal) {
    for (int64_t k = 0; k < lines; k++) {
        HalfLine *own = halves + 2 * k, *next = own + 1;
        double diagonal = own->rows + prior + 0.25 * next->rows;
        own->off += 0.5 * next->off;
        if (k && own[-1].rows > 0) {
            double below = 0.25 * own[-1].rows, down = below * reciprocal[k - 1];
            diagonal += below - below * down;
            own->off += 0.5 * own[-1].off - down * own[-2].off;
        }
        reciprocal[k] = 1 / diagonal;
    }
    for (int64_t k = lines - 1; k >= 0; k--) {
        HalfLine *own = halves + 2 * k, *next = own + 1;
        double after = k + 1 < lines ? own[2].off : 0;
        if (next->rows > 0) own->off -= 0.25 * next->rows * after;
        own->off *= reciprocal[k];
        next->off = (own->off + after) / 2;
    }
}

static double moved(const Row *rows, int64_t count, const HalfLine *halves) {
    double sum = 0;
    int64_t length = 0;
    for (int64_t k = 0; k < count; k++) sum += rows[k].length * halves[rows[k].half].off, length += rows[k].length;
    return sum / (double)length;
}

/* Of the components that are discs, all of which have rows. */
static void shift_back(const Picture *picture, double jitter_px, const Seen *seen, const Size *sizes, const bool *discs,
                       HalfLine *halves, Row *rows, double *reciprocal, Place *places) {
    int64_t lines = picture->rows * picture->y_step / 2;
    Row *next = rows;
    for (int64_t i = 0; i < seen->component_count; i++) {
        const Component *own = seen->components + i;
        if (discs[i]) next += add_rows(picture, seen->runs + own->begin, own, sizes[i].lean, 2 * lines - 2, next, halves);
    }
    solve(halves, lines, MIDDLE_PX2 / (jitter_px * jitter_px), reciprocal);
    for (int64_t i = 0; i < seen->component_count; i++) {
        if (!discs[i]) continue;
        int64_t count = seen->components[i].last_row - seen->components[i].first_row + 1;
        places[i].x -= moved(rows, count, halves);
        rows += count;
    }
}

int take_row_shifts(const Picture *picture, double jitter_px, const Seen *seen, const Size *sizes, const bool *discs,
                    Place *places) {
    int64_t lines = picture->rows * picture->y_step / 2;
    if (lines < 1) return DONE;
    HalfLine *halves = calloc((size_t)(2 * lines), sizeof *halves);
    Row *rows = malloc((size_t)seen->run_count * sizeof *rows);
    double *reciprocal = malloc((size_t)lines * sizeof *reciprocal);
    bool is_room = halves && rows && reciprocal;
    if (is_room) shift_back(picture, jitter_px, seen, sizes, discs, halves, rows, reciprocal, places);
    free(halves);
    free(rows);
    free(reciprocal);
    return is_room ? DONE : NO_MEMORY;
}
