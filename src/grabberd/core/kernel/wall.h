/* A thick wall at one point: its rubber, and the work of stress and load there. */
#ifndef GRABBERD_WALL_H
#define GRABBERD_WALL_H

#include "kernel.h"

enum {
    FORMS = 6,       /* a11, a22, a12, b11, b22, b12 */
    INVARIANTS = 3,  /* H, K, det a */
    UNKNOWNS = 4,    /* x, y, z, s */
    DERIVATIVES = 6, /* as `splines.DERIVATIVES`, the value first */
    WORK = DERIVATIVES * UNKNOWNS,
    UNIT_LOADS = 4, /* difference, contact, traction round, traction along */
};

/* Forms of a surface with their invariants. */
typedef struct {
    double forms[FORMS];
    double mean, gauss, determinant;
} Surface;

/* A wall without stress. */
typedef struct {
    Surface surface;
    double thickness_mm, shear_mpa;
} Rest;

/* Depth of a layer, with its derivatives by H, K and det a. */
typedef struct {
    double depth_mm, by[INVARIANTS], second[INVARIANTS][INVARIANTS];
    double area, area_by[INVARIANTS]; /* of the layer per area of the middle surface, as it moves */
} Layer;

void surface_of(const double forms[FORMS], Surface *);
void layer_at(const Rest *, const Surface *, double share, Layer *);
/* Derivatives of the energy per unstressed area by the forms; the second ones where `second` is not null. */
void energy_slopes(const Rest *, const Surface *, double first[FORMS], double second[FORMS][FORMS]);
/* (INVARIANTS, FORMS) derivatives of H, K and det a by the forms. */
void by_forms(const Surface *, double by[INVARIANTS][FORMS]);
/* Adds a function's second derivatives by the forms, from those by the invariants. */
void add_chained(const Surface *, const double by[INVARIANTS][FORMS], const double first[INVARIANTS],
                 const double second[INVARIANTS][INVARIANTS], double out[FORMS][FORMS]);

/* The wall at N points: derivatives (5, N, 4) of x, y, z, s, and `rest` (7, N), unstressed forms and thickness. */
typedef struct {
    int64_t count;
    const double *values, *rest;
    double shear_mpa;
} Wall;

void wall_forces(const Wall *, double *resistance, double *units);
void wall_stiffness(const Wall *, double difference_mpa, const double *contact_mpa, double *stiffness);

#endif
