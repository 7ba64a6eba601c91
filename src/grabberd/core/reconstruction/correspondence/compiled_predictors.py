"""Predictors of targets by the compiled kernel, which keeps those that it has made in memory of ours."""

import ctypes
from typing import Any, Self

import numpy as np

from grabberd.core.reconstruction.correspondence.displacement_field import DisplacementField

MOST_PREDICTORS = 32
MOST_BYTES = 16 << 20
"""Size of the predictors kept at most; at least two are, whatever their size."""
_WHOLE, _REAL, _ADDRESS = ctypes.c_int64, ctypes.c_double, ctypes.c_void_p


class Predictors(ctypes.Structure):
    """Predictors of one displacement field; keeps alive the arrays that it points to.

    From field to field mostly the same targets are seen, so that few have to be made.
    """

    _fields_ = (
        ("targets", _WHOLE),
        ("noise_mm2", _REAL),
        ("covariance_mm2", _ADDRESS),
        ("precision", _ADDRESS),
        ("room", _WHOLE),
        ("next", _WHOLE),
        ("count", _ADDRESS),
        ("seen", _ADDRESS),
        ("weights", _ADDRESS),
        ("sigma_mm", _ADDRESS),
    )
    kept: list[Any]

    @classmethod
    def of(cls, field: DisplacementField) -> Self:
        """Make room for some; none has been made yet."""
        targets = len(field.precision)
        room = min(max(MOST_BYTES // (8 * targets * targets), 2), MOST_PREDICTORS)
        made = [
            np.full(room, -1, np.int64),
            np.empty((room, targets), np.int64),
            np.empty((room, targets, targets)),
            np.empty((room, targets)),
        ]
        given = [np.ascontiguousarray(one) for one in (field.covariance_mm2, field.precision)]
        own = cls(
            targets,
            field.noise_mm**2,
            *(one.ctypes.data for one in given),
            room,
            0,
            *(one.ctypes.data for one in made),
        )
        own.kept = [*given, *made]
        return own
