/* What the module offers for identification and tracking. Every length is checked here. */
#include "module_python.h"

#include "agreement.h"

static bool are_blobs(const Py_buffer view[3], ViewBlobs *blobs) {
    *blobs = (ViewBlobs){view[0].buf, view[1].buf, view[2].len ? view[2].buf : NULL,
                         view[0].len / (2 * (Py_ssize_t)sizeof(double))};
    return blobs->count < INT32_MAX && holds(view + 1, 2 * blobs->count, sizeof(double)) &&
           (!view[2].len || holds(view + 2, blobs->count, sizeof(double)));
}

bool is_world(const Py_buffer *world) {
    const World *own = world->buf;
    if (world->len != sizeof(World) || own->targets <= 0 || own->targets >= 1 << 24 || own->pairs < 0) return false;
    for (int v = 0; v < VIEWS; v++)
        if (own->rig.local[v].rows && (own->rig.local[v].rows < 4 || own->rig.local[v].columns < 4)) return false;
    return own->rig.errors >= 0 && own->rig.errors <= MOST_ERRORS;
}

/* near(world, places, sigma, left xy, σ, common, right xy, σ, common, reach, indices, numbers) → status, count, surprise */
PyObject *near_of(PyObject *self, PyObject *arguments) {
    Py_buffer world, places, sigma, view[2][3], whole, real;
    ViewBlobs blobs[VIEWS];
    double reach_px, surprise = 0;
    int64_t count = 0;
    int status = REFUSED;
    (void)self;
    if (!PyArg_ParseTuple(arguments, "y*y*y*y*y*y*y*y*y*dw*w*", &world, &places, &sigma, &view[0][0], &view[0][1], &view[0][2],
                          &view[1][0], &view[1][1], &view[1][2], &reach_px, &whole, &real))
        return NULL;
    const World *own = world.buf;
    if (is_world(&world) && holds(&places, 3 * own->targets, sizeof(double)) &&
        holds(&sigma, own->targets, sizeof(double)) && are_blobs(view[0], blobs) && are_blobs(view[1], blobs + 1) &&
        holds(&whole, 4 * own->targets, sizeof(int64_t)) && holds(&real, 36 * own->targets, sizeof(double))) {
        double *numbers = real.buf;
        Found found = found_in(whole.buf, numbers, numbers + FOUND_NUMBERS * own->targets, own->targets);
        Py_BEGIN_ALLOW_THREADS
        status = near(own, places.buf, sigma.buf, blobs, reach_px, &found, &count, &surprise);
        Py_END_ALLOW_THREADS
    }
    Py_buffer *all[] = {&world, &places, &sigma, &view[0][0], &view[0][1], &view[0][2], &view[1][0], &view[1][1], &view[1][2], &whole, &real};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) PyBuffer_Release(all[i]);
    return Py_BuildValue("iLd", status, (long long)count, surprise);
}

static bool are_targets(const World *world, const int64_t *target, int64_t count) {
    for (int64_t i = 0; i < count; i++)
        if (target[i] < 0 || target[i] >= world->targets) return false;
    return true;
}

/* agree(world, weights, sigma, targets, displacements, variances, covariances, expected, settled); where there are no
   weights, `expected` is known
   → the index of whom the others contradict, or −1 and then `expected` and `settled` are filled */
PyObject *agree_of(PyObject *self, PyObject *arguments) {
    Py_buffer world, weights, sigma, target, displacement, variance, covariance, expected, settled;
    int64_t worst = -2;
    (void)self;
    if (!PyArg_ParseTuple(arguments, "y*y*y*y*y*y*y*w*w*", &world, &weights, &sigma, &target, &displacement, &variance, &covariance,
                          &expected, &settled))
        return NULL;
    const World *own = world.buf;
    int64_t count = target.len / (Py_ssize_t)sizeof(int64_t);
    if (is_world(&world) && count <= own->targets &&
        (!weights.len || holds(&weights, count * own->targets, sizeof(double))) && holds(&sigma, own->targets, sizeof(double)) &&
        holds(&displacement, 3 * count, sizeof(double)) && holds(&variance, 3 * count, sizeof(double)) &&
        holds(&covariance, 9 * count, sizeof(double)) && holds(&expected, 3 * own->targets, sizeof(double)) &&
        holds(&settled, 10 * own->targets, sizeof(double)) && are_targets(own, target.buf, count)) {
        double *places = settled.buf;
        Py_BEGIN_ALLOW_THREADS
        worst = worst_of(own, weights.len ? weights.buf : NULL, sigma.buf, count, target.buf, displacement.buf, variance.buf, expected.buf, places);
        if (worst == -1)
            settle(own, expected.buf, sigma.buf, count, target.buf, displacement.buf, covariance.buf, places,
                   places + 9 * own->targets);
        Py_END_ALLOW_THREADS
    }
    Py_buffer *all[] = {&world, &weights, &sigma, &target, &displacement, &variance, &covariance, &expected, &settled};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) PyBuffer_Release(all[i]);
    return worst == -2 ? refused("arrays that do not belong together") : PyLong_FromLongLong(worst);
}

