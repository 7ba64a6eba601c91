/* Work of stress and load at points of a thick wall, and its stiffness (as shell.py).

   Work is by derivatives and unknowns, (6, 4) at each point; the forms depend on the last five derivatives alone. */
#include "wall.h"

#define SHEAR_SHARE (5.0 / 6.0)
enum { LATER = (DERIVATIVES - 1) * UNKNOWNS };
/* Number of an unknown's derivative among the last five. */
#define PLACE(derivative, unknown) ((derivative) * UNKNOWNS + (unknown))

typedef struct {
    double tangent[2][3], second[3][3], dual[2][3], normal[3], area;
    double slope[2], slope_second[3];
    double christoffel[3][2];
    Surface surface;
    double by_values[FORMS][LATER];
} Point;

INLINE double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
INLINE void cross(const double a[3], const double b[3], double out[3]) {
    out[0] = a[1] * b[2] - a[2] * b[1], out[1] = a[2] * b[0] - a[0] * b[2], out[2] = a[0] * b[1] - a[1] * b[0];
}

static void fill_by_values(Point *at) {
    memset(at->by_values, 0, sizeof at->by_values);
    for (int i = 0; i < 3; i++) {
        at->by_values[0][PLACE(0, i)] = 2.0 * at->tangent[0][i];
        at->by_values[1][PLACE(1, i)] = 2.0 * at->tangent[1][i];
        at->by_values[2][PLACE(0, i)] = at->tangent[1][i];
        at->by_values[2][PLACE(1, i)] = at->tangent[0][i];
    }
    for (int k = 0; k < 3; k++) {
        double *by = at->by_values[3 + k];
        for (int l = 0; l < 2; l++) at->christoffel[k][l] = dot(at->dual[l], at->second[k]);
        for (int i = 0; i < 3; i++) {
            for (int l = 0; l < 2; l++) by[PLACE(l, i)] = at->christoffel[k][l] * at->normal[i];
            by[PLACE(2 + k, i)] = -at->normal[i];
        }
        by[PLACE(2 + k, 3)] = 1.0;
    }
}

static void point_of(const Wall *wall, int64_t n, Point *at) {
    double across[3], forms[FORMS];
    for (int d = 0; d < DERIVATIVES - 1; d++) {
        const double *value = wall->values + UNKNOWNS * (d * wall->count + n);
        memcpy(d < 2 ? at->tangent[d] : at->second[d - 2], value, 3 * sizeof *value);
        *(d < 2 ? at->slope + d : at->slope_second + d - 2) = value[3];
    }
    cross(at->tangent[1], at->tangent[0], across);
    at->area = sqrt(dot(across, across));
    for (int i = 0; i < 3; i++) at->normal[i] = across[i] / at->area;
    cross(at->normal, at->tangent[1], at->dual[0]);
    cross(at->tangent[0], at->normal, at->dual[1]);
    for (int i = 0; i < 3; i++) at->dual[0][i] /= at->area, at->dual[1][i] /= at->area;
    forms[0] = dot(at->tangent[0], at->tangent[0]);
    forms[1] = dot(at->tangent[1], at->tangent[1]);
    forms[2] = dot(at->tangent[0], at->tangent[1]);
    for (int k = 0; k < 3; k++) forms[3 + k] = at->slope_second[k] - dot(at->normal, at->second[k]);
    surface_of(forms, &at->surface);
    fill_by_values(at);
}

static double rest_of(const Wall *wall, int64_t n, Rest *rest) {
    double forms[FORMS];
    for (int k = 0; k < FORMS; k++) forms[k] = wall->rest[k * wall->count + n];
    surface_of(forms, &rest->surface);
    rest->thickness_mm = wall->rest[FORMS * wall->count + n], rest->shear_mpa = wall->shear_mpa;
    return sqrt(rest->surface.determinant);
}

/* Stiffness against shear per area of the parameters. */
INLINE double shear_of(const Rest *rest, double area) {
    return SHEAR_SHARE * rest->shear_mpa * rest->thickness_mm * area * area * area;
}

