/* The kernel as a Python module, by the limited API: buffers in, buffers filled. Every length is checked here. */
#include "module_python.h"

#include "module.h"

PyObject *refused(const char *what) {
    PyErr_Format(PyExc_ValueError, "the compiled kernel was given %s", what);
    return NULL;
}

/* locate(bits, (rows, stride, columns, parity, y0, y_step), settings, out)
   → status, count, reach, what is missing (four numbers) */
static PyObject *locate(PyObject *self, PyObject *arguments) {
    Py_buffer bits, settings, out;
    Picture picture = {0};
    Outcome outcome = {0};
    int status = REFUSED;
    (void)self;
    if (!PyArg_ParseTuple(arguments, "y*(LLLLLL)y*w*", &bits, &picture.rows, &picture.stride, &picture.columns,
                          &picture.parity, &picture.y0, &picture.y_step, &settings, &out))
        return NULL;
    picture.bits = bits.buf, picture.length = bits.len;
    if (settings.len == sizeof(Settings)) {
        Py_BEGIN_ALLOW_THREADS
        status = grabberd_locate(&picture, settings.buf, out.buf, out.len / (9 * (int64_t)sizeof(double)), &outcome);
        Py_END_ALLOW_THREADS
    }
    PyBuffer_Release(&bits);
    PyBuffer_Release(&settings);
    PyBuffer_Release(&out);
    return Py_BuildValue("iLddddd", status, (long long)outcome.count, outcome.common_reach_px, outcome.missing[0],
                         outcome.missing[1], outcome.missing[2], outcome.missing[3]);
}

/* locate_grey(data, (bits, rows, stride, columns, parity, y0, y_step, threshold), settings, out)
   → status, count, reach, jitter */
static PyObject *locate_grey(PyObject *self, PyObject *arguments) {
    Py_buffer data, settings, out;
    GreyPicture picture = {0};
    GreyOutcome outcome = {0};
    int status = REFUSED;
    (void)self;
    if (!PyArg_ParseTuple(arguments, "y*(LLLLLLLL)y*w*", &data, &picture.bits, &picture.rows, &picture.stride, &picture.columns,
                          &picture.parity, &picture.y0, &picture.y_step, &picture.threshold, &settings, &out))
        return NULL;
    picture.data = data.buf, picture.length = data.len;
    if (settings.len == sizeof(GreySettings)) {
        Py_BEGIN_ALLOW_THREADS
        status = grabberd_locate_grey(&picture, settings.buf, out.buf, out.len / (9 * (int64_t)sizeof(double)), &outcome);
        Py_END_ALLOW_THREADS
    }
    PyBuffer_Release(&data);
    PyBuffer_Release(&settings);
    PyBuffer_Release(&out);
    return Py_BuildValue("iLdd", status, (long long)outcome.count, outcome.common_reach_px, outcome.jitter_px);
}

static PyMethodDef FUNCTIONS[] = {{"locate", locate, METH_VARARGS, "Blobs of a packed field of 1 bit."},
                                  {"locate_grey", locate_grey, METH_VARARGS, "Blobs of a packed field of more bits."},
                                  {"measure", measure_of, METH_VARARGS, "Fields to points, as far as there are tables and room."},
                                  {"near", near_of, METH_VARARGS, "Targets near where they must be, and their points."},
                                  {"agree", agree_of, METH_VARARGS, "Whether targets agree, and where all of them are."},
                                  {"hypotheses", hypotheses_of, METH_VARARGS, "Pairs of blobs that may be a target."},
                                  {"largest", largest_of, METH_VARARGS, "The largest set of hypotheses that agree."},
                                  {"centres", centres_of, METH_VARARGS, "Centres of discs, from the middles of their pictures."},
                                  {"precision", precision_of, METH_VARARGS, "Inverse of the covariance of displacements."},
                                  {"predictor", predictor_of_seen, METH_VARARGS, "What some targets tell of all."},
                                  {"pack", pack_of, METH_VARARGS, "A field, doubled, quantised and packed."},
                                  {"take", take_of, METH_VARARGS, "A field, copied, looked at and packed."},
                                  {"shifted", shifted_of, METH_VARARGS, "Where and how far rows of a field may be shifted."},
                                  {"wall_forces", forces_of, METH_VARARGS, "Resistance of a thick wall, and work of unit loads."},
                                  {"wall_stiffness", stiffness_of, METH_VARARGS, "Stiffness of a loaded thick wall."},
                                  {NULL, NULL, 0, NULL}};

/* Changed with every function and structure that Python sees (kernel.LAYOUT). */
enum { LAYOUT = 10 };

static int fill(PyObject *module) { return PyModule_AddIntConstant(module, "LAYOUT", LAYOUT); }

static PyModuleDef_Slot SLOTS[] = {{Py_mod_exec, fill}, {0, NULL}};

static struct PyModuleDef MODULE = {PyModuleDef_HEAD_INIT, "_kernel", "What takes most of a field's time, compiled.", 0,
                                    FUNCTIONS, SLOTS, NULL, NULL, NULL};

PyMODINIT_FUNC PyInit__kernel(void) { return PyModuleDef_Init(&MODULE); }
