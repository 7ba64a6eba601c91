/* The likelihoods of the places round a blob's centroid, and what they say of it. */
#ifndef GRABBERD_LIKELIHOOD_H
#define GRABBERD_LIKELIHOOD_H

#include "patterns.h"

enum { WIDTH = 2 * REACH_X + 1, HEIGHT = 2 * REACH_Y(2) + 1 };

/* Sums of the places' weights by columns, from the right, and by rows, from below; and how likely the greatest is. */
typedef struct {
    float along[WIDTH], down[HEIGHT], greatest;
} Weighed;

/* In steps of 1/10 column and 1/8 frame line. */
typedef struct {
    double x, y, variance_x, variance_y, evidence;
} Posterior;

/* Of the table's noise with these values; `height` places high, which the entries leave room for. */
Weighed weigh(const float *values, int64_t rows, const int64_t *entry, int64_t entries, int height);
double evidence_of(const Weighed *);
Posterior posterior_of(const Weighed *, int height);

#endif
