"""Input and output of locators."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.field import BIT_DEPTHS, PackedField
from grabberd.core.measurement.background import background_in
from grabberd.core.measurement.labelling.runs import Runs
from grabberd.core.measurement.labelling.shapes import Shapes, binary_centres
from grabberd.core.measurement.settings import LocationSettings
from grabberd.errors import InputError

GREY = tuple(bits for bits in BIT_DEPTHS if bits > 1)
"""Bit depths of the locators that need grey values."""
ALL_BUT_THE_TALLEST = 0.95
"""Share of blobs whose chords all fit when they are trimmed: one tall blob would make every array tall."""
TALLEST = 2.0
"""Height of a blob, in largest diameters, beyond which it is no target."""


@dataclass(frozen=True, eq=False)
class Seen:
    """The N connected components of one field, before location.

    Attributes:
        packed: The field.
        runs: R runs of pixels above the threshold, ordered by component, row and column.
        label: (R,) int64, component of every run.
        shapes: Size and extent of every component, in the field's own columns and rows.
        settings: Settings of target location.
    """

    packed: PackedField
    runs: Runs
    label: NDArray[np.int64]
    shapes: Shapes
    settings: LocationSettings

    @cached_property
    def area_px(self) -> NDArray[np.float64]:
        """(N,) float64, size above the threshold in square frame pixels."""
        return self.shapes.pixels.astype(np.float64) * self.packed.y_step

    @cached_property
    def centroids(self) -> NDArray[np.float64]:
        """(N, 2) float64 column and row of each centre, with pixels above the threshold weighted equally."""
        return binary_centres(self.runs, self.label, len(self.shapes))

    @cached_property
    def of_size(self) -> NDArray[np.bool_]:
        """(N,) bool, True for components neither too small nor too large for a target."""
        diameter = np.sqrt(4 / np.pi * self.area_px)
        least_px, most_px = self.settings.limits_px
        return (diameter >= least_px) & (diameter <= most_px)

    @cached_property
    def low(self) -> NDArray[np.bool_]:
        """(N,) bool, True for those that are not too tall either: tall ones are costly and no targets."""
        height_px = (self.shapes.last_row - self.shapes.first_row + 1) * self.packed.y_step
        return self.of_size & (height_px <= TALLEST * self.settings.limits_px[1])


class Chords(NamedTuple):
    """Chords of N blobs on at most h delivered lines each, from which the shifts of whole lines can be found.

    Attributes:
        blob: (N,) int64, the component of each.
        line: (N,) int64, field line of its first chord, whatever the packed field's rows are.
        centre: (N, h) float64, middle of each chord, columns.
        weight: (N, h) float64, 1/σ² of that in px⁻²; 0 where there is no chord.
        share: (N, h) float64, derivative of the located x by the shift of that line, which need not have a
            chord.
    """

    blob: NDArray[np.int64]
    line: NDArray[np.int64]
    centre: NDArray[np.float64]
    weight: NDArray[np.float64]
    share: NDArray[np.float64]

    def trimmed(self, wanted: NDArray[np.bool_]) -> "Chords":
        """Keep as few lines as hold the wanted ones, (N, h) bool; only the tallest blobs lose some of
        theirs.
        """
        if not wanted.any():
            return self
        first, height = wanted.argmax(axis=1), wanted.shape[1]
        tall = np.sort(height - wanted[:, ::-1].argmax(axis=1) - first)
        count = int(tall[int(ALL_BUT_THE_TALLEST * (len(tall) - 1))])
        first = np.minimum(first, height - count)
        kept = first[:, np.newaxis] + np.arange(count)
        centre, weight, share = (
            np.take_along_axis(one, kept, axis=1) for one in (self.centre, self.weight, self.share)
        )
        return Chords(self.blob, self.line + first, centre, weight, share)


class Located(NamedTuple):
    """Positions of the N components of a field.

    Attributes:
        centres: (N, 2) float64, in the field's own columns and rows.
        sigma_px: (N, 2) float64, x and y, frame pixels.
        chords: Chords for estimating the shifts of lines, from locators that have them.
    """

    centres: NDArray[np.float64]
    sigma_px: NDArray[np.float64]
    chords: Chords | None = None


Locator = Callable[[Seen], Located]


def meant_for(seen: Seen, method: str, bits: tuple[int, ...]) -> None:
    """Refuse a field whose bit depth a method does not support.

    Raises:
        InputError: The bit depth is not supported; the message lists those that are.
    """
    if seen.packed.bits not in bits:
        meant = ", ".join(str(one) for one in bits)
        raise InputError(
            f"method {method!r} needs fields of {meant} bits, not of {seen.packed.bits}",
            "use method 'automatic', which suits every bit depth",
        )


def noise_of(seen: Seen) -> float:
    """Standard deviation of a pixel in grey values: as set, or as the background shows it."""
    known = seen.settings.noise_levels
    return background_in(seen.packed).noise if known is None else known
