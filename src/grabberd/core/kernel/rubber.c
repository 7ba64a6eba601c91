/* Energy of an incompressible wall through its thickness (as rubber.py), with derivatives in closed form.

   A layer's strain depends on P and Q, the unstressed inverse metric contracted with both forms, and on H, K and
   det a, which also move it; the depth's derivatives follow from the volume that it keeps. */
#include "wall.h"

enum { LAYERS = 5, NEWTON_STEPS = 5 };
static const double PLACES[LAYERS] = {-0.906179845938664, -0.5384693101056831, 0.0, 0.5384693101056831, 0.906179845938664};
static const double WEIGHTS[LAYERS] = {0.23692688505618908, 0.47862867049936647, 0.5688888888888889, 0.47862867049936647,
                                       0.23692688505618908};
enum { MEAN, GAUSS, DETERMINANT };

INLINE double determinant_of(const double form[3]) { return form[0] * form[1] - form[2] * form[2]; }
INLINE void cofactors(const double form[3], double out[3]) { out[0] = form[1], out[1] = form[0], out[2] = -2.0 * form[2]; }
INLINE double contracted(const double one[3], const double other[3]) {
    return one[0] * other[0] + one[1] * other[1] + one[2] * other[2];
}
INLINE double area_at(const Surface *at, double depth) { return 1.0 + depth * (2.0 * at->mean + at->gauss * depth); }
INLINE double volume_at(const Surface *at, double depth) {
    return depth * (1.0 + depth * (at->mean + depth * at->gauss / 3.0));
}

void surface_of(const double forms[FORMS], Surface *out) {
    double of_metric[3];
    memcpy(out->forms, forms, sizeof out->forms);
    cofactors(forms, of_metric);
    out->determinant = determinant_of(forms);
    out->mean = contracted(of_metric, forms + 3) / (2.0 * out->determinant);
    out->gauss = determinant_of(forms + 3) / out->determinant;
}

void by_forms(const Surface *at, double by[INVARIANTS][FORMS]) {
    double of_metric[3], of_curvature[3];
    cofactors(at->forms, of_metric);
    cofactors(at->forms + 3, of_curvature);
    for (int k = 0; k < 3; k++) {
        by[DETERMINANT][k] = of_metric[k], by[DETERMINANT][k + 3] = 0.0;
        by[MEAN][k] = (of_curvature[k] / 2.0 - at->mean * of_metric[k]) / at->determinant;
        by[MEAN][k + 3] = of_metric[k] / (2.0 * at->determinant);
        by[GAUSS][k] = -at->gauss * of_metric[k] / at->determinant;
        by[GAUSS][k + 3] = of_curvature[k] / at->determinant;
    }
}

/* det a is quadratic in the forms, and so are 2 H det a and K det a: their second derivatives are constants. */
INLINE double cofactor_slope(int i, int j) { return i + j == 1 ? 1.0 : i == 2 && j == 2 ? -2.0 : 0.0; }

void add_chained(const Surface *at, const double by[INVARIANTS][FORMS], const double first[INVARIANTS],
                 const double second[INVARIANTS][INVARIANTS], double out[FORMS][FORMS]) {
    const double *of_mean = by[MEAN], *of_gauss = by[GAUSS], *of_determinant = by[DETERMINANT];
    double bent[INVARIANTS][FORMS], per_mean = first[MEAN] / at->determinant, per_gauss = first[GAUSS] / at->determinant;
    for (int k = 0; k < INVARIANTS; k++)
        for (int j = 0; j < FORMS; j++) bent[k][j] = second[k][0] * by[0][j] + second[k][1] * by[1][j] + second[k][2] * by[2][j];
    for (int i = 0; i < FORMS; i++)
        for (int j = 0; j < FORMS; j++) {
            double sum = by[0][i] * bent[0][j] + by[1][i] * bent[1][j] + by[2][i] * bent[2][j];
            double in_metric = i < 3 && j < 3 ? cofactor_slope(i, j) : 0.0;
            double across = (i < 3) != (j < 3) ? cofactor_slope(i % 3, j % 3) : 0.0;
            double in_curvature = i >= 3 && j >= 3 ? cofactor_slope(i - 3, j - 3) : 0.0;
            sum += first[DETERMINANT] * in_metric;
            sum += per_mean * (across / 2.0 - at->mean * in_metric - of_determinant[i] * of_mean[j] - of_mean[i] * of_determinant[j]);
            sum += per_gauss * (in_curvature - at->gauss * in_metric - of_determinant[i] * of_gauss[j] - of_gauss[i] * of_determinant[j]);
            out[i][j] += sum;
        }
}

