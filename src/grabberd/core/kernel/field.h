/* A field as a driver delivers it: its rows packed, and looked at for damage. */
#ifndef GRABBERD_FIELD_H
#define GRABBERD_FIELD_H

#include "kernel.h"

enum { WORD = 8, BLOCK_ROWS = 12, BIN_COLUMNS = 4, REMEMBERED = 64, LEARNED = 8, LONGEST_SIDE = 1 << 13 };
enum made_up { PICTURE = 0, FLAT = 1, BARS = 2, SNOW = 3 };

/* Grey values as they lie in a buffer; strides are in bytes and may have any sign. */
typedef struct {
    const uint8_t *luma;
    int64_t rows, columns, row_stride, column_stride;
} Lines;

/* How a field is packed; `map` has a threshold for each pixel of the packed rows, or is NULL. */
typedef struct {
    long long bits, doubled, smoothed, parity, threshold;
    const uint8_t *map;
    uint8_t *out;
} Packing;

/* Room for some rows in the stages of their way. */
typedef struct {
    uint8_t *memory, *line[2], *smooth[2], *between, *set;
    uint64_t *planes;
    const uint8_t *before;
} Stages;

/* The copy of a field, and what is remembered of its stream (as content_check.StaleRows). */
typedef struct {
    uint64_t *words;      /* (rows, words in a row), filled up with zeros */
    const uint64_t *good; /* the last good field of the same parity, or NULL */
    const uint64_t *weights;
    uint64_t *seen;         /* (REMEMBERED, rows) */
    const int64_t *learned; /* (LEARNED, rows) */
    uint64_t *hashes;       /* (rows,) */
    int64_t *differing;     /* (rows,) */
    int16_t *means;         /* (rows / BLOCK_ROWS, columns / BIN_COLUMNS) */
    int64_t place;          /* of this field among those remembered */
} Look;

/* Numbers for each row or column of a field, while it is looked at. */
typedef struct {
    int64_t *contrast;
    uint64_t *old; /* 1 where the row is remembered */
    uint16_t *column_sums;
} Notes;

typedef struct {
    int64_t made_up, first, last; /* the first and last stale row, or −1 */
} Findings;

/* Means of a field's blocks, (blocks, bins), from 0 to 255. */
typedef struct {
    const int16_t *means;
    int64_t blocks, bins;
} Profiles;

/* The first shifted block, or −1, and by how many bins. */
typedef struct {
    int64_t block, bins;
} Coarse;

int pack_field(const Lines *, const Packing *);
int take_field(const Lines *, const Packing *, const Look *, Findings *);

bool make_stages(Stages *, int64_t columns);
void copy_line(const Lines *, int64_t row, uint8_t *to);
void pack_line(const Lines *, const Packing *, Stages *, int64_t row, const uint8_t *line);
void look_at_line(const Lines *, const Look *, Notes *, int64_t row);
Findings conclude(const Lines *, const Look *, Notes *);
Coarse coarse_shift(const Profiles *now, const Profiles *then);

INLINE int64_t words_of(int64_t columns) { return (columns + WORD - 1) / WORD; }
INLINE int64_t packed_rows(const Lines *lines, const Packing *packing) { return (packing->doubled ? 2 : 1) * lines->rows; }

#endif
