/* What the files of the Python module share. */
#ifndef GRABBERD_MODULE_PYTHON_H
#define GRABBERD_MODULE_PYTHON_H

#define PY_SSIZE_T_CLEAN
#define Py_LIMITED_API 0x030B0000
#include <Python.h>

PyObject *refused(const char *what); /* sets a ValueError; NULL */
PyObject *pack_of(PyObject *self, PyObject *arguments);
PyObject *take_of(PyObject *self, PyObject *arguments);
PyObject *shifted_of(PyObject *self, PyObject *arguments);

#endif
