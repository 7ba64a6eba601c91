/* One field's way from its packed bits to its points, and the track that is carried to the next. */
#ifndef GRABBERD_ENGINE_H
#define GRABBERD_ENGINE_H

#include "grey.h"
#include "tracking.h"

/* What all fields of a call share; `grey` is NULL at 1 bit, `binary` with more. */
typedef struct {
    const Settings *binary;
    const GreySettings *grey;
    const World *world;
    const Following *following;
    int64_t room; /* blobs that a field's arrays have room for */
} Engine;

/* A packed field: of `GreyPicture` all but the bits differ at 1 bit. */
typedef struct {
    GreyPicture picture;
    double passed_s;
} Taken;

/* How it went, for Python: every number of it is a whole one but those in px. */
typedef struct {
    double status, blobs, common_reach_px, jitter_px, half[VIEWS], found, believed, missing[4], surprise;
} Head;

/* What comes of a field. */
typedef struct {
    Head *head;
    double *blobs;        /* (COLUMNS, room) */
    double *half[VIEWS];  /* of each view's whole blobs: x and y, σ of both, common error; (room, 2), (room, 2), (room,) */
    Found found;
    int64_t *believed;    /* (targets,) 1 for the found ones to be reported */
    double *expected_mm, *expected_sigma_mm; /* (targets, 3), (targets,) */
    Track after;
} Way;

int measure_field(const Engine *, const Taken *, const Track *before, Way *, double *scratch);

enum { BLOB_COLUMNS = 9, HALF_COLUMNS = 5, TRACK = 8, TRACK_REST = 3 }; /* numbers a blob or a target */

#endif
