"""Marks: bright discs fixed to the cup, located on the grey field before it is quantised.

At 1 bit a disc at rest is locked to the pixels, so that its centre does not average from field to field. On
grey values it does, which is what tells a movement of .02 px from noise.

Reference for the marks: their places in the calibration's own pictures, by parity, and their scatter.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from grabberd.core.arrays import Array, Indices, Mask
from grabberd.core.field import BOTTOM, Field
from grabberd.core.geometry import Calibration
from grabberd.core.geometry.document_reader import Reading
from grabberd.errors import MeasurementError

REACH_PX = 12
"""Half width and half height of a mark's window in frame pixels: a mark of 6 px may move by more than 5."""
CLEAR_PX = 15.0
"""Least distance of a mark's centre from others and from the edges of its view: reach and its own radius."""
LEAST_PLACES, MOST_MARKS = 2, 16
"""Marks that a view needs to be watched, and marks of a whole picture."""
_CUT = 0.1
"""Share of the contrast above the background below which pixels have no weight: noise does not reach it."""
_LEAST_CONTRAST = 25.0
_OF_TWO_LEVELS = 0.97
"""Mean square of the weights over the greatest times their mean: 1 in a picture of two levels, such as a
replayed capture of 1 bit, and clearly less where an edge is grey.
"""
_TOUCHES = 0.5
"""Share of the contrast from which on a pixel on the window's border belongs to something that sticks out."""

Located = NDArray[np.float32]
"""(K, 3) x_px, y_px (frame pixels) and area_px2 of K marks; NaN for one that is not wholly seen."""


class MarkLocator:
    """Centres of marks in windows about their approximate places; cheap enough for the capture thread."""

    def __init__(self, places_px: Sequence[tuple[float, float]]) -> None:
        """Prepare the windows.

        Args:
            places_px: Approximate place of each mark, column and frame line, to within a few pixels.
        """
        self._places = np.array(places_px, np.float64).reshape(-1, 2)
        self._windows: dict[tuple[int, ...], _Windows] = {}

    def locate(self, field: Field) -> Located:
        """Locate every mark in a field, intact or progressive.

        A mark is not seen (NaN) if its contrast is too low, if it has no grey edge, or if something bright
        reaches the window's border: the mark itself, cut off, or another thing that would draw its centre
        away.
        """
        kind = (*field.luma.shape, field.y0, field.y_step)
        windows = self._windows.get(kind)
        if windows is None:
            windows = self._windows[kind] = _Windows(self._places, *kind)
        return windows.located(field.luma)


