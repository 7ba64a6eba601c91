/* Hypotheses about which blobs are the images of a target, and how those that agree are found. */
#ifndef GRABBERD_AGREEMENT_H
#define GRABBERD_AGREEMENT_H

#include "space.h"

/* Rays from a projection centre through the blobs of one view. */
typedef struct {
    const double *center_mm; /* (3,) */
    const double *direction; /* (N, 3) */
} Rays;

/* As `hypotheses.Hypotheses`, by ascending target; `room` is that of the arrays. */
typedef struct {
    int64_t *target, *blob[VIEWS];
    double *displacement_mm, *variance_mm2; /* (H, 3) each */
    int64_t count, room;
} Hypotheses;

/* As `CorrespondenceSettings`, and what an agreement knows of its object. */
typedef struct {
    double trust, margin, pitch_mm;
    const double *covariance_mm2; /* (targets, targets), of measured displacements */
} Judge;

/* Displacements of all targets as the field expects them from those seen so far: a target can be added and taken
   away again at the cost of one pass over its matrix (the sweep operator). */
typedef struct {
    int64_t targets;
    double noise_mm2;
    double *swept; /* (targets, targets): −S⁻¹ among seen ones, weights between, what remains among the others */
    double *value; /* (targets, 3): S⁻¹·displacement of a seen one, expected displacement of another */
    double *seen_mm; /* (targets, 3): displacements of seen ones */
    double *row; /* (targets,) */
    bool *seen;
} Expectation;

/* As `DisplacementField`: a smooth field of the targets' displacements. */
typedef struct {
    int64_t targets;
    double noise_mm2;
    const double *covariance_mm2, *precision; /* (targets, targets) each, one the inverse of the other */
} Smooth;

void directions_of(const Rig *, int view, const ViewBlobs *, double *direction); /* (N, 3); NaN where there is no ray */
int list_hypotheses(const World *, const ViewBlobs blobs[VIEWS], double reach_px, double gate_mm, double farthest_mm, Hypotheses *);
int largest(const World *, const Judge *, const Hypotheses *, const int64_t blobs[VIEWS], int64_t *chosen, int64_t *count,
            double *expected_mm, double *sigma_mm);

void expect_nothing(Expectation *, const double *covariance_mm2);
void see(Expectation *, int64_t target, const double displacement_mm[3]);
void forget(Expectation *, int64_t target);
double expected_of(const Expectation *, int64_t target, double displacement_mm[3]); /* → variance */
void sweep(double *swept, int64_t targets, int64_t target, double sign, double *row); /* adds a target, or −1: takes it away */

void invert(int64_t targets, const double *covariance_mm2, double *precision, double *row); /* row: (targets,) */
/* Of the `count` targets seen, those not 0; weights: (count, targets), scratch: targets · (targets + 1) numbers. */
void predictor_of(const Smooth *, const uint8_t *seen, int64_t count, double *weights, double *sigma_mm, double *scratch);

#endif
