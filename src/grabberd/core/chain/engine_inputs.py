"""The engine's inputs beside the fields and the track: what location needs, and what tracking needs."""

import ctypes
from collections.abc import Sequence

from grabberd.core.chain.engine_way import Head
from grabberd.core.field import PackedField
from grabberd.core.geometry import View
from grabberd.core.kernel import NO_FULLNESS, NO_TABLE
from grabberd.core.measurement import LocationSettings
from grabberd.core.measurement.compiled.binary_location import Kept, fail, known_of
from grabberd.core.measurement.compiled.grey_location import grey_settings
from grabberd.core.measurement.location import settings_for
from grabberd.core.reconstruction import Tracker
from grabberd.core.reconstruction.correspondence.compiled_identification import Identifying
from grabberd.core.reconstruction.correspondence.compiled_predictors import Predictors
from grabberd.core.reconstruction.correspondence.displacement_field import DisplacementField

_REAL, _ADDRESS = ctypes.c_double, ctypes.c_void_p


class Following(ctypes.Structure):
    """Settings of tracking and identification, and the views' columns; keeps alive what it points to."""

    _fields_ = (
        ("columns", _REAL * 4),
        ("speed_mm_s", _REAL),
        ("longest_gap_s", _REAL),
        ("least_share", _REAL),
        ("astray_mm", _REAL),
        ("otherwise_mm", _REAL),
        ("acceleration_mm_s2", _REAL),
        ("vague_mm", _REAL),
        ("firm_mm", _REAL),
        ("predictors", _ADDRESS),
        ("identifying", Identifying),
    )
    kept: tuple[Predictors, Identifying]

    @classmethod
    def of(cls, tracker: Tracker, views: Sequence[View]) -> "Following":
        """Fill it in for a tracker whose targets the kernel identifies."""
        known, limits, judges = tracker.settings, tracker.limits, tracker.correspondence
        assert judges.identification is not None
        assert isinstance(judges.following.field, DisplacementField)
        predictors, identifying = Predictors.of(judges.following.field), judges.identification.in_c()
        columns = [edge for view in views for edge in (view.first_column, view.end_column)]
        own = cls(
            (_REAL * 4)(*columns),
            known.speed_mm_s,
            known.longest_gap_s,
            known.least_share,
            known.astray_mm,
            limits.otherwise_mm,
            known.acceleration_mm_s2,
            limits.vague_mm,
            limits.firm_mm,
            ctypes.addressof(predictors),
            identifying,
        )
        own.kept = predictors, identifying
        return own


class Inputs:
    """Inputs of location beside the fields of one kind."""

    settings: ctypes.Structure

    def __init__(self, packed: PackedField, settings: LocationSettings) -> None:
        self.picture, self._lines_apart = _picture(packed), packed.lines_apart
        self._of = settings
        own = settings_for(packed, settings)
        self._known = known_of(own, packed.y_step, packed.lines_apart) if packed.bits == 1 else None
        if self._known is None:
            self.settings = grey_settings(own)

    def fits(self, packed: PackedField, settings: LocationSettings) -> bool:
        """True if these are the inputs for a field and settings."""
        same_lines = self._lines_apart == packed.lines_apart
        return self._of is settings and self.picture == _picture(packed) and same_lines

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
        missing = head.wide, head.high, head.fraction, head.noise
        self._add(self._known.completed(self._kept, int(head.status), missing))

    def _add(self, kept: Kept) -> None:
        self._kept, self.settings = kept, kept.settings


def _picture(packed: PackedField) -> tuple[int, int, int, int, int]:
    _, rows, stride = packed.data.shape
    return packed.bits, rows, stride, packed.columns, packed.y_step