/* `room` of them in an array of three columns of indices, and one of six columns of numbers */
static Hypotheses hypotheses_in(const Py_buffer *whole, const Py_buffer *real, int64_t room) {
    int64_t *index = whole->buf;
    double *number = real->buf;
    return (Hypotheses){index, {index + room, index + 2 * room}, number, number + 3 * room, 0, room};
}

/* hypotheses(world, left xy, σ, common, right xy, σ, common, reach, gate, farthest, indices, numbers) → status, count */
PyObject *hypotheses_of(PyObject *self, PyObject *arguments) {
    Py_buffer world, view[2][3], whole, real;
    ViewBlobs blobs[VIEWS];
    double reach_px, gate_mm, farthest_mm;
    int64_t count = 0;
    int status = REFUSED;
    (void)self;
    if (!PyArg_ParseTuple(arguments, "y*y*y*y*y*y*y*dddw*w*", &world, &view[0][0], &view[0][1], &view[0][2], &view[1][0],
                          &view[1][1], &view[1][2], &reach_px, &gate_mm, &farthest_mm, &whole, &real))
        return NULL;
    int64_t room = whole.len / (3 * (Py_ssize_t)sizeof(int64_t));
    if (is_world(&world) && are_blobs(view[0], blobs) && are_blobs(view[1], blobs + 1) && holds(&real, 6 * room, sizeof(double))) {
        Hypotheses known = hypotheses_in(&whole, &real, room);
        Py_BEGIN_ALLOW_THREADS
        status = list_hypotheses(world.buf, blobs, reach_px, gate_mm, farthest_mm, &known);
        Py_END_ALLOW_THREADS
        count = known.count;
    }
    Py_buffer *all[] = {&world, &view[0][0], &view[0][1], &view[0][2], &view[1][0], &view[1][1], &view[1][2], &whole, &real};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) PyBuffer_Release(all[i]);
    return Py_BuildValue("iL", status, (long long)count);
}

static bool are_hypotheses(const World *world, const Hypotheses *known, const int64_t blobs[VIEWS]) {
    if (!are_targets(world, known->target, known->count)) return false;
    for (int v = 0; v < VIEWS; v++)
        for (int64_t i = 0; i < known->count; i++)
            if (known->blob[v][i] < 0 || known->blob[v][i] >= blobs[v]) return false;
    return true;
}

/* largest(world, covariance, trust, margin, pitch, targets, left, right, displacements, variances, left blobs, right blobs, chosen,
   expected, sigma) → status, count; fills the last three */
