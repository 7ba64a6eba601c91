/* Tracking: the same targets from field to field, found again near where they must be, or identified anew. */
#ifndef GRABBERD_TRACKING_H
#define GRABBERD_TRACKING_H

#include "agreement.h"

/* As `displacement_field.Say`: what some targets tell of all of them. */
typedef struct {
    const double *weights;  /* (count, targets) */
    const double *sigma_mm; /* (targets,) */
} Say;

/* Predictors made so far, in memory of the caller's: the newest `room` of them, `next` in the place of the oldest. */
typedef struct {
    Smooth smooth;
    int64_t room, next;
    int64_t *count, *seen;     /* (room,) and (room, targets), ascending; −1 of them where there is none yet */
    double *weights, *sigma_mm; /* (room, targets · targets), (room, targets) */
} Predictors;

/* What telling targets apart needs, where nothing else does. */
typedef struct {
    const World *world;
    Predictors *predictors;
    Judge judge;
    double gate_mm, farthest_mm;
} Identifying;

/* As `TrackingSettings`, with the views' columns. */
typedef struct {
    double columns[VIEWS][2]; /* first and end */
    double speed_mm_s, longest_gap_s, least_share, astray_mm, otherwise_mm, acceleration_mm_s2, vague_mm, firm_mm;
    Predictors *predictors;
    Identifying identifying;
} Following;

/* As `Track`: (targets, 3), (targets,), (targets, 3), (targets,). */
typedef struct {
    double *xyz_mm, *sigma_mm, *velocity_mm_s, *unseen_s;
    double *rest; /* σ of a velocity, age, number of targets found */
} Track;

/* How many were found in a search, and what they tell. */
typedef struct {
    int64_t count;
    double surprise;
    Say say;
} Sighting;

/* A field's blobs, and what becomes of them and of the track. */
typedef struct {
    const World *world;
    const Following *following;
    const Track *before;
    ViewBlobs blobs[VIEWS];
    double reach_px, passed_s;
    Found found;
    int64_t *believed;   /* (targets,) 1 for the found ones to be reported */
    double *expected_mm; /* (targets, 3) */
    Track after;
    Sighting sighting;
} Step;

int track_on(Step *, double *scratch); /* SCRATCH numbers a target */

int identify(const Following *, const World *, const ViewBlobs blobs[VIEWS], double reach_px, Found *, double *expected_mm,
             double *scratch, Sighting *);
int sight(const World *, Predictors *, const double *places_mm, const double *sigma_mm, const ViewBlobs blobs[VIEWS],
          double reach_px, Found *, double *expected_mm, double *room, Sighting *);
int recall(Predictors *, const int64_t *target, int64_t count, Say *);

enum { SCRATCH = 11 };

#endif