/* The layer that encloses a volume per area with the middle surface, which shrinks as that area grows. */
static void find_layer(const Surface *now, double volume, Layer *out) {
    double z = volume, det = now->determinant;
    for (int step = 0; step < NEWTON_STEPS; step++) z -= (volume_at(now, z) - volume) / area_at(now, z);
    double area = area_at(now, z), by_depth = 2.0 * (now->mean + now->gauss * z);
    const double at_depth[INVARIANTS] = {2.0 * z, z * z, 0.0};
    const double numerator[INVARIANTS] = {-z * z, -z * z * z / 3.0, -volume / (2.0 * det)};
    const double slope[INVARIANTS] = {-2.0 * z, -z * z, 0.0};
    out->depth_mm = z, out->area = area;
    for (int k = 0; k < INVARIANTS; k++) {
        out->by[k] = numerator[k] / area;
        out->area_by[k] = at_depth[k] + by_depth * out->by[k];
    }
    for (int k = 0; k < INVARIANTS; k++)
        for (int j = 0; j < INVARIANTS; j++) {
            double moved = slope[k] * out->by[j] + (k == DETERMINANT && j == DETERMINANT ? 0.75 * volume / (det * det) : 0.0);
            out->second[k][j] = (moved - out->by[k] * out->area_by[j]) / area;
        }
}

void layer_at(const Rest *rest, const Surface *now, double share, Layer *out) {
    double stretch = sqrt(now->determinant / rest->surface.determinant);
    find_layer(now, volume_at(&rest->surface, share * rest->thickness_mm) / stretch, out);
}

/* What all layers add up to: slopes by a and b through P and Q, and by the invariants. */
typedef struct {
    double by_metric[3], by_curvature[3], by[INVARIANTS];
    double second[INVARIANTS][INVARIANTS], mixed[FORMS][INVARIANTS];
} Sums;