PyObject *largest_of(PyObject *self, PyObject *arguments) {
    Py_buffer world, covariance, column[5], chosen, expected, sigma;
    Judge judge;
    long long blobs[VIEWS];
    int64_t count = 0;
    int status = REFUSED;
    (void)self;
    if (!PyArg_ParseTuple(arguments, "y*y*dddy*y*y*y*y*LLw*w*w*", &world, &covariance, &judge.trust, &judge.margin, &judge.pitch_mm,
                          column, column + 1, column + 2, column + 3, column + 4, blobs, blobs + 1, &chosen, &expected, &sigma))
        return NULL;
    const World *own = world.buf;
    const int64_t most[VIEWS] = {blobs[0], blobs[1]};
    int64_t known_ones = column[0].len / (Py_ssize_t)sizeof(int64_t);
    Hypotheses known = {column[0].buf, {column[1].buf, column[2].buf}, column[3].buf, column[4].buf, known_ones, known_ones};
    judge.covariance_mm2 = covariance.buf;
    if (is_world(&world) && holds(&covariance, own->targets * own->targets, sizeof(double)) &&
        holds(column + 1, known_ones, sizeof(int64_t)) && holds(column + 2, known_ones, sizeof(int64_t)) &&
        holds(column + 3, 3 * known_ones, sizeof(double)) && holds(column + 4, 3 * known_ones, sizeof(double)) &&
        blobs[0] >= 0 && blobs[0] < INT32_MAX && blobs[1] >= 0 && blobs[1] < INT32_MAX && are_hypotheses(own, &known, most) &&
        holds(&chosen, own->targets, sizeof(int64_t)) && holds(&expected, 3 * own->targets, sizeof(double)) &&
        holds(&sigma, own->targets, sizeof(double))) {
        Py_BEGIN_ALLOW_THREADS
        status = largest(own, &judge, &known, most, chosen.buf, &count, expected.buf, sigma.buf);
        Py_END_ALLOW_THREADS
    }
    Py_buffer *all[] = {&world, &covariance, column, column + 1, column + 2, column + 3, column + 4, &chosen, &expected, &sigma};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) PyBuffer_Release(all[i]);
    return Py_BuildValue("iL", status, (long long)count);
}

static bool is_square(const Py_buffer *matrix, int64_t *side) {
    int64_t numbers = matrix->len / (Py_ssize_t)sizeof(double);
    *side = (int64_t)sqrt((double)numbers);
    return *side > 0 && *side * *side == numbers;
}

/* precision(covariance, precision): fills the last */
PyObject *precision_of(PyObject *self, PyObject *arguments) {
    Py_buffer covariance, precision;
    int64_t targets;
    (void)self;
    if (!PyArg_ParseTuple(arguments, "y*w*", &covariance, &precision)) return NULL;
    bool sound = is_square(&covariance, &targets) && holds(&precision, targets * targets, sizeof(double));
    double *row = sound ? malloc((size_t)targets * sizeof *row) : NULL;
    if (row) {
        Py_BEGIN_ALLOW_THREADS
        invert(targets, covariance.buf, precision.buf, row);
        Py_END_ALLOW_THREADS
    }
    free(row);
    PyBuffer_Release(&covariance);
    PyBuffer_Release(&precision);
    if (sound && !row) return PyErr_NoMemory();
    return sound ? Py_BuildValue("") : refused("arrays that do not belong together");
}

static int64_t seen_ones(const uint8_t *seen, int64_t targets) {
    int64_t count = 0;
    for (int64_t i = 0; i < targets; i++) count += seen[i] != 0;
    return count;
}

/* predictor(covariance, precision, square of the noise, whether each target is seen, weights, σ): fills the last two */
PyObject *predictor_of_seen(PyObject *self, PyObject *arguments) {
    Py_buffer covariance, precision, seen, weights, sigma;
    Smooth smooth = {0};
    (void)self;
    if (!PyArg_ParseTuple(arguments, "y*y*dy*w*w*", &covariance, &precision, &smooth.noise_mm2, &seen, &weights, &sigma)) return NULL;
    bool sound = is_square(&covariance, &smooth.targets) && holds(&precision, smooth.targets * smooth.targets, sizeof(double)) &&
                 holds(&seen, smooth.targets, 1) && holds(&sigma, smooth.targets, sizeof(double));
    int64_t count = sound ? seen_ones(seen.buf, smooth.targets) : 0;
    sound = sound && holds(&weights, count * smooth.targets, sizeof(double));
    double *scratch = sound ? malloc((size_t)(smooth.targets * (smooth.targets + 1)) * sizeof *scratch) : NULL;
    if (scratch) {
        smooth.covariance_mm2 = covariance.buf, smooth.precision = precision.buf;
        Py_BEGIN_ALLOW_THREADS
        predictor_of(&smooth, seen.buf, count, weights.buf, sigma.buf, scratch);
        Py_END_ALLOW_THREADS
    }
    free(scratch);
    Py_buffer *all[] = {&covariance, &precision, &seen, &weights, &sigma};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) PyBuffer_Release(all[i]);
    if (sound && !scratch) return PyErr_NoMemory();
    return sound ? Py_BuildValue("") : refused("arrays that do not belong together");
}
