/* What the module offers of the rooms' functions. */
#ifndef GRABBERD_MODULE_H
#define GRABBERD_MODULE_H

#include "kernel.h"
#include "space.h"

int grabberd_locate(const Picture *, const Settings *, double *out, int64_t capacity, Outcome *);

#endif
