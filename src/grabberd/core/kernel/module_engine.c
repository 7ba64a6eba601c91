/* What the module offers for fields as a whole. Every length is checked here. */
#include "module_python.h"

#include "module.h"

enum { MOST_FIELDS = 64, FIELD_NUMBERS = 4 };

/* Fields as Python gives them, and what there is room for. */
typedef struct {
    Py_buffer data[MOST_FIELDS];
    int64_t count;
    Py_buffer settings, world, following, about, track, index, kept, held;
} Given;

static bool hold_fields(PyObject *fields, Given *given) {
    Py_ssize_t count = PyTuple_Size(fields);
    given->count = 0;
    for (Py_ssize_t i = 0; i < count && i < MOST_FIELDS; i++, given->count++)
        if (PyObject_GetBuffer(PyTuple_GetItem(fields, i), given->data + i, PyBUF_SIMPLE)) return false;
    return count > 0 && count == given->count;
}

static void release(Given *given) {
    Py_buffer *all[] = {&given->settings, &given->world, &given->following, &given->about,
                        &given->track, &given->index, &given->kept, &given->held};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) PyBuffer_Release(all[i]);
    for (int64_t i = 0; i < given->count; i++) PyBuffer_Release(given->data + i);
}

static Track track_in(double *numbers, int64_t targets) {
    return (Track){numbers, numbers + 3 * targets, numbers + 4 * targets, numbers + 7 * targets, numbers + TRACK * targets};
}

/* Numbers of a field in the array that its results keep, and in the one that is soon free again. */
static int64_t kept_numbers(const Engine *engine) { return BLOB_COLUMNS * engine->room + FOUND_NUMBERS * engine->world->targets; }
static int64_t held_numbers(const Engine *engine) {
    return 2 * HALF_COLUMNS * engine->room + (8 + TRACK) * engine->world->targets + TRACK_REST + (int64_t)(sizeof(Head) / sizeof(double));
}

static Way way_in(const Engine *engine, const Given *given, int64_t field) {
    int64_t targets = engine->world->targets, room = engine->room;
    int64_t *index = (int64_t *)given->index.buf + field * FOUND_INDICES * targets;
    double *kept = (double *)given->kept.buf + field * kept_numbers(engine), *held = (double *)given->held.buf + field * held_numbers(engine);
    double *halves = held + sizeof(Head) / sizeof(double), *expected = halves + 2 * HALF_COLUMNS * room, *predicted = expected + 3 * targets;
    return (Way){.head = (Head *)held, .blobs = kept, .half = {halves, halves + HALF_COLUMNS * room},
                 .found = found_in(index, kept + BLOB_COLUMNS * room, predicted, targets), .believed = index + 4 * targets,
                 .expected_mm = expected, .expected_sigma_mm = predicted + 4 * targets, .after = track_in(predicted + 5 * targets, targets)};
}

static bool are_predictors(const Predictors *kept, int64_t targets) {
    return kept && kept->smooth.targets == targets && kept->room > 0 && kept->next >= 0 && kept->next < kept->room;
}

static bool is_following(const Py_buffer *following, int64_t targets) {
    const Following *own = following->buf;
    return following->len == sizeof(Following) && own->identifying.world && own->identifying.world->targets == targets &&
           are_predictors(own->predictors, targets) && are_predictors(own->identifying.predictors, targets);
}

static bool fits(const Given *given, const Engine *engine) {
    int64_t targets = engine->world->targets;
    return engine->room >= 0 && engine->room < 1 << 24 && is_following(&given->following, targets) &&
           holds(&given->about, FIELD_NUMBERS * given->count, sizeof(double)) && holds(&given->track, TRACK * targets + TRACK_REST, sizeof(double)) &&
           holds(&given->index, FOUND_INDICES * targets * given->count, sizeof(int64_t)) &&
           holds(&given->kept, kept_numbers(engine) * given->count, sizeof(double)) &&
           holds(&given->held, held_numbers(engine) * given->count, sizeof(double));
}

/* Of a number that Python made of a whole one. */
static int64_t whole_of(double value) { return fabs(value) < 1e9 ? (int64_t)value : -1; }

/* Measures until a field needs Python; how many were done before it. */
static int64_t measure_fields(const Engine *engine, const Given *given, const GreyPicture *alike, double *scratch) {
    Track before = track_in(given->track.buf, engine->world->targets);
    for (int64_t i = 0; i < given->count; i++) {
        const double *about = (const double *)given->about.buf + FIELD_NUMBERS * i;
        Taken taken = {*alike, about[3]};
        Way way = way_in(engine, given, i);
        taken.picture.data = given->data[i].buf, taken.picture.length = given->data[i].len;
        taken.picture.parity = whole_of(about[0]), taken.picture.y0 = whole_of(about[1]), taken.picture.threshold = whole_of(about[2]);
        if (measure_field(engine, &taken, &before, &way, scratch) != DONE) return i;
        before = way.after;
    }
    return given->count;
}

static bool is_engine(const Given *given, int64_t bits, Engine *engine) {
    if (!is_world(&given->world) || given->settings.len != (Py_ssize_t)(bits == 1 ? sizeof(Settings) : sizeof(GreySettings))) return false;
    if (bits == 1) engine->binary = given->settings.buf;
    else engine->grey = given->settings.buf;
    engine->world = given->world.buf, engine->following = given->following.buf;
    return fits(given, engine);
}

/* measure(fields, (bits, rows, stride, columns, y_step), room, settings, world, following,
   track, (parity, y0, threshold, time passed) of each field, indices, kept numbers, held numbers)
   → how many fields were measured; the head of the next one says what it lacks */
PyObject *measure_of(PyObject *self, PyObject *arguments) {
    PyObject *fields;
    Given given = {0};
    GreyPicture alike = {0};
    Engine engine = {0};
    int64_t done = -1;
    (void)self;
    if (!PyArg_ParseTuple(arguments, "O!(LLLLL)Ly*y*w*y*y*w*w*w*", &PyTuple_Type, &fields, &alike.bits, &alike.rows, &alike.stride,
                          &alike.columns, &alike.y_step, &engine.room, &given.settings, &given.world,
                          &given.following, &given.track, &given.about, &given.index, &given.kept, &given.held))
        return NULL;
    bool sound = hold_fields(fields, &given) && is_engine(&given, alike.bits, &engine);
    double *scratch = sound ? malloc((size_t)(SCRATCH * engine.world->targets) * sizeof *scratch) : NULL;
    if (scratch) {
        Py_BEGIN_ALLOW_THREADS
        done = measure_fields(&engine, &given, &alike, scratch);
        Py_END_ALLOW_THREADS
    }
    free(scratch);
    release(&given);
    if (PyErr_Occurred()) return NULL;
    if (sound && !scratch) return PyErr_NoMemory();
    return sound ? PyLong_FromLongLong(done) : refused("arrays that do not belong together");
}
