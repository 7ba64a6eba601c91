/* Functions that the module exports. */
#ifndef GRABBERD_MODULE_H
#define GRABBERD_MODULE_H

#include "grey.h"
#include "kernel.h"
#include "space.h"
#include "wall.h"

int grabberd_locate(const Picture *, const Settings *, double *out, int64_t capacity, Outcome *);
int grabberd_locate_grey(const GreyPicture *, const GreySettings *, double *out, int64_t capacity, GreyOutcome *);
int64_t whole_ones(int64_t count, const double *xy_px, const double *sigma_px, const double *common_px, const double *width_px,
                   const bool *at_border, const double edges[2], double *out);

#endif
