/* Runs of set pixels in the order of rows and columns. */
#ifndef GRABBERD_RUNS_H
#define GRABBERD_RUNS_H

#include "kernel.h"

/* Runs as they are found, with room for more; `parent`: of every number that a run was given at first, the smaller one it
   was found to be connected with. */
typedef struct {
    Run *runs;
    int32_t *parent;
    int64_t count, room, numbers, components;
} FoundRuns;

/* With a status of NO_MEMORY as well, what was found has to be freed. */
int find_runs(const Picture *, FoundRuns *);

#endif
