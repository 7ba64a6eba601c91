/* Functions that the module exports. */
#ifndef GRABBERD_MODULE_H
#define GRABBERD_MODULE_H

#include "engine.h"
#include "grey.h"
#include "kernel.h"
#include "space.h"

int grabberd_locate(const Picture *, const Settings *, double *out, int64_t capacity, Outcome *);
int grabberd_locate_grey(const GreyPicture *, const GreySettings *, double *out, int64_t capacity, GreyOutcome *);

#endif
