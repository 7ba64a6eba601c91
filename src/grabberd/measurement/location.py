"""From a packed field to its blobs (paper 3.5)."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from grabberd.field import PackedField, unpack
from grabberd.measurement.background import Background, background_of
from grabberd.measurement.blobs import Blobs
from grabberd.measurement.labels import label_runs
from grabberd.measurement.mask import target_bits
from grabberd.measurement.runs import Runs, find_runs
from grabberd.measurement.shapes import Shapes, binary_centres, grey_centres, shapes_of
from grabberd.measurement.sigma import binary_sigma_px, grey_sigma_px

METHODS = ("centroid",)
"""The locators by name."""
SAMPLED_EVERY_PX = 32
"""The background is looked at on one frame line in so many."""


@dataclass(frozen=True, slots=True)
class LocationSettings:
    """How targets are located.

    Attributes:
        method: one of `METHODS`; "centroid" weighs all pixels alike at 1 bit, and by g − T with more bits
            (paper eqs. 1, 2).
        min_diameter_px: blobs that are smaller than a disc of this diameter, in frame pixels, are no targets.
        max_diameter_px: neither are larger ones.
        noise_levels: standard deviation of a pixel in grey values; None: taken from each field's background.

    Raises:
        ValueError: an unknown method, or limits that no blob can meet.
    """

    method: str = "centroid"
    min_diameter_px: float = 2.5
    max_diameter_px: float = 15.0
    noise_levels: float | None = None

    def __post_init__(self) -> None:
        if self.method not in METHODS:
            raise ValueError(f"method {self.method!r} is none of {', '.join(METHODS)}")
        if not 0 <= self.min_diameter_px < self.max_diameter_px:
            limits = f"min_diameter_px {self.min_diameter_px} and max_diameter_px {self.max_diameter_px}"
            raise ValueError(f"no blob can meet {limits}")


def measure(packed: PackedField, windows: NDArray[np.float64] | None, settings: LocationSettings) -> Blobs:
    """The targets seen in a field, of both views, in the order of their first row and column.

    Args:
        packed: the field; with more than 1 bit, pixels above its `threshold` belong to targets.
        windows: (M, 4) float64 x0, y0, x1, y1 in frame pixels, edges included: only blobs whose centre lies
            in one of them are returned. None: all of them.
        settings: which blobs are targets, and how their centres are taken.

    Returns:
        Blobs in frame pixels, whatever the field's parity and bits; none where nothing exceeds the threshold.
    """
    runs = find_runs(target_bits(packed))
    label, count = label_runs(runs)
    shapes = shapes_of(runs, label, count)
    centres, sigma = _located(packed, runs, label, shapes, settings)
    blobs = _in_frame(packed, shapes, centres, sigma)
    return blobs.select(_of_size(blobs, settings) & _inside(blobs, windows))


def _located(
    packed: PackedField, runs: Runs, label: NDArray[np.int64], shapes: Shapes, settings: LocationSettings
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Centres in columns and rows, and their standard deviations in frame pixels."""
    count, area = len(shapes.pixels), _area_px(packed, shapes)
    if packed.bits == 1:
        return binary_centres(runs, label, count), binary_sigma_px(area, packed.y_step)
    centres, weight = grey_centres(packed, runs, label, count)
    background = _background(packed)
    sigma = grey_sigma_px(
        area,
        weight,
        packed.y_step,
        noise=background.noise if settings.noise_levels is None else settings.noise_levels,
        threshold_height=max(0.0, packed.threshold - background.level),
    )
    return centres, sigma


def _background(packed: PackedField) -> Background:
    """From some of the lines that the camera delivered; interpolated ones have less noise."""
    lines = packed.data[:, packed.parity :: SAMPLED_EVERY_PX // packed.y_step]
    step = 256 >> packed.bits
    levels = unpack(replace(packed, data=lines)).luma // step
    level, noise = background_of(np.bincount(levels.ravel(), minlength=2**packed.bits))
    return Background((level + 0.5) * step - 0.5, noise * step)


def _area_px(packed: PackedField, shapes: Shapes) -> NDArray[np.float64]:
    return shapes.pixels.astype(np.float64) * packed.y_step


def _in_frame(
    packed: PackedField, shapes: Shapes, centres: NDArray[np.float64], sigma: NDArray[np.float64]
) -> Blobs:
    return Blobs(
        xy_px=centres * (1.0, packed.y_step) + (0.0, packed.y0),
        sigma_px=sigma,
        area_px=_area_px(packed, shapes),
        width_px=(shapes.last_column - shapes.first_column + 1).astype(np.float64),
        height_px=(shapes.last_row - shapes.first_row + 1).astype(np.float64) * packed.y_step,
        at_border=shapes.touch_border(packed.rows, packed.columns),
    )


def _of_size(blobs: Blobs, settings: LocationSettings) -> NDArray[np.bool_]:
    diameter = np.sqrt(4 / np.pi * blobs.area_px)
    return (diameter >= settings.min_diameter_px) & (diameter <= settings.max_diameter_px)


def _inside(blobs: Blobs, windows: NDArray[np.float64] | None) -> NDArray[np.bool_]:
    if windows is None:
        return np.ones(len(blobs), np.bool_)
    x, y = blobs.xy_px.T[:, :, np.newaxis]
    x0, y0, x1, y1 = np.asarray(windows, np.float64).reshape(-1, 4).T
    found: NDArray[np.bool_] = ((x >= x0) & (x <= x1) & (y >= y0) & (y <= y1)).any(axis=1)
    return found
