/* What the files of the Python module share. */
#ifndef GRABBERD_MODULE_PYTHON_H
#define GRABBERD_MODULE_PYTHON_H

#define PY_SSIZE_T_CLEAN
#define Py_LIMITED_API 0x030B0000
#include <Python.h>
#include <stdbool.h>
#include <stdint.h>

PyObject *refused(const char *what); /* sets a ValueError; NULL */
PyObject *pack_of(PyObject *self, PyObject *arguments);
PyObject *take_of(PyObject *self, PyObject *arguments);
PyObject *shifted_of(PyObject *self, PyObject *arguments);
PyObject *measure_of(PyObject *self, PyObject *arguments);
PyObject *near_of(PyObject *self, PyObject *arguments);
PyObject *agree_of(PyObject *self, PyObject *arguments);
PyObject *hypotheses_of(PyObject *self, PyObject *arguments);
PyObject *largest_of(PyObject *self, PyObject *arguments);
PyObject *centres_of(PyObject *self, PyObject *arguments);
PyObject *precision_of(PyObject *self, PyObject *arguments);
PyObject *predictor_of_seen(PyObject *self, PyObject *arguments);
PyObject *forces_of(PyObject *self, PyObject *arguments);
PyObject *stiffness_of(PyObject *self, PyObject *arguments);

bool is_world(const Py_buffer *world); /* a World that is sound in itself */

static inline bool holds(const Py_buffer *buffer, int64_t count, size_t size) {
    return count >= 0 && (uint64_t)buffer->len / size >= (uint64_t)count;
}

#endif
