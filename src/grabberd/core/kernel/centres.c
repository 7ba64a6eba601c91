/* Centres of discs, from points that the middles of their pictures lead to (as disc_centres.py). */
#include "module_python.h"

static const double LEAST_MM4 = 1e-9;

/* What is known of a target's disc beside its normal. */
typedef struct {
    double slope[2][3], constant_mm[3], quadratic_mm[3][6], fixed_mm[3], spread_mm2[9];
} Disc;

static void centre(const Disc *disc, const double along[2][3], double xyz_mm[3], double share_mm2[9]) {
    double normal[3], square = 0;
    for (int k = 0; k < 3; k++) {
        int next = (k + 1) % 3, last = (k + 2) % 3;
        normal[k] = along[0][next] * along[1][last] - along[0][last] * along[1][next];
        square += normal[k] * normal[k];
    }
    bool is_known = square > LEAST_MM4;
    for (int k = 0; k < 3; k++) {
        double sum = 0;
        for (int i = 0, p = 0; i < 3; i++)
            for (int j = i; j < 3; j++, p++) sum += disc->quadratic_mm[k][p] * normal[i] * normal[j];
        xyz_mm[k] -= is_known ? disc->constant_mm[k] - sum / square : disc->fixed_mm[k];
    }
    for (int k = 0; k < 9 && !is_known; k++) share_mm2[k] += disc->spread_mm2[k];
}

static bool are_indices(const int64_t *index, int64_t count, int64_t end) {
    for (int64_t i = 0; i < count; i++)
        if (index[i] < 0 || index[i] >= end) return false;
    return true;
}

static void centre_all(const int64_t *neighbour, const Disc *disc, const double *places_mm, int64_t targets, const int64_t *own,
                       int64_t count, double *xyz_mm, double *share_mm2) {
    for (int64_t i = 0; i < count; i++) {
        double along[2][3] = {{0}};
        for (int slope = 0; slope < 2; slope++)
            for (int of = 0; of < 3; of++) {
                const double *place = places_mm + 3 * neighbour[(3 * slope + of) * targets + own[i]];
                for (int k = 0; k < 3; k++) along[slope][k] += disc[own[i]].slope[slope][of] * place[k];
            }
        centre(disc + own[i], along, xyz_mm + 3 * i, share_mm2 + 9 * i);
    }
}

/* centres(neighbours, discs, places of all targets, indices of some, their points, calibration's shares): changes the last two */
PyObject *centres_of(PyObject *self, PyObject *arguments) {
    Py_buffer neighbours, discs, places, own, xyz, share;
    (void)self;
    if (!PyArg_ParseTuple(arguments, "y*y*y*y*w*w*", &neighbours, &discs, &places, &own, &xyz, &share)) return NULL;
    int64_t targets = discs.len / (Py_ssize_t)sizeof(Disc), count = own.len / (Py_ssize_t)sizeof(int64_t);
    bool sound = holds(&neighbours, 6 * targets, sizeof(int64_t)) && holds(&places, 3 * targets, sizeof(double)) &&
                 holds(&xyz, 3 * count, sizeof(double)) && holds(&share, 9 * count, sizeof(double)) &&
                 are_indices(neighbours.buf, 6 * targets, targets) && are_indices(own.buf, count, targets);
    if (sound) centre_all(neighbours.buf, discs.buf, places.buf, targets, own.buf, count, xyz.buf, share.buf);
    Py_buffer *all[] = {&neighbours, &discs, &places, &own, &xyz, &share};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) PyBuffer_Release(all[i]);
    return sound ? Py_BuildValue("") : refused("arrays that do not belong together");
}
