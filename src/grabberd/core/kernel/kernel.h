/* Declarations shared by the kernel's files. Plain C11: arrays in, arrays out; no global state, no Python, no files.

   Every function does what the numpy one of the same room does, in the same order where the order of sums
   matters. Status codes are told to the caller, who looks up what is missing and asks again. */
#ifndef GRABBERD_KERNEL_H
#define GRABBERD_KERNEL_H

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(GRABBERD_PLAIN)
#define WIDE __attribute__((target_clones("avx2", "default")))
#else
#define WIDE
#endif
#if defined(__GNUC__)
#define INLINE static inline __attribute__((always_inline))
#define EXPORT __attribute__((visibility("default")))
#else
#define INLINE static inline
#define EXPORT
#endif
#define PI 3.141592653589793

enum status { DONE = 0, NO_MEMORY = 1, REFUSED = 2, MORE_ROOM = 3, NO_TABLE = 4, NO_FULLNESS = 5, UNSOUND = 6 };

/* A packed bit picture: eight pixels a byte, the leftmost in its highest bit. */
typedef struct {
    const uint8_t *bits;
    int64_t length; /* of `bits`, bytes */
    int64_t rows, stride, columns, parity, y0, y_step;
} Picture;

typedef struct {
    int32_t row, first, last, label;
} Run;

/* Second moments about the centroid, frame pixels, and how many pixels they are of: those of delivered rows. */
typedef struct {
    double pixels, xx, yy, xy;
} Moments;

/* A connected component; its runs stand together, ordered by row and column. */
typedef struct {
    int64_t pixels;
    int32_t first_row, last_row, first_column, last_column;
    int32_t begin, count;
    double x, row; /* centroid, columns and rows */
    double area_px;
    double row_squares, row_products; /* of its rows' lengths, and of neighbours' */
    Moments moments;
    bool of_size, low, whole, at_border;
} Component;

typedef struct {
    Run *runs;
    Component *components;
    int64_t run_count, component_count;
} Seen;

/* Half axes and lean of the targets round a component, and the pixels of its delivered rows. */
typedef struct {
    double half_width_px, half_height_px, lean, delivered;
} Size;

enum { NOISES = 3 };

/* As `locale_table.Table`, of one size and threshold: windows into fine grids, one for each noise, or NULL. */
typedef struct {
    const float *values[NOISES];
    int64_t length; /* of each, floats */
    int64_t columns, rows;
    int32_t wide, high; /* half axes in steps of `rounded` */
    double fraction;
} Table;

typedef struct {
    double half_width_px, half_height_px; /* in steps */
    double ratio[4];
} Fullness;

/* Inputs of location other than the picture. */
typedef struct {
    double min_diameter_px, max_diameter_px, line_jitter_px;
    int64_t locale; /* 0: centroids alone */
    int64_t shifts_taken; /* 0: places as the rows have them */
    const Table *tables;
    int64_t table_count;
    const Fullness *fullness;
    int64_t fullness_count;
} Settings;

/* What came of it: of `count` blobs; or what is missing. */
typedef struct {
    int64_t count;
    double common_reach_px;
    double missing[4];
} Outcome;

typedef struct {
    double x, row, sigma_x, sigma_y; /* place in columns and rows, σ in frame pixels */
} Place;

int find_components(const Picture *, const Settings *, Seen *);
void free_components(Seen *);
int sizes_of(const Picture *, const Seen *, Size *);
/* `discs`: whole components that may be targets; those that no target explains are dropped. */
int locate_by_locale(const Picture *, const Settings *, const Seen *, const Size *, bool *discs, Place *, Outcome *);
int take_row_shifts(const Picture *, double jitter_px, const Seen *, const Size *, const bool *discs, Place *places);
int line_shares(const Picture *, const Settings *, const Seen *, double *common_px, double *reach_px);
double median_of(double *values, int64_t count); /* of one at least; reorders them */
double ranked(double *values, int64_t count, int64_t rank); /* the one with so many before it; likewise */
void write_blob(const Component *, const Place *, double common_px, double y0, double y_step, double *out, int64_t capacity, int64_t k);

enum { PROGRESSIVE = 2 }; /* in place of a parity: every row was delivered */

/* True if every other row has been interpolated. */
INLINE bool is_doubled(const Picture *picture) { return picture->y_step == 1 && picture->parity != PROGRESSIVE; }
INLINE bool is_delivered(const Picture *picture, int32_t row) {
    return !is_doubled(picture) || (row & 1) == picture->parity;
}
/* Row of the first line that the camera delivered. */
INLINE int64_t first_row(const Picture *picture) { return is_doubled(picture) ? picture->parity : 0; }
/* As rint of what is below 2^51, without a call into the library. */
INLINE double rounded(double value) {
    const double whole = 6755399441055744.0;
    return (value + whole) - whole;
}
INLINE double larger(double one, double other) { return one > other ? one : other; }
INLINE double smaller(double one, double other) { return one < other ? one : other; }
INLINE int64_t at_most(int64_t value, int64_t most) { return value < most ? value : most; }
INLINE int64_t at_least(int64_t value, int64_t least) { return value > least ? value : least; }
INLINE int64_t within(int64_t value, int64_t least, int64_t most) {
    return value < least ? least : at_most(value, most);
}

#endif
