"""Location over a run of fields: the blobs of each view, and the sizes of targets that the rig lets be
expected.
"""

import math
import sys
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np

from grabberd.core.arrays import Array, Mask
from grabberd.core.field import PackedField
from grabberd.core.geometry import Calibration, LocalField, NominalRig, View
from grabberd.core.measurement import Blobs, LocationSettings, measure
from grabberd.core.measurement.location import settings_for
from grabberd.core.reconstruction import ViewBlobs
from grabberd.errors import MeasurementError

JITTERS, JITTER_EVERY = 9, 25
"""The line jitter is the median of the last nine estimates. It belongs to the equipment and hardly changes,
so that after the first nine fields only every 25th is used for a new estimate."""


class Locating:
    """Location of each field's blobs; line jitter, a property of the equipment, is seldom re-estimated.

    Attributes:
        settings: For the next field.
    """

    def __init__(self, settings: LocationSettings, line_jitter_px: float) -> None:
        self._estimating = replace(settings, line_jitter_px=line_jitter_px)
        self.settings = self._settled = self._estimating
        self._fields = 0
        self._jitters_px: deque[float] = deque(maxlen=JITTERS)

    def alike(self, packed: PackedField) -> int:
        """Number of fields like the next one, from it on, that have its settings whatever is seen in them."""
        own = settings_for(packed, self._estimating)
        if packed.bits == 1 or not own.line_jitter_px or own.line_shifts is False:
            return sys.maxsize
        return 1 if self._due else JITTER_EVERY - self._fields % JITTER_EVERY

    def blobs(self, packed: PackedField) -> Blobs:
        """Blobs of the next field."""
        blobs = measure(packed, None, self.settings)
        self.note(blobs)
        return blobs

    def note(self, blobs: Blobs) -> None:
        """Take over what the next field's blobs, located with its settings, tell of the equipment."""
        self._fields += 1
        if blobs.line_jitter_px is not None:
            self._jitters_px.append(blobs.line_jitter_px)
            likely_px = float(np.median(self._jitters_px))
            self._settled = replace(self._estimating, line_jitter_px=likely_px, line_jitter_known=True)
        self.settings = self._estimating if self._due else self._settled

    @property
    def _due(self) -> bool:
        return len(self._jitters_px) < JITTERS or self._fields % JITTER_EVERY == 0


def whole_views(blobs: Blobs, calibration: Calibration) -> tuple[ViewBlobs, ViewBlobs]:
    """Whole blobs of the left and of the right view of a calibration."""
    halves = zip(calibration.views, calibration.local_fields, strict=True)
    left, right = (whole_blobs(blobs, view, local_field) for view, local_field in halves)
    return left, right


def whole_blobs(blobs: Blobs, view: View, local_field: LocalField | None = None) -> ViewBlobs:
    """Blobs of a view without those cut off by the field's edge or the seam, whose centres are false.

    The view's local field, known displacements beyond the model, is subtracted.
    """
    own = whole(blobs, view.first_column, view.end_column)
    xy_px = blobs.xy_px[own]
    # Taken off the blobs rather than added to the functional model: equations (4) to (7) stay as printed, and
    # a rig without a local field pays nothing for it.
    if local_field is not None:
        xy_px = xy_px - local_field.at(xy_px)
    return ViewBlobs(xy_px, blobs.sigma_px[own], blobs.common_px[own], blobs.common_reach_px)


def whole(blobs: Blobs, first_column: int, end_column: int) -> Mask:
    """(N,) True for blobs that lie wholly within the columns."""
    x, half = blobs.xy_px[:, 0], blobs.width_px / 2
    inside = (x - half >= first_column - 0.5) & (x + half <= end_column - 0.5)
    return inside & ~blobs.at_border


Halves = Sequence[tuple[int, int]]