class _Windows:
    """Windows in fields with the same lines."""

    def __init__(self, places: Array, rows: int, columns: int, y0: int, y_step: int) -> None:
        high, wide = min(2 * REACH_PX // y_step, rows), min(2 * REACH_PX, columns)
        row = _first((places[:, 1] - y0) / y_step, high, rows)
        column = _first(places[:, 0], wide, columns)
        self._first = np.stack([column, y0 + y_step * row], axis=1).astype(np.float32)
        self._slices = [
            (slice(y, y + high), slice(x, x + wide))
            for y, x in zip(row.tolist(), column.tolist(), strict=True)
        ]
        down, across = np.divmod(np.arange(high * wide), wide)
        self._border = np.flatnonzero((down % (high - 1) == 0) | (across % (wide - 1) == 0))
        self._mean = np.zeros(high * wide, np.float32)
        self._mean[self._border] = 1.0 / len(self._border)
        self._moments = np.stack([np.ones(high * wide), across, down * y_step], axis=1).astype(np.float32)
        self._area_px2 = y_step / (1.0 - _CUT)

    def located(self, luma: NDArray[np.uint8]) -> Located:
        # Slices: gathering the pixels by indices takes five times as long, and the capture thread waits.
        windows = np.array([luma[own] for own in self._slices])
        grey = windows.reshape(len(windows), -1).astype(np.float32)
        background = grey @ self._mean
        contrast = np.maximum(grey.max(axis=1) - background, 1.0)
        touches = grey.take(self._border, axis=1).max(axis=1) > background + _TOUCHES * contrast
        weight = np.maximum(grey - (background + _CUT * contrast)[:, np.newaxis], 0.0)
        sums = weight @ self._moments
        flat = _OF_TWO_LEVELS * (1.0 - _CUT) * contrast * sums[:, 0]
        seen = (contrast >= _LEAST_CONTRAST) & ~touches & (np.einsum("ij,ij->i", weight, weight) < flat)
        located = np.full((len(grey), 3), np.nan, np.float32)
        sums = sums[seen]
        located[seen, :2] = self._first[seen] + sums[:, 1:] / sums[:, :1]
        located[seen, 2] = self._area_px2 * sums[:, 0] / contrast[seen]
        return located


def _first(centre: Array, size: int, most: int) -> Indices:
    """First index of windows about centres, inside the picture."""
    return np.clip(np.rint(centre - 0.5 * (size - 1)), 0, most - size).astype(np.intp)


KEY = "marks"
"""In a calibration's `details`."""
LEAST_FIELDS = 12
"""Of either parity, for a place to be learnt."""
_OUTLIER = 5.0
_LEAST_SIGMA_PX = 0.005
_AREA_SHARE = 0.2
"""Change of a mark's area in one field beyond which it is partly covered, and its centre false."""
_KEYS = ("x_px", "y_px", "sigma_px", "area_px2", "fields")


@dataclass(frozen=True, slots=True, eq=False)
class MarkReference:
    """K marks as the calibration saw them.

    Attributes:
        place_px: (2, K, 2) mean place in top and in bottom fields, frame pixels: lines that lie otherwise
            between the pixels shift a centre by some hundredths. Progressive pictures have both alike.
        sigma_px: (K, 2) standard deviation of the place in one field.
        area_px2: (K,) mean area.
        fields: (K,) number of fields that the means are of.
    """

    place_px: Array
    sigma_px: Array
    area_px2: Array
    fields: NDArray[np.int64]

    @property
    def mean_sigma_px(self) -> Array:
        """(K, 2) standard deviation of the mean places."""
        return self.sigma_px / np.sqrt(self.fields)[:, np.newaxis]

    def select(self, chosen: Indices) -> "MarkReference":
        """Select marks."""
        return MarkReference(
            self.place_px[:, chosen], self.sigma_px[chosen], self.area_px2[chosen], self.fields[chosen]
        )

    def change(self, parity: int, located: Located | None) -> Array:
        """(K, 3) change of the marks located in a field: displacement in px, and change of area as a share.

        NaN for marks not seen, or mostly covered. Fields whose marks are others, in number or by more than
        the reach of their windows, show none.
        """
        if located is None or len(located) != len(self.area_px2):
            return np.full((len(self.area_px2), 3), np.nan)
        change: Array = located - np.column_stack([self.place_px[int(parity == BOTTOM)], self.area_px2])
        change[:, 2] /= self.area_px2
        with np.errstate(invalid="ignore"):
            change[(np.abs(change) > (REACH_PX, REACH_PX, _AREA_SHARE)).any(axis=1)] = np.nan
        return change

    @classmethod
    def learnt(cls, fields: Iterable[tuple[int, Located]]) -> "MarkReference | None":
        """Learn the marks from parities and located marks of fields in which they stood still.

        None if there are no fields.

        Raises:
            MeasurementError: A mark was seen in too few fields, or two are the same disc.
        """
        found = list(fields)
        if not found:
            return None
        parity, located = zip(*found, strict=True)
        return _learnt(np.array(parity), np.array(located, np.float64))

    @classmethod
    def of(cls, calibration: Calibration) -> "MarkReference | None":
        """Read the marks of a calibration; None if it has none.

        Raises:
            InputError: They are invalid; the message lists every problem.
        """
        stored = calibration.details.get(KEY)
        if not stored:
            return None
        reading = Reading(f"calibration {calibration.id}")
        if not isinstance(stored, list) or len(stored) > MOST_MARKS:
            reading.refuse(f"details.{KEY}", stored, f"a list of at most {MOST_MARKS} marks")
            stored = []
        marks = [_read(reading, f"details.{KEY}[{index}]", one) for index, one in enumerate(stored)]
        reading.finish("calibrate again")
        places, sigmas, areas, fields = zip(*marks, strict=True)
        return cls(np.stack(places, axis=1), np.array(sigmas), np.array(areas), np.array(fields, np.int64))

    def to_document(self) -> list[dict[str, Any]]:
        """Convert to the part of a calibration's details; x and y of top, then of bottom fields."""
        return [
            {
                "x_px": self.place_px[:, index, 0].tolist(),
                "y_px": self.place_px[:, index, 1].tolist(),
                "sigma_px": self.sigma_px[index].tolist(),
                "area_px2": float(self.area_px2[index]),
                "fields": int(self.fields[index]),
            }
            for index in range(len(self.area_px2))
        ]


def _learnt(parity: NDArray[np.int64], located: Array) -> MarkReference:
    rows = [parity == one for one in np.unique(parity)]
    parities = len(rows)
    rows = rows if parities > 1 else rows * 2
    counts = np.array([np.isfinite(located[own, :, 0]).sum(axis=0) for own in rows]).min(axis=0)
    if (counts < LEAST_FIELDS).any():
        worst = int(np.argmin(counts))
        raise MeasurementError(
            f"mark {worst + 1} was seen in {counts[worst]} fields of a parity, {LEAST_FIELDS} are needed",
            "look at its place in the picture: it must be bright, wholly in view and some pixels from "
            "anything else; correct 'marks' in the configuration, or leave it out",
        )
    both = [_mean_and_scatter(located[own]) for own in rows]
    place = np.stack([mean[:, :2] for mean, _ in both])
    sigma = np.sqrt(np.mean([scatter[:, :2] ** 2 for _, scatter in both], axis=0))
    area = np.mean([mean[:, 2] for mean, _ in both], axis=0)
    _refuse_twice(place.mean(axis=0))
    return MarkReference(place, np.maximum(sigma, _LEAST_SIGMA_PX), area, parities * counts)


def _refuse_twice(place_px: Array) -> None:
    for first, second in combinations(range(len(place_px)), 2):
        if np.hypot(*(place_px[first] - place_px[second])) < REACH_PX:
            raise MeasurementError(
                f"marks {first + 1} and {second + 1} are the same disc",
                "correct their places under 'marks' in the configuration, or leave one out",
            )


def _mean_and_scatter(located: Array) -> tuple[Array, Array]:
    """(K, 3) mean and standard deviation of places and area, without outliers."""
    median = np.nanmedian(located, axis=0)
    spread = 1.4826 * np.nanmedian(np.abs(located - median), axis=0) + 1e-3
    with np.errstate(invalid="ignore"):
        sound: Mask = np.all(np.abs(located - median) <= _OUTLIER * spread, axis=2)
    kept = np.where(sound[:, :, np.newaxis], located, np.nan)
    return np.nanmean(kept, axis=0), np.nanstd(kept, axis=0, ddof=1)


def _read(reading: Reading, where: str, stored: object) -> tuple[Array, Array, float, int]:
    own = stored if isinstance(stored, Mapping) else {}
    if not isinstance(stored, Mapping):
        reading.refuse(where, stored, "a mapping")
    reading.keys(where + ".", own, _KEYS)
    x, y, sigma = (reading.numbers(own.get(key), f"{where}.{key}", (2,)) for key in _KEYS[:3])
    if min(sigma.min(), 0.0) < 0 or not sigma.all():
        reading.refuse(f"{where}.sigma_px", sigma.tolist(), "numbers above 0")
    area = reading.number(own, "area_px2", where + ".", positive=True)
    fields = reading.integer(own, "fields", where + ".", least=1)
    return np.stack([x, y], axis=1), sigma, area, fields
