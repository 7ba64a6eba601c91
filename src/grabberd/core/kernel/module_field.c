/* What the module offers for fields on their way into the ring. Every length is checked here. */
#include "module_python.h"

#include "field.h"

/* The lines of a field, in whatever strides its buffer has them. */
static bool are_lines(PyObject *object, Py_buffer *view, Lines *lines) {
    if (PyObject_GetBuffer(object, view, PyBUF_STRIDED_RO)) return false;
    if (view->ndim == 2 && view->itemsize == 1 && view->shape[0] > 0 && view->shape[0] <= LONGEST_SIDE && view->shape[1] > 0 &&
        view->shape[1] <= LONGEST_SIDE) {
        *lines = (Lines){view->buf, view->shape[0], view->shape[1], view->strides[0], view->strides[1]};
        return true;
    }
    PyBuffer_Release(view);
    refused("lines that are no rows of bytes");
    return false;
}

static bool is_packing(const Lines *lines, Packing *packing, const Py_buffer *map, const Py_buffer *out) {
    int64_t bits = packing->bits, rows = packed_rows(lines, packing);
    packing->map = map->len ? map->buf : NULL, packing->out = out->buf;
    if (!(bits == 8 || (bits >= 1 && bits <= 6)) || (packing->parity != 0 && packing->parity != 1)) return false;
    if (packing->doubled && lines->rows < 2) return false;
    if (packing->map && (bits != 1 || map->len != rows * lines->columns)) return false;
    return out->len == (bits == 8 ? rows * lines->columns : bits * rows * words_of(lines->columns));
}

static PyObject *done(int status, const Findings *findings) {
    if (status == NO_MEMORY) return PyErr_NoMemory();
    if (status == REFUSED) return refused("arrays that do not belong together");
    return Py_BuildValue("LLL", (long long)findings->made_up, (long long)findings->first, (long long)findings->last);
}

/* pack(lines, (bits, doubled, smoothed, parity, threshold), map or nothing, out): fills the last one */
PyObject *pack_of(PyObject *self, PyObject *arguments) {
    PyObject *object;
    Py_buffer view, map, out;
    Lines lines;
    Packing packing = {0};
    int status = REFUSED;
    (void)self;
    if (!PyArg_ParseTuple(arguments, "O(LLLLL)y*w*", &object, &packing.bits, &packing.doubled, &packing.smoothed, &packing.parity,
                          &packing.threshold, &map, &out))
        return NULL;
    bool sound = are_lines(object, &view, &lines);
    if (sound && is_packing(&lines, &packing, &map, &out)) {
        Py_BEGIN_ALLOW_THREADS
        status = pack_field(&lines, &packing);
        Py_END_ALLOW_THREADS
    }
    if (sound) PyBuffer_Release(&view);
    PyBuffer_Release(&map);
    PyBuffer_Release(&out);
    return sound ? done(status, &(Findings){0, -1, -1}) : NULL;
}

/* Its parts stand in one array (content_check.StaleRows). */
static bool is_look(const Lines *lines, const Py_buffer *copy, const Py_buffer *good, const Py_buffer *memory, const Py_buffer *means,
                    Look *look) {
    int64_t rows = lines->rows, count = words_of(lines->columns), size = (Py_ssize_t)sizeof(uint64_t);
    uint64_t *at = memory->buf;
    look->words = copy->buf, look->good = good->len ? good->buf : NULL, look->means = means->buf, look->weights = at;
    look->seen = at + count, look->learned = (int64_t *)(look->seen + REMEMBERED * rows);
    look->hashes = look->seen + (REMEMBERED + LEARNED) * rows, look->differing = (int64_t *)(look->hashes + rows);
    return copy->len == size * rows * count && (!good->len || good->len == copy->len) &&
           memory->len == size * (count + (REMEMBERED + LEARNED + 2) * rows) && look->place >= 0 && look->place < REMEMBERED &&
           means->len == (Py_ssize_t)sizeof(int16_t) * (rows / BLOCK_ROWS) * (lines->columns / BIN_COLUMNS);
}

/* take(lines, (bits, doubled, smoothed, parity, threshold), map or nothing, out, copy, good one or nothing, memory, place, means)
   → what the grabber draws, first and last stale row; fills `out`, copy, memory and means */
PyObject *take_of(PyObject *self, PyObject *arguments) {
    PyObject *object;
    Py_buffer view, map, out, copy, good, memory, means;
    Lines lines;
    Packing packing = {0};
    Look look = {0};
    Findings findings = {0, -1, -1};
    long long place;
    int status = REFUSED;
    (void)self;
    if (!PyArg_ParseTuple(arguments, "O(LLLLL)y*w*w*y*w*Lw*", &object, &packing.bits, &packing.doubled, &packing.smoothed,
                          &packing.parity, &packing.threshold, &map, &out, &copy, &good, &memory, &place, &means))
        return NULL;
    look.place = place;
    bool sound = are_lines(object, &view, &lines);
    if (sound && is_packing(&lines, &packing, &map, &out) && is_look(&lines, &copy, &good, &memory, &means, &look)) {
        Py_BEGIN_ALLOW_THREADS
        status = take_field(&lines, &packing, &look, &findings);
        Py_END_ALLOW_THREADS
    }
    if (sound) PyBuffer_Release(&view);
    Py_buffer *all[] = {&map, &out, &copy, &good, &memory, &means};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) PyBuffer_Release(all[i]);
    return sound ? done(status, &findings) : NULL;
}

static bool are_profiles(const Py_buffer *buffer, long long blocks, long long bins, Profiles *profiles) {
    *profiles = (Profiles){buffer->buf, blocks, bins};
    if (blocks < 0 || blocks > LONGEST_SIDE / BLOCK_ROWS || bins < 0 || bins > LONGEST_SIDE / BIN_COLUMNS) return false;
    if (buffer->len != (Py_ssize_t)sizeof(int16_t) * blocks * bins) return false;
    for (int64_t i = 0; i < blocks * bins; i++)
        if (profiles->means[i] & ~UINT8_MAX) return false;
    return true;
}

/* shifted(means, earlier means, blocks, bins) → the first shifted block, or −1, and by how many bins to the right */
PyObject *shifted_of(PyObject *self, PyObject *arguments) {
    Py_buffer one, other;
    Profiles now, then;
    Coarse coarse = {-1, 0};
    long long blocks, bins;
    (void)self;
    if (!PyArg_ParseTuple(arguments, "y*y*LL", &one, &other, &blocks, &bins)) return NULL;
    bool sound = are_profiles(&one, blocks, bins, &now) && are_profiles(&other, blocks, bins, &then);
    if (sound) {
        Py_BEGIN_ALLOW_THREADS
        coarse = coarse_shift(&now, &then);
        Py_END_ALLOW_THREADS
    }
    PyBuffer_Release(&one);
    PyBuffer_Release(&other);
    return sound ? Py_BuildValue("LL", (long long)coarse.block, (long long)coarse.bins) : refused("arrays that do not belong together");
}