/* Work of unit loads, (6, 4, UNIT_LOADS). */
static void unit_work(const Point *at, const Rest *rest, double *units) {
    double by[INVARIANTS][FORMS], moved[FORMS] = {0}, direction[2][3], length = sqrt(dot(at->tangent[0], at->tangent[0]));
    Layer inner;
    layer_at(rest, &at->surface, -0.5, &inner);
    by_forms(&at->surface, by);
    for (int k = 0; k < INVARIANTS; k++)
        for (int e = 0; e < FORMS; e++) moved[e] += inner.by[k] * by[k][e];
    double face = at->area * inner.area;
    for (int i = 0; i < 3; i++) direction[0][i] = at->tangent[0][i] / length;
    cross(direction[0], at->normal, direction[1]);
    memset(units, 0, WORK * UNIT_LOADS * sizeof *units);
    for (int i = 0; i < 3; i++) {
        units[UNIT_LOADS * i] = -at->area * at->normal[i];
        units[UNIT_LOADS * i + 1] = face * at->normal[i];
        for (int a = 0; a < 2; a++) units[UNIT_LOADS * i + 2 + a] = face * direction[a][i];
    }
    double *later = units + UNKNOWNS * UNIT_LOADS;
    for (int p = 0; p < LATER; p++) {
        double pushed = 0.0;
        for (int e = 0; e < FORMS; e++) pushed += moved[e] * at->by_values[e][p];
        later[UNIT_LOADS * p + 1] = face * pushed;
    }
    /* A traction on the inner face has an arm: it turns the sheared wall's normal as well. */
    for (int a = 0; a < 2; a++)
        for (int l = 0; l < 2; l++) {
            double turning = face * inner.depth_mm * dot(direction[a], at->dual[l]);
            for (int i = 0; i < 3; i++) later[UNIT_LOADS * PLACE(l, i) + 2 + a] -= turning * at->normal[i];
            later[UNIT_LOADS * PLACE(l, 3) + 2 + a] += turning;
        }
}

void wall_forces(const Wall *wall, double *resistance, double *units) {
    for (int64_t n = 0; n < wall->count; n++) {
        Point at;
        Rest rest;
        double stress[FORMS], *out = resistance + WORK * n;
        double area = rest_of(wall, n, &rest);
        point_of(wall, n, &at);
        energy_slopes(&rest, &at.surface, stress, NULL);
        memset(out, 0, WORK * sizeof *out);
        for (int e = 0; e < FORMS; e++)
            for (int p = 0; p < LATER; p++) out[UNKNOWNS + p] += area * stress[e] * at.by_values[e][p];
        for (int l = 0; l < 2; l++) out[UNKNOWNS + PLACE(l, 3)] += shear_of(&rest, area) * at.slope[l];
        unit_work(&at, &rest, units + WORK * UNIT_LOADS * n);
    }
}

/* Stress times second derivatives of the forms by those of x, y, z. */
static void add_curving(const Point *at, const double stress[FORMS], double matrix[LATER][LATER]) {
    const double *moment = stress + 3;
    const double membrane[2][2] = {{2.0 * stress[0], stress[2]}, {stress[2], 2.0 * stress[1]}};
    double curved[3] = {0}, over[2];
    for (int e = 0; e < 3; e++)
        for (int i = 0; i < 3; i++) curved[i] += moment[e] * at->second[e][i];
    for (int l = 0; l < 2; l++) over[l] = dot(at->dual[l], curved);
    double along = dot(at->normal, curved);
    for (int l = 0; l < 2; l++)
        for (int m = 0; m < 2; m++) {
            double doubled = along * dot(at->dual[l], at->dual[m]);
            for (int i = 0; i < 3; i++) {
                matrix[PLACE(l, i)][PLACE(m, i)] += membrane[l][m];
                for (int j = 0; j < 3; j++)
                    matrix[PLACE(l, i)][PLACE(m, j)] += doubled * at->normal[i] * at->normal[j] -
                                                        over[m] * at->normal[i] * at->dual[l][j] - over[l] * at->dual[m][i] * at->normal[j];
            }
        }
    for (int l = 0; l < 2; l++)
        for (int e = 0; e < 3; e++)
            for (int i = 0; i < 3; i++)
                for (int j = 0; j < 3; j++) {
                    double turned = moment[e] * at->normal[i] * at->dual[l][j];
                    matrix[PLACE(l, i)][PLACE(2 + e, j)] += turned;
                    matrix[PLACE(2 + e, j)][PLACE(l, i)] += turned;
                }
}

/* A contact pressure at some forms: its push per area of the middle surface, its stress on the forms, and their derivatives. */
typedef struct {
    double push, push_by[FORMS], stress[FORMS], stress_by[FORMS][FORMS];
} Pressing;