LEAST, MOST = 0.43, 2.6
"""Limits of a blob's diameter, over the expected one: between them are discs that lean by 75 degrees, and
those that spread and a low threshold make twice as wide, on a rig that is known to ten per cent."""
LEAST_PX = 1.7
"""Whatever is expected, a single pixel of a field (1.6 px, as it stands for two lines) is no target."""
FEW = 12
"""Blobs of a target's size that a view shows at least if its sizes are right."""
HINT = (
    "check target_diameter_mm in the file, and focal length, distance and pixel pitch of the rig; or state "
    "targets: {least_mm: …, most_mm: …} for the device in the configuration"
)
_EVERYTHING = LocationSettings(
    method="centroid", min_diameter_px=0.0, max_diameter_px=math.inf, line_jitter_px=0.0, line_shifts=False
)
_USUAL = (5, 95)
"""Percentiles between which the sizes found are told: a few blobs of any size are in every picture."""


def px_per_mm(rig: NominalRig) -> float:
    """Scale of the picture at the object's origin, as the rig was built; mean of columns and lines."""
    away_mm = math.hypot(rig.distance_mm, rig.base_mm / 2)
    return rig.focal_length_mm / away_mm / math.sqrt(rig.pixel_x_mm * rig.pixel_y_mm)


def px_per_mm_of(views: Sequence[View]) -> float:
    """The same, mean of calibrated views."""
    scales = [
        view.f_mm / float(np.linalg.norm(view.center_mm)) / math.sqrt(view.pixel_x_mm * view.pixel_y_mm)
        for view in views
    ]
    return float(np.mean(scales))


def sized(location: LocationSettings, scale: float, target_diameter_mm: float) -> LocationSettings:
    """The same settings with limits of a blob's diameter that suit the targets; limits that are set stand.

    Args:
        location: Settings of target location.
        scale: Pixels for a millimetre on the object.
        target_diameter_mm: Diameter of the discs.
    """
    expected_px = scale * target_diameter_mm
    return location.limited(max(LEAST * expected_px, LEAST_PX), max(MOST * expected_px, 2 * LEAST_PX))


@dataclass(frozen=True, slots=True)
class OtherSizes:
    """Blobs that are no targets for their size, in the views of one field.

    Attributes:
        packed: The field.
        halves: First and end column of the left and of the right view.
        location: Settings that it was located with.
        scale: Pixels for a millimetre on the object.
    """

    packed: PackedField
    halves: Halves
    location: LocationSettings
    scale: float

    @contextmanager
    def told(self) -> Iterator[None]:
        """Tell the sizes found with a failure, if a view shows hardly any of a target's.

        Raises:
            MeasurementError: In place of the one raised within.
        """
        try:
            yield
        except MeasurementError as error:
            if (found := self.in_words()) is None:
                raise
            raise MeasurementError(found, HINT) from error

    def in_words(self) -> str | None:
        """Describe what one of the views shows instead of targets; None if both show some."""
        blobs = measure(self.packed, None, _EVERYTHING)
        diameter_px = np.sqrt(4 / np.pi * blobs.area_px)
        least_px, most_px = self.location.limits_px
        for name, half in zip(("left", "right"), self.halves, strict=True):
            own = diameter_px[whole(blobs, *half)]
            own = own[own > LEAST_PX]
            right = int(((own >= least_px) & (own <= most_px)).sum())
            if right < min(FEW, len(own) - right):
                return (
                    f"the {name} view shows {len(own)} blobs of {self._range(own)} in diameter, and "
                    f"{right or 'none'} of a target's size, {self._span(least_px, most_px)}"
                )
        return None

    def _range(self, diameter_px: Array) -> str:
        least_px, most_px = np.percentile(diameter_px, _USUAL).tolist()
        return self._span(least_px, most_px)

    def _span(self, least_px: float, most_px: float) -> str:
        least_mm, most_mm = least_px / self.scale, most_px / self.scale
        return f"{least_px:.1f} to {most_px:.1f} px ({least_mm:.2f} to {most_mm:.2f} mm on the object)"
