/* A thick wall as Python functions: the liner science alone calls them. */
#include "module_python.h"

#include "wall.h"

static bool is_wall(const Py_buffer *values, const Py_buffer *rest, double shear_mpa, Wall *wall) {
    int64_t count = rest->len / ((FORMS + 1) * (Py_ssize_t)sizeof(double));
    *wall = (Wall){count, values->buf, rest->buf, shear_mpa};
    return holds(values, (DERIVATIVES - 1) * UNKNOWNS * count, sizeof(double));
}

/* wall_forces(values, rest, shear modulus, resistance, units): fills the last two */
PyObject *forces_of(PyObject *self, PyObject *arguments) {
    Py_buffer values, rest, resistance, units;
    Wall wall;
    double shear_mpa;
    bool sound = false;
    (void)self;
    if (!PyArg_ParseTuple(arguments, "y*y*dw*w*", &values, &rest, &shear_mpa, &resistance, &units)) return NULL;
    if (is_wall(&values, &rest, shear_mpa, &wall) && holds(&resistance, WORK * wall.count, sizeof(double)) &&
        holds(&units, WORK * UNIT_LOADS * wall.count, sizeof(double))) {
        sound = true;
        Py_BEGIN_ALLOW_THREADS
        wall_forces(&wall, resistance.buf, units.buf);
        Py_END_ALLOW_THREADS
    }
    Py_buffer *all[] = {&values, &rest, &resistance, &units};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) PyBuffer_Release(all[i]);
    return sound ? Py_BuildValue("") : refused("arrays that do not belong together");
}

/* wall_stiffness(values, rest, shear modulus, difference, contact, stiffness): fills the last one */
PyObject *stiffness_of(PyObject *self, PyObject *arguments) {
    Py_buffer values, rest, contact, stiffness;
    Wall wall;
    double shear_mpa, difference_mpa;
    bool sound = false;
    (void)self;
    if (!PyArg_ParseTuple(arguments, "y*y*ddy*w*", &values, &rest, &shear_mpa, &difference_mpa, &contact, &stiffness)) return NULL;
    if (is_wall(&values, &rest, shear_mpa, &wall) && holds(&contact, wall.count, sizeof(double)) &&
        holds(&stiffness, WORK * WORK * wall.count, sizeof(double))) {
        sound = true;
        Py_BEGIN_ALLOW_THREADS
        wall_stiffness(&wall, difference_mpa, contact.buf, stiffness.buf);
        Py_END_ALLOW_THREADS
    }
    Py_buffer *all[] = {&values, &rest, &contact, &stiffness};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++) PyBuffer_Release(all[i]);
    return sound ? Py_BuildValue("") : refused("arrays that do not belong together");
}