static void add_layer(const Rest *rest, const Surface *now, int index, bool twice, Sums *sums) {
    const Surface *before = &rest->surface;
    double zeta = PLACES[index] * rest->thickness_mm / 2.0, area_before = area_at(before, zeta);
    double stretch = sqrt(now->determinant / before->determinant);
    double weight = WEIGHTS[index] * (rest->thickness_mm / 2.0) * area_before;
    double flat = 1.0 - before->gauss * zeta * zeta, bent = 2.0 * zeta + 2.0 * before->mean * zeta * zeta;
    double metric[3], inverse[3];
    for (int k = 0; k < 3; k++) metric[k] = flat * before->forms[k] + bent * before->forms[k + 3];
    cofactors(metric, inverse);
    double of_metric = determinant_of(metric);
    for (int k = 0; k < 3; k++) inverse[k] /= of_metric;
    double p = contracted(inverse, now->forms), q = contracted(inverse, now->forms + 3);
    Layer layer;
    find_layer(now, volume_at(before, zeta) / stretch, &layer);
    double z = layer.depth_mm, area = layer.area, h = now->mean, k_ = now->gauss, det = now->determinant;
    double thinning = area_before / (stretch * area);
    thinning *= thinning;
    /* Strain P f + Q g + thinning, where f = 1 − K z², g = 2 z + 2 H z². */
    double by_depth = 2.0 * (h + k_ * z);
    double f_z = -2.0 * k_ * z, g_z = 2.0 + 4.0 * h * z;
    double s_z = p * f_z + q * g_z - 2.0 * thinning * by_depth / area;
    const double f_by[INVARIANTS] = {0.0, -z * z, 0.0}, g_by[INVARIANTS] = {2.0 * z * z, 0.0, 0.0};
    const double area_by[INVARIANTS] = {2.0 * z, z * z, 0.0};
    double fixed[INVARIANTS];
    for (int k = 0; k < INVARIANTS; k++) fixed[k] = p * f_by[k] + q * g_by[k] - 2.0 * thinning * area_by[k] / area;
    fixed[DETERMINANT] -= thinning / det;
    for (int k = 0; k < 3; k++) {
        sums->by_metric[k] += weight * (1.0 - k_ * z * z) * inverse[k];
        sums->by_curvature[k] += weight * (2.0 * z + 2.0 * h * z * z) * inverse[k];
        sums->by[k] += weight * (fixed[k] + s_z * layer.by[k]);
    }
    if (!twice) return;
    double s_zz = p * -2.0 * k_ + q * 4.0 * h + 6.0 * thinning * by_depth * by_depth / (area * area) - 4.0 * thinning * k_ / area;
    const double f_zk[INVARIANTS] = {0.0, -2.0 * z, 0.0}, g_zk[INVARIANTS] = {4.0 * z, 0.0, 0.0};
    const double area_zk[INVARIANTS] = {2.0, 2.0 * z, 0.0};
    double s_zk[INVARIANTS];
    for (int k = 0; k < INVARIANTS; k++)
        s_zk[k] = p * f_zk[k] + q * g_zk[k] + 6.0 * thinning * by_depth * area_by[k] / (area * area) - 2.0 * thinning * area_zk[k] / area;
    s_zk[DETERMINANT] += 2.0 * thinning * by_depth / (area * det);
    for (int k = 0; k < INVARIANTS; k++)
        for (int j = 0; j < INVARIANTS; j++) {
            double both = 6.0 * thinning * area_by[k] * area_by[j] / (area * area);
            if (k == DETERMINANT) both += 2.0 * thinning * area_by[j] / (area * det);
            if (j == DETERMINANT) both += 2.0 * thinning * area_by[k] / (area * det);
            if (k == DETERMINANT && j == DETERMINANT) both += 2.0 * thinning / (det * det);
            both += s_zk[k] * layer.by[j] + s_zk[j] * layer.by[k] + s_zz * layer.by[k] * layer.by[j] + s_z * layer.second[k][j];
            sums->second[k][j] += weight * both;
        }
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < INVARIANTS; j++) {
            sums->mixed[i][j] += weight * inverse[i] * (f_by[j] + f_z * layer.by[j]);
            sums->mixed[i + 3][j] += weight * inverse[i] * (g_by[j] + g_z * layer.by[j]);
        }
}

void energy_slopes(const Rest *rest, const Surface *now, double first[FORMS], double second[FORMS][FORMS]) {
    Sums sums = {0};
    double by[INVARIANTS][FORMS], half = rest->shear_mpa / 2.0;
    for (int index = 0; index < LAYERS; index++) add_layer(rest, now, index, second != NULL, &sums);
    by_forms(now, by);
    for (int i = 0; i < FORMS; i++) {
        double through = i < 3 ? sums.by_metric[i] : sums.by_curvature[i - 3];
        for (int k = 0; k < INVARIANTS; k++) through += sums.by[k] * by[k][i];
        first[i] = half * through;
    }
    if (!second) return;
    memset(second, 0, FORMS * sizeof *second);
    for (int i = 0; i < FORMS; i++)
        for (int j = 0; j < FORMS; j++)
            for (int k = 0; k < INVARIANTS; k++) second[i][j] += sums.mixed[i][k] * by[k][j] + by[k][i] * sums.mixed[j][k];
    add_chained(now, by, sums.by, sums.second, second);
    for (int i = 0; i < FORMS; i++)
        for (int j = 0; j < FORMS; j++) second[i][j] *= half;
}
