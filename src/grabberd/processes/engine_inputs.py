"""The engine's inputs beside the fields and the track: what location needs, and what tracking needs."""

import ctypes
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from grabberd.field import PackedField
from grabberd.geometry import View
from grabberd.kernel import NO_FULLNESS, NO_TABLE
from grabberd.measurement import LocationSettings
from grabberd.measurement.compiled.binary_location import Kept, fail, known_of
from grabberd.measurement.compiled.grey_location import grey_settings
from grabberd.processes.engine_way import Head
from grabberd.reconstruction import Tracker
from grabberd.reconstruction.correspondence.displacement_field import DisplacementField, Say

Indices = NDArray[np.intp]

_MOST_SAYS = 32
_WHOLE, _REAL, _ADDRESS = ctypes.c_int64, ctypes.c_double, ctypes.c_void_p


class _Say(ctypes.Structure):
    _fields_ = (("seen", _ADDRESS), ("count", _WHOLE), ("weights", _ADDRESS), ("sigma_mm", _ADDRESS))


class Following(ctypes.Structure):
    """Settings of tracking, the views' columns, and the predictors made so far."""

    _fields_ = (
        ("columns", _REAL * 4),
        ("longest_gap_s", _REAL),
        ("least_share", _REAL),
        ("astray_mm", _REAL),
        ("otherwise_mm", _REAL),
        ("acceleration_mm_s2", _REAL),
        ("vague_mm", _REAL),
        ("firm_mm", _REAL),
        ("says", _ADDRESS),
        ("say_count", _WHOLE),
    )

    @classmethod
    def of(cls, tracker: Tracker, views: Sequence[View]) -> "Following":
        """Fill in what stays; there are no predictors yet."""
        known, limits = tracker.settings, tracker.limits
        columns = [edge for view in views for edge in (view.first_column, view.end_column)]
        return cls(
            (_REAL * 4)(*columns),
            known.longest_gap_s,
            known.least_share,
            known.astray_mm,
            limits.otherwise_mm,
            known.acceleration_mm_s2,
            limits.vague_mm,
            limits.firm_mm,
        )


class Predictors:
    """Predictors of all targets from those seen, as far as they have been made.

    Attributes:
        says: The predictors.
    """

    def __init__(self, field: DisplacementField) -> None:
        self.says: list[Say] = []
        self._field = field
        self._seen: list[Indices] = []

    def add(self, seen: Indices, following: Following) -> None:
        """Add the one for those seen, and tell the kernel."""
        if len(self.says) >= _MOST_SAYS:
            self.says.clear()
            self._seen.clear()
        self.says.append(self._field.say(seen))
        self._seen.append(seen.copy())
        of_them = [_say(*both) for both in zip(self.says, self._seen, strict=True)]
        self._in_c = (_Say * len(of_them))(*of_them)
        following.says, following.say_count = ctypes.addressof(self._in_c), len(of_them)


def _say(say: Say, seen: Indices) -> _Say:
    return _Say(seen.ctypes.data, len(seen), say.weights.T.ctypes.data, say.sigma_mm.ctypes.data)


class Inputs:
    """Inputs of location beside the fields of one kind."""

    settings: ctypes.Structure

    def __init__(self, packed: PackedField, settings: LocationSettings) -> None:
        self.picture = _picture(packed)
        self._of = settings
        self._known = known_of(settings, packed.y_step) if packed.bits == 1 else None
        if self._known is None:
            self.settings = grey_settings(settings)

    def fits(self, packed: PackedField, settings: LocationSettings) -> bool:
        """True if these are the inputs for a field and settings."""
        return self._of is settings and self.picture == _picture(packed)

    def begin(self) -> None:
        """Take up the tables made so far."""
        if self._known is not None:
            self._add(self._known.begin())

    def complete(self, packed: PackedField, head: Head) -> None:
        """Add the table that the kernel lacks.

        Raises:
            MeasurementError: It lacks none, but memory, or refuses the picture.
        """
        if self._known is None or head.status not in (NO_TABLE, NO_FULLNESS):
            fail(int(head.status), packed)
        missing = head.wide, head.high, head.fraction
        self._add(self._known.completed(self._kept, int(head.status), missing))

    def _add(self, kept: Kept) -> None:
        self._kept, self.settings = kept, kept.settings


def _picture(packed: PackedField) -> tuple[int, int, int, int, int]:
    _, rows, stride = packed.data.shape
    return packed.bits, rows, stride, packed.columns, packed.y_step
