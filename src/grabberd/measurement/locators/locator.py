"""What a locator is given, and what it gives back."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.errors import InputError
from grabberd.field import BIT_DEPTHS, PackedField
from grabberd.measurement.background import background_in
from grabberd.measurement.labelling.runs import Runs
from grabberd.measurement.labelling.shapes import Shapes, binary_centres
from grabberd.measurement.settings import LocationSettings

GREY = tuple(bits for bits in BIT_DEPTHS if bits > 1)
"""Bit depths of the locators that need grey values."""
ALL_BUT_THE_TALLEST = 0.95
TALLEST = 2.0
"""Blobs taller than this many of the largest diameters are no targets."""


@dataclass(frozen=True, eq=False)
class Seen:
    """The connected components of one field, N of them, before anyone has located them.

    Attributes:
        packed: the field.
        runs: R runs of pixels above the threshold, ordered by component, row and column.
        label: (R,) int64, the component of every run.
        shapes: size and extent of every component, in the field's own columns and rows.
        settings: how targets are located.
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
        """(N, 2) float64 column and row of each centre, every pixel above the threshold weighing the same."""
        return binary_centres(self.runs, self.label, len(self.shapes))

    @cached_property
    def of_size(self) -> NDArray[np.bool_]:
        """(N,) bool, which are neither too small nor too large for a target."""
        diameter = np.sqrt(4 / np.pi * self.area_px)
        return (diameter >= self.settings.min_diameter_px) & (diameter <= self.settings.max_diameter_px)

    @cached_property
    def low(self) -> NDArray[np.bool_]:
        """(N,) bool, which of these are not too tall either: such would cost much, and are no targets."""
        height_px = (self.shapes.last_row - self.shapes.first_row + 1) * self.packed.y_step
        low: NDArray[np.bool_] = self.of_size & (height_px <= TALLEST * self.settings.max_diameter_px)
        return low


class Chords(NamedTuple):
    """Where the lines that the camera delivered cut N blobs, at most h lines each: by this the shifts of
    whole lines can be found.

    Attributes:
        blob: (N,) int64, the component of each.
        line: (N,) int64, the field line of its first chord, whatever the packed field's rows are.
        centre: (N, h) float64, the middle of each chord, columns.
        weight: (N, h) float64, 1/σ² of that in px⁻²; 0 where there is no chord.
        share: (N, h) float64, by how much the located x moves if this line alone is shifted by 1; it need not
            have a chord.
    """

    blob: NDArray[np.int64]
    line: NDArray[np.int64]
    centre: NDArray[np.float64]
    weight: NDArray[np.float64]
    share: NDArray[np.float64]

    def trimmed(self, wanted: NDArray[np.bool_]) -> "Chords":
        """As few lines of each as hold those wanted, (N, h) bool, of all but the tallest: these lose some."""
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
    """The places of the N components of a field.

    Attributes:
        centres: (N, 2) float64, in the field's own columns and rows.
        sigma_px: (N, 2) float64, x and y, frame pixels.
        chords: what the shifts of lines can be estimated from, of locators that have them.
    """

    centres: NDArray[np.float64]
    sigma_px: NDArray[np.float64]
    chords: Chords | None = None


Locator = Callable[[Seen], Located]


def meant_for(seen: Seen, method: str, bits: tuple[int, ...]) -> None:
    """Refuse a field whose bits a method is not meant for.

    Raises:
        InputError: with what it is meant for.
    """
    if seen.packed.bits not in bits:
        meant = ", ".join(str(one) for one in bits)
        raise InputError(
            f"method {method!r} locates targets in fields of {meant} bits, not of {seen.packed.bits}",
            "use method 'automatic', which chooses by the field's bits",
        )


def noise_of(seen: Seen) -> float:
    """Standard deviation of a pixel in grey values: as set, or as the background shows it."""
    known = seen.settings.noise_levels
    return background_in(seen.packed).noise if known is None else known
