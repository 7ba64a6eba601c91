"""What location and tracking cost over the number of targets, and over the empty area between them."""

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from tests.proofs.bench.core import measuring_setup

from grabberd.core.field import Field, PackedField, quantise
from grabberd.core.geometry import Rig, project
from grabberd.core.measurement import LocationSettings, measure
from grabberd.core.reconstruction import ImageNoise, ObjectModel, ViewBlobs
from grabberd.core.reconstruction.correspondence.correspondence import Correspondence

REPEATED = 40
PICTURES = ((54, 1), (216, 1), (1000, 1), (5000, 1), (216, 4), (216, 16))
"""How many discs, in how many pictures' area."""
ROWS, COLUMNS, PITCH_PX = 576, 1440, 12
OBJECTS = (54, 108, 216, 432, 864, 2000, 5000)
SIGMA_PX = 0.1


def table() -> str:
    """Medians in microseconds of one call."""
    located = [
        _row(f"location, 1 bit, {count} blobs on {COLUMNS * area} × {ROWS}", count, locating(count, area))
        for count, area in PICTURES
    ]
    tracked = [_row(f"tracking and intersection, {count} targets", count, search(count)) for count in OBJECTS]
    return "\n".join(["| what | µs | ns each |", "|---|---|---|", *located, *tracked])


def _row(what: str, count: int, call: Callable[[], object]) -> str:
    took = _median_us(call)
    return f"| {what} | {took:.0f} | {1000 * took / count:.0f} |"


def locating(count: int, area: int) -> Callable[[], object]:
    """A field of so many discs in so many pictures' area."""
    packed = discs(count, area)
    return lambda: measure(packed, None, LocationSettings())


def discs(count: int, area: int) -> PackedField:
    """Discs of 5 px, each at random within a pixel, in a picture that they fill to some part."""
    rng = np.random.default_rng(count)
    luma = np.full((ROWS, COLUMNS * area), 20, np.uint8)
    across = COLUMNS // PITCH_PX - 2
    y, x = np.mgrid[-4:5, -4:5]
    for row, column in zip(*np.divmod(np.arange(count), across), strict=True):
        dy, dx = rng.uniform(-0.5, 0.5, 2)
        top, left = PITCH_PX // 2 * (row + 1), PITCH_PX * (column + 1)
        distance = np.hypot(x[::2] - dx, y[::2] - dy)
        luma[top : top + 5, left : left + 9] += (180 / (1 + np.exp(3 * (distance - 2.5)))).astype(np.uint8)
    return quantise(Field.intact(luma, 0), 1, 80)


def search(count: int) -> Callable[[], object]:
    """A field's targets, near where they were."""
    rig = Rig.of(measuring_setup().calibration)
    rows = round((count / 6) ** 0.5 * 2)
    row, column = np.divmod(np.arange(count, dtype=np.int32), np.int32(-(-count // rows)))
    places = np.stack([110 * column / column.max() - 55, 34 * row / row.max() - 17, 0 * row], axis=1)
    model = ObjectModel("grid", np.arange(count, dtype=np.int32), places, row, column, 1.5, 0.05)
    blobs = [_seen(project(view, places)) for view in rig.views]
    correspondence = Correspondence(rig, model, ImageNoise.of(rig, model, 0.12, 2))
    return lambda: correspondence.near(places, np.full(count, 0.2), *blobs)


def _seen(xy_px: NDArray[np.float64]) -> ViewBlobs:
    return ViewBlobs(xy_px, np.full_like(xy_px, SIGMA_PX), np.full(len(xy_px), SIGMA_PX), 3.0)


def _median_us(call: Callable[[], object]) -> float:
    call()
    times = []
    for _ in range(REPEATED):
        before = time.thread_time_ns()
        call()
        times.append(time.thread_time_ns() - before)
    return float(np.median(times)) / 1000
