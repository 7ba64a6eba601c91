"""Identification by the compiled kernel: numpy's hypotheses and their largest agreement, many times faster.

The kernel does not invert a matrix for every set of targets seen, but adds targets to the displacement field
and takes them away, one by one; it keeps the predictors that it has made in memory of ours.
"""

import ctypes
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from grabberd.core.geometry import Rig
from grabberd.core.kernel import DONE, MORE_ROOM, Kernel
from grabberd.core.reconstruction.correspondence.agreement import Agreement, Hypotheses, line_mm
from grabberd.core.reconstruction.correspondence.compiled_search import World, buffers
from grabberd.core.reconstruction.correspondence.displacement_field import DisplacementField, Expected
from grabberd.core.reconstruction.view_blobs import ImageNoise, ViewBlobs
from grabberd.errors import MeasurementError

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


Array = NDArray[np.float64]
Indices = NDArray[np.intp]
_ROOM = 2048
"""Number of hypotheses that most fields have room in."""


class Identifying(ctypes.Structure):
    """Inputs of identification by the kernel alone; keeps alive what it points to."""

    _fields_ = (
        ("world", _ADDRESS),
        ("predictors", _ADDRESS),
        ("trust", _REAL),
        ("margin", _REAL),
        ("pitch_mm", _REAL),
        ("covariance_mm2", _ADDRESS),
        ("gate_mm", _REAL),
        ("farthest_mm", _REAL),
    )
    kept: "tuple[Identification, Predictors]"


class Identification:
    """Identification of one object of few enough targets for a `DisplacementField`, as seen by one rig."""

    def __init__(self, kernel: Kernel, rig: Rig, agreement: Agreement, noise: ImageNoise) -> None:
        if not isinstance(agreement.field, DisplacementField):
            raise TypeError("the kernel does not identify by parts")
        self._kernel = kernel
        self._agreement = agreement
        self._world = World.of(rig, agreement, noise)
        self._gate_mm = agreement.settings.gate * line_mm(agreement.model, noise)
        self._displacements = agreement.field
        self._covariance_mm2 = np.ascontiguousarray(agreement.field.covariance_mm2)

    def in_c(self) -> "Identifying":
        """All of it, for the kernel's own use by one thread at a time: it writes into the predictors."""
        predictors = Predictors.of(self._displacements)
        settings = self._agreement.settings
        own = Identifying(
            ctypes.addressof(self._world),
            ctypes.addressof(predictors),
            settings.trust,
            settings.margin,
            self._agreement.pitch_mm,
            self._covariance_mm2.ctypes.data,
            self._gate_mm,
            settings.farthest_mm,
        )
        own.kept = self, predictors
        return own

    def expected(self, left: ViewBlobs, right: ViewBlobs) -> Expected | None:
        """Predict as `Correspondence.expected`.

        Raises:
            MeasurementError: There is not enough memory.
        """
        known = self.hypotheses(left, right)
        chosen, expected = self.largest(known, len(left), len(right))
        return expected if len(chosen) else None

    def hypotheses(self, left: ViewBlobs, right: ViewBlobs) -> Hypotheses:
        """List as `hypotheses.hypotheses`.

        Raises:
            MeasurementError: There is not enough memory.
        """
        room, status, count = _ROOM, MORE_ROOM, 0
        while status == MORE_ROOM:
            index, number = np.empty((3, room), np.int64), np.empty(6 * room)
            status, count = self._kernel.hypotheses(
                self._world,
                *buffers(left),
                *buffers(right),
                left.common_reach_px,
                self._gate_mm,
                self._agreement.settings.farthest_mm,
                index,
                number,
            )
            room, had = max(room, count), room
        _check(status, f"{len(left)} and {len(right)} blobs")
        target, of_left, of_right = index[:, :count]
        apart_mm, variance_mm2 = number.reshape(2, had, 3)[:, :count]
        return Hypotheses(target, of_left, of_right, apart_mm, variance_mm2)

    def largest(self, known: Hypotheses, left: int, right: int) -> tuple[Indices, Expected]:
        """Find as `Agreement.largest`, and what the set found says of all targets.

        Args:
            known: Hypotheses.
            left: Number of blobs in the left view.
            right: Number of blobs in the right view.

        Raises:
            MeasurementError: There is not enough memory.
        """
        targets, settings = len(self._agreement.model), self._agreement.settings
        chosen, expected_mm = np.empty(targets, np.int64), np.zeros((targets, 3))
        sigma_mm = np.zeros(targets)
        status, count = self._kernel.largest(
            self._world,
            self._covariance_mm2,
            settings.trust,
            settings.margin,
            self._agreement.pitch_mm,
            known.target,
            known.left,
            known.right,
            known.displacement_mm,
            known.variance_mm2,
            left,
            right,
            chosen,
            expected_mm,
            sigma_mm,
        )
        _check(status, f"{len(known)} hypotheses")
        return chosen[:count], Expected(expected_mm, sigma_mm)


def _check(status: int, of_what: str) -> None:
    if status != DONE:
        raise MeasurementError(f"not enough memory for {of_what}", "free some memory, or add more")
