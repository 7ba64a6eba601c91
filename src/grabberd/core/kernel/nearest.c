/* Assignment of blobs to targets (as correspondence.Prediction.nearest), searched only where they may be. */
#include "space.h"

/* Blobs by cells of a grid over the places where there are any. */
typedef struct {
    double x0, y0, per_cell; /* cells a pixel */
    int64_t columns, rows;
    int32_t *begin, *blob;
} Cells;

static int64_t cell_along(double place, double from, double per_cell, int64_t cells) {
    double cell = (place - from) * per_cell;
    if (!(cell > 0)) return 0;
    return cell < (double)cells ? (int64_t)cell : cells - 1;
}

static int sort_into_cells(const ViewBlobs *blobs, Cells *cells) {
    double x1 = -INFINITY, y1 = -INFINITY;
    cells->x0 = cells->y0 = INFINITY;
    for (int64_t i = 0; i < blobs->count; i++) {
        const double *xy = blobs->xy_px + 2 * i;
        cells->x0 = smaller(cells->x0, xy[0]), x1 = larger(x1, xy[0]);
        cells->y0 = smaller(cells->y0, xy[1]), y1 = larger(y1, xy[1]);
    }
    double width = larger(x1 - cells->x0, 1.0), height = larger(y1 - cells->y0, 1.0);
    cells->per_cell = sqrt((double)blobs->count / (width * height));
    if (!(cells->per_cell > 0 && cells->per_cell < 1e6)) return REFUSED;
    cells->columns = (int64_t)smaller(width * cells->per_cell, (double)blobs->count) + 1;
    cells->rows = (int64_t)smaller(height * cells->per_cell, (double)blobs->count) + 1;
    int64_t count = cells->columns * cells->rows;
    cells->begin = calloc((size_t)count + 2, sizeof *cells->begin);
    cells->blob = malloc((size_t)blobs->count * sizeof *cells->blob);
    int32_t *own = malloc((size_t)blobs->count * sizeof *own);
    int status = cells->begin && cells->blob && own ? DONE : NO_MEMORY;
    for (int64_t i = 0; i < blobs->count && status == DONE; i++) {
        const double *xy = blobs->xy_px + 2 * i;
        own[i] = (int32_t)(cell_along(xy[1], cells->y0, cells->per_cell, cells->rows) * cells->columns +
                           cell_along(xy[0], cells->x0, cells->per_cell, cells->columns));
        cells->begin[own[i] + 2]++;
    }
    for (int64_t i = 2; i < count + 2 && status == DONE; i++) cells->begin[i] += cells->begin[i - 1];
    for (int64_t i = 0; i < blobs->count && status == DONE; i++) cells->blob[cells->begin[own[i] + 1]++] = (int32_t)i;
    free(own);
    return status;
}

/* The nearest blob of a target, and of each blob the nearest target so far; near in units of the reach. */
static int64_t look_around(const Cells *cells, const ViewBlobs *blobs, const double at[2], const double reach[2],
                           int64_t target, double *least, int32_t *of) {
    int64_t found = -1;
    double best = INFINITY, slow = 1.0 / reach[0], steep = 1.0 / reach[1];
    int64_t left = cell_along(at[0] - reach[0] * 1.000001, cells->x0, cells->per_cell, cells->columns);
    int64_t right = cell_along(at[0] + reach[0] * 1.000001, cells->x0, cells->per_cell, cells->columns);
    int64_t top = cell_along(at[1] - reach[1] * 1.000001, cells->y0, cells->per_cell, cells->rows);
    int64_t bottom = cell_along(at[1] + reach[1] * 1.000001, cells->y0, cells->per_cell, cells->rows);
    for (int64_t row = top; row <= bottom; row++)
        for (int32_t k = cells->begin[row * cells->columns + left]; k < cells->begin[row * cells->columns + right + 1]; k++) {
            int32_t blob = cells->blob[k];
            double x = (blobs->xy_px[2 * blob] - at[0]) * slow, y = (blobs->xy_px[2 * blob + 1] - at[1]) * steep;
            double away = x * x + y * y;
            if (!(away <= 1.0)) continue;
            if (away < best || (away == best && blob < found)) best = away, found = blob;
            if (away < least[blob]) least[blob] = away, of[blob] = (int32_t)target;
        }
    return found;
}

/* Of the targets that a view may show; merged ones, too, keep others from their blobs. */
int nearest(int64_t targets, const double *image_px, const double *reach_px, const int64_t *unseen, const ViewBlobs *blobs, int64_t *blob) {
    for (int64_t i = 0; i < targets; i++) blob[i] = NO_BLOB_NEAR;
    if (!blobs->count) return DONE;
    Cells cells = {0};
    double *least = malloc((size_t)blobs->count * sizeof *least);
    int32_t *of = malloc((size_t)blobs->count * sizeof *of);
    int status = least && of ? sort_into_cells(blobs, &cells) : NO_MEMORY;
    for (int64_t i = 0; i < blobs->count && status == DONE; i++) least[i] = INFINITY, of[i] = -1;
    for (int64_t i = 0; i < targets && status == DONE; i++) {
        if (unseen[i] == TURNED_AWAY || unseen[i] == HIDDEN || !isfinite(image_px[2 * i]) || !isfinite(image_px[2 * i + 1])) continue;
        blob[i] = look_around(&cells, blobs, image_px + 2 * i, reach_px + 2 * i, i, least, of);
    }
    for (int64_t i = 0; i < targets && status == DONE; i++)
        if (blob[i] >= 0 && of[blob[i]] != i) blob[i] = BLOB_TAKEN;
    free(cells.begin);
    free(cells.blob);
    free(least);
    free(of);
    return status;
}