static void pressing_of(const Point *at, const Rest *rest, double contact_mpa, Pressing *out) {
    double by[INVARIANTS][FORMS], moved[FORMS] = {0}, root = sqrt(at->surface.determinant);
    Layer inner;
    memset(out, 0, sizeof *out);
    layer_at(rest, &at->surface, -0.5, &inner);
    by_forms(&at->surface, by);
    for (int k = 0; k < INVARIANTS; k++)
        for (int e = 0; e < FORMS; e++) {
            moved[e] += inner.by[k] * by[k][e];
            out->push_by[e] += contact_mpa * inner.area_by[k] * by[k][e];
        }
    out->push = contact_mpa * inner.area;
    add_chained(&at->surface, (const double(*)[FORMS])by, inner.by, (const double(*)[INVARIANTS])inner.second, out->stress_by);
    for (int e = 0; e < FORMS; e++) {
        out->stress[e] = root * out->push * moved[e];
        for (int f = 0; f < FORMS; f++) {
            double growing = out->push * by[INVARIANTS - 1][f] / (2.0 * at->surface.determinant) + out->push_by[f];
            out->stress_by[e][f] = root * (out->push * out->stress_by[e][f] + growing * moved[e]);
        }
    }
}

/* Adds Bᵀ C B. */
WIDE static void add_sandwiched(const double by_values[FORMS][LATER], const double material[FORMS][FORMS],
                                double matrix[LATER][LATER]) {
    for (int e = 0; e < FORMS; e++) {
        double bent[LATER] = {0};
        for (int f = 0; f < FORMS; f++)
            for (int q = 0; q < LATER; q++) bent[q] += material[e][f] * by_values[f][q];
        for (int p = 0; p < LATER; p++)
            if (by_values[e][p] != 0.0)
                for (int q = 0; q < LATER; q++) matrix[p][q] += by_values[e][p] * bent[q];
    }
}

/* How a push turns and grows with the wall, (3, LATER): as a₂ × a₁ does, and with the inner face. */
static void fill_pushed(const Point *at, const Pressing *pressing, double difference_mpa, double out[3][LATER]) {
    double push = pressing->push - difference_mpa;
    memset(out, 0, 3 * sizeof *out);
    for (int p = 0; p < LATER; p++) {
        double growing = 0.0;
        for (int e = 0; e < FORMS; e++) growing += at->area * pressing->push_by[e] * at->by_values[e][p];
        for (int i = 0; i < 3; i++) out[i][p] -= at->normal[i] * growing;
    }
    for (int i = 0; i < 3; i++) {
        int j = (i + 1) % 3, k = (i + 2) % 3;
        out[i][PLACE(0, j)] += push * at->tangent[1][k], out[i][PLACE(0, k)] -= push * at->tangent[1][j];
        out[i][PLACE(1, j)] -= push * at->tangent[0][k], out[i][PLACE(1, k)] += push * at->tangent[0][j];
    }
}

void wall_stiffness(const Wall *wall, double difference_mpa, const double *contact_mpa, double *stiffness) {
    for (int64_t n = 0; n < wall->count; n++) {
        Point at;
        Rest rest;
        Pressing pressing;
        double stress[FORMS], material[FORMS][FORMS], matrix[LATER][LATER] = {{0}}, pushed[3][LATER];
        double area = rest_of(wall, n, &rest);
        point_of(wall, n, &at);
        energy_slopes(&rest, &at.surface, stress, material);
        pressing_of(&at, &rest, contact_mpa[n], &pressing);
        for (int e = 0; e < FORMS; e++) {
            stress[e] = area * stress[e] - pressing.stress[e];
            for (int f = 0; f < FORMS; f++) material[e][f] = area * material[e][f] - pressing.stress_by[e][f];
        }
        add_sandwiched((const double(*)[LATER])at.by_values, (const double(*)[FORMS])material, matrix);
        add_curving(&at, stress, matrix);
        for (int l = 0; l < 2; l++) matrix[PLACE(l, 3)][PLACE(l, 3)] += shear_of(&rest, area);
        fill_pushed(&at, &pressing, difference_mpa, pushed);
        double *out = stiffness + WORK * WORK * n;
        memset(out, 0, WORK * WORK * sizeof *out);
        for (int i = 0; i < 3; i++) memcpy(out + WORK * i + UNKNOWNS, pushed[i], sizeof pushed[i]);
        for (int p = 0; p < LATER; p++) memcpy(out + WORK * (UNKNOWNS + p) + UNKNOWNS, matrix[p], sizeof matrix[p]);
    }
}
