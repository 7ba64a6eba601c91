"""Sizes of targets in the picture: what the rig lets be expected, and what was found instead."""

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grabberd.core.chain.locating import whole
from grabberd.core.field import PackedField
from grabberd.core.geometry import NominalRig, View
from grabberd.core.measurement import LocationSettings, measure
from grabberd.errors import MeasurementError

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

    def _range(self, diameter_px: NDArray[np.float64]) -> str:
        least_px, most_px = np.percentile(diameter_px, _USUAL).tolist()
        return self._span(least_px, most_px)

    def _span(self, least_px: float, most_px: float) -> str:
        least_mm, most_mm = least_px / self.scale, most_px / self.scale
        return f"{least_px:.1f} to {most_px:.1f} px ({least_mm:.2f} to {most_mm:.2f} mm on the object)"
