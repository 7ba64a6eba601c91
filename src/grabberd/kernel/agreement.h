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

int list_hypotheses(const World *, const Rays rays[VIEWS], const ViewBlobs blobs[VIEWS], double reach_px, double gate_mm,
                    double farthest_mm, Hypotheses *);
int largest(const World *, const Judge *, const Hypotheses *, const int64_t blobs[VIEWS], int64_t *chosen, int64_t *count,
            double *expected_mm, double *sigma_mm);

void expect_nothing(Expectation *, const double *covariance_mm2);
void see(Expectation *, int64_t target, const double displacement_mm[3]);
void forget(Expectation *, int64_t target);
double expected_of(const Expectation *, int64_t target, double displacement_mm[3]); /* → variance */

#endif
