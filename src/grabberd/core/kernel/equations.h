/* Normal equations in the shifts of a field's lines, and what ties them to the leans of discs. */
#ifndef GRABBERD_EQUATIONS_H
#define GRABBERD_EQUATIONS_H

#include "grey.h"
#include "leans.h"

/* Most discs have so many lines: with their number known, loops over the lines of one need no counting. */
#define BY_HEIGHT(height, call)       \
    switch (height) {                 \
        case 4: call(4); break;       \
        case 5: call(5); break;       \
        case 6: call(6); break;       \
        default: call(height); break; \
    }

/* The normal equations in the shifts of those lines that touch a blob; what they are made from and solved in. */
typedef struct {
    const Chords *chords;
    int64_t *at;                          /* (count, height): the equation of each chord */
    double *beside, *tilt_x, *tilt_lean;  /* likewise: Δy, and what gives x and lean from the chords' middles */
    double *weight, *centre, *residual;   /* likewise; weights as they are trusted, middles from the surest one's */
    double *right, *shift, *scratch;      /* (equations,); `scratch` also (count,) */
    double *column, *lean, *smooth;       /* (count,): where blobs are, their leans, and those of discs at such places */
    Terms *terms;                         /* (count,): of these, by their places */
    Leans leans;
    Band band, lower, inverse;
} System;

bool make_system(const Chords *, int64_t lines, System *, void **memory);
/* Of chords as they are; none has been trusted less yet. */
void begin(int64_t lines, System *);
/* With this σ of the leans; and with the leans by place, as far as there are any. */
void set_up(System *, double lean);
void tie_leans(System *);

/* x and lean that the middles of a blob's chords give. */
INLINE void straight_line(const System *system, int64_t from, int64_t height, const double *centre, double *x, double *lean) {
    *x = *lean = 0;
    for (int64_t k = 0; k < height; k++)
        *x += system->tilt_x[from + k] * centre[k], *lean += system->tilt_lean[from + k] * centre[k];
}

#endif
