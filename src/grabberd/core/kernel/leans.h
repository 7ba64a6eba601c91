/* Leans of discs by their places: unknowns that border the band of the lines' shifts. */
#ifndef GRABBERD_LEANS_H
#define GRABBERD_LEANS_H

#include "band.h"

/* Of a quadratic in a half of the picture, for both halves. */
enum { TERMS = 12 };
typedef double Terms[TERMS];

/* Their part of the normal equations; lower triangles count. */
typedef struct {
    Terms *shifts, *half;    /* (lines,): against the shifts, and L⁻¹ of that */
    Terms own[TERMS], right; /* against each other, prior included */
    Terms root[TERMS], rest; /* the factor of what the shifts leave of them, and its solution downwards */
} Leans;

/* (count,) terms of discs at columns and field lines, zero in a half with few discs; `size`: lines, columns. */
void terms_by_place(const double *column, const double *line, int64_t count, const double size[2], Terms *terms);
/* (count,) leans of discs at such places, given those that were found. */
void smooth_leans(const Terms *terms, const double *lean, int64_t count, double *smooth);
void no_leans(Leans *, int64_t lines);
void add_leans(Leans *, const double *terms, double squares, double right);
/* `solved`: L⁻¹ of the shifts' right side. */
void eliminate_shifts(Leans *, const Band *lower, const double *solved);
/* Takes the leans' part off `solved`. */
void solve_leans(const Leans *, int64_t count, double *solved);
/* How the leans' errors, in units of their σ and independent of one another, move each line's shift: in the place of `half`. */
void spread_of(Leans *, const Band *lower);

#endif
