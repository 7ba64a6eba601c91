/* What locale decoding has of blobs before it weighs places. */
#ifndef GRABBERD_PATTERNS_H
#define GRABBERD_PATTERNS_H

#include "kernel.h"

enum { REACH_X = 4 };
#define REACH_Y(y_step) ((y_step) == 1 ? 4 : 6)

/* What blobs have to share in order to share a table: half axes in steps of .5 and .25 px. */
typedef struct {
    int32_t wide, high;
    int64_t blobs, begin; /* how many, and where in the order */
    const Table *table;
} Kind;

typedef struct {
    Kind *kinds;
    int64_t count, first, blobs, mask; /* `first`: the most frequent; `blobs`: of all kinds */
    int32_t *slots, *of, *order;       /* `of`: every component's kind, −1 where it has none; `order`: by kinds */
} Kinds;

/* The place of the fine grid next to a blob's centroid, in its steps, and how the blob is stretched. */
typedef struct {
    double middle_x, middle_y, wider, higher;
} Pattern;

int threshold_fraction(const Picture *, const Settings *, const Seen *, const Size *, double *, Outcome *);
int kinds_of(const Seen *, const Size *, Kinds *);
void free_kinds(Kinds *);
enum { ANY_NOISE = -1 };

/* Looks up a kind's table, for one of the noises or for all of them. */
int find_table(const Settings *, double fraction, int noise, Kind *, Outcome *);
void pattern_of(const Picture *, const Component *, const Size *, const Kind *, Pattern *);
/* Where in a table a blob is looked up: above, below, and its rows' starts and ends; 2 + 2 · rows at most. */
int64_t entries_of(const Picture *, const Run *, const Component *, const Size *, const Pattern *, const Table *,
                   int64_t *entry);

#endif
