"""Location: from a packed field to its blobs, the images of targets (paper 3.5).

Location by the compiled kernel: the same blobs as numpy's, many times faster.

At 1 bit the kernel finds components, sizes and positions in one call. If it lacks a table it reports which;
tables are made by the same functions as numpy's, and kept. With more bits one call fits discs and line
shifts. The structures mirror those of the kernel's headers.
"""

import ctypes
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from importlib import import_module
from typing import Any, NoReturn, cast

import numpy as np
from numpy.typing import NDArray

from grabberd.core.arrays import Array, Indices, Mask
from grabberd.core.field import PROGRESSIVE, PackedField
from grabberd.core.kernel import ANY_NOISE, DONE, KERNEL, MORE_ROOM, NO_FULLNESS, NO_MEMORY, NO_TABLE, Kernel
from grabberd.core.measurement.labelling import by_component, find_runs, shapes_of, target_bits
from grabberd.core.measurement.line_jitter import Steadied, steadied
from grabberd.core.measurement.locale import NOISES
from grabberd.core.measurement.locale import ROUNDED_PX as KIND_PX
from grabberd.core.measurement.locale_table import FRACTIONS, ROUNDED_PX, TABLES, Appearance, fullness, table
from grabberd.core.measurement.locale_table import Table as MadeTable
from grabberd.core.measurement.locators.locator import GREY, Located, Locator, Seen
from grabberd.core.measurement.locators.template import edge_table
from grabberd.core.measurement.settings import AUTOMATIC, LOCATORS, LocationSettings
from grabberd.errors import MeasurementError


@dataclass(frozen=True, slots=True, eq=False)
class Blobs:
    """N blobs located in one field, both views together, in the order of their first row and column.

    Attributes:
        xy_px: (N, 2) float64, frame pixels: x in columns, y in frame lines.
        sigma_px: (N, 2) float64, standard deviation of `xy_px` from location alone, without line jitter.
        common_px: (N,) float64, standard deviation of the residual line jitter in x, an error shared by all
            blobs on the same lines, in both views.
        area_px: (N,) float64, size above the threshold in square *frame* pixels (rows of an intact field
            count twice).
        width_px: (N,) float64, number of columns spanned.
        height_px: (N,) float64, number of frame lines spanned.
        at_border: (N,) bool, True for a blob cut off by the edge of the field.
        common_reach_px: Distance in frame lines over which the correlation of that shared error falls to
            e^−½.
        line_jitter_px: Standard deviation of a line's shift in this field; None if not estimated.
    """

    xy_px: Array
    sigma_px: Array
    common_px: Array
    area_px: Array
    width_px: Array
    height_px: Array
    at_border: Mask
    common_reach_px: float
    line_jitter_px: float | None = None

    def __len__(self) -> int:
        return len(self.xy_px)

    def select(self, chosen: Mask | Indices) -> "Blobs":
        """Select blobs by a mask or index array."""
        columns: Any = [getattr(self, name)[chosen] for name in _COLUMNS]
        return Blobs(*[*columns, self.common_reach_px, self.line_jitter_px])


_COLUMNS = ("xy_px", "sigma_px", "common_px", "area_px", "width_px", "height_px", "at_border")


_BINARY_METHODS = ("automatic", "locale", "centroid")
COLUMNS = 9
"""Numbers per blob that the kernel writes."""
ROOM = 256
"""Blobs that the first call has room for: a field of 216 targets needs no second one."""
MOST_TABLES, MOST_FULLNESS = TABLES // len(NOISES), 64
"""Number of sizes kept from field to field before all are dropped."""


_WHOLE, _REAL, _ADDRESS = ctypes.c_int64, ctypes.c_double, ctypes.c_void_p


class Table(ctypes.Structure):
    """Tables for one target size and one threshold, of those noise levels that were asked for."""

    _fields_ = (
        ("values", _ADDRESS * len(NOISES)),
        ("length", _WHOLE),
        ("columns", _WHOLE),
        ("rows", _WHOLE),
        ("wide", ctypes.c_int32),
        ("high", ctypes.c_int32),
        ("fraction", _REAL),
    )
    made: Mapping[int, MadeTable]

    @classmethod
    def of(cls, wide: float, high: float, fraction: float, made: Mapping[int, MadeTable]) -> "Table":
        """The table of a kind and a threshold, from numpy's by the numbers of their noises."""
        some = next(iter(made.values()))
        addresses = (made[one].windows.ctypes.data if one in made else None for one in range(len(NOISES)))
        own = cls(
            (_ADDRESS * len(NOISES))(*addresses),
            _floats(some.windows),
            int(some.grid.columns),
            int(some.grid.rows),
            int(wide),
            int(high),
            fraction,
        )
        own.made = made  # the arrays at the addresses must stay alive
        return own

    def is_of(self, wide: float, high: float, fraction: float) -> bool:
        """True if it is the table of this kind and threshold."""
        return bool(self.wide == wide and self.high == high and self.fraction == fraction)


class Fullness(ctypes.Structure):
    """Fullness of interpolated rows for one target size."""

    _fields_ = (("half_width_px", _REAL), ("half_height_px", _REAL), ("ratio", _REAL * len(FRACTIONS)))


class Settings(ctypes.Structure):
    """Inputs of location at 1 bit, other than the picture."""

    _fields_ = (
        ("min_diameter_px", _REAL),
        ("max_diameter_px", _REAL),
        ("line_jitter_px", _REAL),
        ("locale", _WHOLE),
        ("shifts_taken", _WHOLE),
        ("tables", _ADDRESS),
        ("table_count", _WHOLE),
        ("fullness", _ADDRESS),
        ("fullness_count", _WHOLE),
    )


class Kept:
    """Settings and the tables that they point to; immutable, so that threads may share them."""

    def __init__(self, known: "Known", tables: tuple[Table, ...], fullnesses: tuple[Fullness, ...]) -> None:
        self.tables, self.fullnesses = tables, fullnesses
        self._arrays = (Table * len(tables))(*tables), (Fullness * len(fullnesses))(*fullnesses)
        first, second = (ctypes.addressof(one) for one in self._arrays)
        self.settings = Settings(
            known.least_px,
            known.greatest_px,
            known.jitter_px,
            known.spread_px is not None,
            known.shifts_taken,
            first,
            len(tables),
            second,
            len(fullnesses),
        )


class Known:
    """Kernel inputs other than the picture, with the tables made so far.

    Attributes:
        kept: The tables.
        room: Blobs that a call has room for: as many as the last fields had, so that the next is not located
            twice.
    """

    def __init__(
        self,
        least_px: float,
        greatest_px: float,
        jitter_px: float,
        shifts_taken: bool,
        spread_px: float | None,
        y_step: int,
        lines_apart: int,
    ) -> None:
        self.least_px, self.greatest_px = least_px, greatest_px
        self.jitter_px, self.shifts_taken = jitter_px, shifts_taken
        self.spread_px, self.y_step, self.lines_apart = spread_px, y_step, lines_apart
        self.kept, self.room = Kept(self, (), ()), ROOM

    def _add_table(self, kept: Kept, wide: float, high: float, fraction: float, noise: float) -> Kept:
        """The tables with one of a noise more, by its number in `NOISES`; of all of them with `ANY_NOISE`."""
        assert self.spread_px is not None
        half_axes = KIND_PX[0] * wide, KIND_PX[1] * high
        look = Appearance(
            *half_axes, fraction, NOISES[0], self.spread_px, self.jitter_px, self.y_step, self.lines_apart
        )
        made: dict[int, MadeTable] = {}
        for one in kept.tables:
            if one.is_of(wide, high, fraction):
                made |= one.made
        for number in range(len(NOISES)) if noise == ANY_NOISE else (int(noise),):
            made[number] = table(look._replace(noise=NOISES[number]))
        others = (one for one in kept.tables if not one.is_of(wide, high, fraction))
        own = Table.of(wide, high, fraction, made)
        # Threads may replace each other's tables here: a lost one is named, and made, once more.
        self.kept = Kept(self, (*others, own), kept.fullnesses)
        return self.kept

    def _add_fullness(self, kept: Kept, wide: float, high: float) -> Kept:
        assert self.spread_px is not None
        ratios = fullness((ROUNDED_PX * int(wide), ROUNDED_PX * int(high)), self.spread_px)
        own = Fullness(wide, high, (ctypes.c_double * len(ratios))(*ratios))
        self.kept = Kept(self, kept.tables, (*kept.fullnesses, own))
        return self.kept

    def completed(self, kept: Kept, status: int, missing: Sequence[float]) -> Kept:
        """Add what the kernel names as missing, after `NO_TABLE` or `NO_FULLNESS`."""
        return (
            self._add_table(kept, *missing) if status == NO_TABLE else self._add_fullness(kept, *missing[:2])
        )

    def begin(self) -> Kept:
        """The tables for a field; dropped only between fields, however many sizes one of them shows."""
        if len(self.kept.tables) > MOST_TABLES or len(self.kept.fullnesses) > MOST_FULLNESS:
            self.kept = Kept(self, (), ())
        return self.kept


def _floats(windows: NDArray[np.float32]) -> int:
    """Number of distinct values behind overlapping windows."""
    last = zip(windows.shape, windows.strides, strict=True)
    return 1 + sum(int((size - 1) * stride // windows.itemsize) for size, stride in last)


_known = lru_cache(maxsize=16)(Known)


def known_of(settings: LocationSettings, y_step: int, lines_apart: int = 2) -> Known:
    """Make or recall the kernel's inputs."""
    return _known(
        *settings.limits_px,
        settings.line_jitter_px,
        settings.line_shifts is not False,
        None if settings.method == "centroid" else settings.spread_px,
        y_step,
        lines_apart,
    )


def takes(packed: PackedField, settings: LocationSettings) -> bool:
    """True if the kernel covers this field and these settings, which are those for it."""
    return packed.bits == 1 and settings.method in _BINARY_METHODS and packed.y_step in (1, 2)


def measure_compiled(kernel: Kernel, packed: PackedField, settings: LocationSettings) -> Blobs:
    """Measure as `location.measure` without windows, for fields that the kernel covers.

    Raises:
        MeasurementError: There is not enough memory, or the kernel refuses the picture.
    """
    known = known_of(settings, packed.y_step, packed.lines_apart)
    data = np.ascontiguousarray(packed.data)
    _, rows, stride = data.shape
    picture = (rows, stride, packed.columns, packed.parity, packed.y0, packed.y_step)
    room, kept = known.room, known.begin()
    while True:
        out = np.empty(COLUMNS * room)
        # The kernel keeps no state: it names what it lacks, and is called again with that.
        status, count, reach_px, *missing = kernel.locate(data, picture, kept.settings, out)
        if status == DONE:
            if count < room // 4:  # blobs are views of all the room
                known.room = max(ROOM, room // 2)
            return blobs_of(out.reshape(COLUMNS, room), count, reach_px)
        if status == MORE_ROOM:
            room = known.room = count
        elif status in (NO_TABLE, NO_FULLNESS):
            kept = known.completed(kept, status, missing)
        else:
            fail(status, packed)


def blobs_of(out: Array, count: int, reach_px: float, jitter_px: float = math.nan) -> Blobs:
    """Convert the first `count` blobs that the kernel wrote into `out` (COLUMNS, room)."""
    jitter = None if math.isnan(jitter_px) else jitter_px
    xy, sigma = (out[first : first + 2].reshape(-1)[: 2 * count].reshape(count, 2) for first in (0, 2))
    common, area, width, height, at_border = out[4:, :count]
    return Blobs(xy, sigma, common, area, width, height, at_border != 0.0, reach_px, jitter)


def fail(status: int, packed: PackedField) -> NoReturn:
    """Raise the error for a kernel status.

    Raises:
        MeasurementError: Always.
    """
    what = "not enough memory" if status == NO_MEMORY else "the compiled kernel refused the picture"
    raise MeasurementError(
        f"{what}: {packed.rows} rows of {packed.columns} columns at {packed.bits} bit",
        "report this together with the picture" if status != NO_MEMORY else "free some memory, or add more",
    )


_GREY_METHODS = ("automatic", "template")


class GreySettings(ctypes.Structure):
    """Inputs of location with more than 1 bit, other than the picture."""

    _fields_ = (
        ("min_diameter_px", _REAL),
        ("max_diameter_px", _REAL),
        ("line_jitter_px", _REAL),
        ("spread_px", _REAL),
        ("noise_levels", _REAL),
        ("shifts_solved", _WHOLE),
        ("jitter_known", _WHOLE),
        ("edge", _ADDRESS),
        ("edge_values", _WHOLE),
    )
    edge_values_kept: Any


def takes_grey(packed: PackedField, settings: LocationSettings) -> bool:
    """True if the kernel covers this field and these settings."""
    return (
        packed.bits in GREY
        and settings.method in _GREY_METHODS
        and packed.y_step in (1, 2)
        and packed.rows * packed.y_step >= packed.lines_apart
        and settings.noise_levels != 0
    )


def measure_grey(kernel: Kernel, packed: PackedField, settings: LocationSettings) -> Blobs:
    """Measure as `location.measure` without windows, for fields that the kernel covers.

    Raises:
        MeasurementError: There is not enough memory, or the kernel refuses the picture.
    """
    data = np.ascontiguousarray(packed.data)
    _, rows, stride = data.shape
    picture = (packed.bits, rows, stride, packed.columns)
    layout = (packed.parity, packed.y0, packed.y_step, packed.threshold)
    wanted, room = grey_settings(settings), ROOM
    while True:
        out = np.empty(COLUMNS * room)
        status, count, reach_px, jitter_px = kernel.locate_grey(data, picture + layout, wanted, out)
        if status == DONE:
            return blobs_of(out.reshape(COLUMNS, room), count, reach_px, jitter_px)
        if status != MORE_ROOM:
            fail(status, packed)
        room = count


@lru_cache(maxsize=16)
def grey_settings(settings: LocationSettings) -> GreySettings:
    """Make or recall the kernel's inputs."""
    edge = np.stack(edge_table(), axis=1)
    own = GreySettings(
        *settings.limits_px,
        settings.line_jitter_px,
        settings.spread_px,
        math.nan if settings.noise_levels is None else settings.noise_levels,
        settings.line_shifts is not False,
        settings.line_jitter_known,
        ctypes.c_void_p(edge.ctypes.data),
        len(edge),
    )
    own.edge_values_kept = edge  # the array at the address must stay alive
    return own


def measure(packed: PackedField, windows: Array | None, settings: LocationSettings) -> Blobs:
    """Locate the targets in a field, both views together, in the order of their first row and column.

    Args:
        packed: The field; with more than 1 bit, pixels above its `threshold` belong to targets.
        windows: (M, 4) float64 x0, y0, x1, y1 in frame pixels, edges included: only blobs whose centre lies
            in one of them are returned. None returns all.
        settings: Which blobs are targets, and how their centres are computed.

    Returns:
        Blobs in frame pixels, whatever the field's parity and bits; empty if nothing exceeds the threshold.
    """
    settings = settings_for(packed, settings)
    if KERNEL and takes(packed, settings):
        blobs = measure_compiled(KERNEL, packed, settings)
    elif KERNEL and takes_grey(packed, settings):
        blobs = measure_grey(KERNEL, packed, settings)
    else:
        blobs = measure_by_numpy(packed, settings)
    return blobs if windows is None else blobs.select(_inside(blobs, windows))


@lru_cache(maxsize=16)
def for_progressive(settings: LocationSettings) -> LocationSettings:
    """The settings for progressive pictures, whose lines do not shift."""
    return replace(settings, line_jitter_px=0.0, line_shifts=None)


def settings_for(packed: PackedField, settings: LocationSettings) -> LocationSettings:
    """The settings as they apply to a field: lines of a progressive picture do not shift."""
    return for_progressive(settings) if packed.parity == PROGRESSIVE else settings


def measure_by_numpy(packed: PackedField, settings: LocationSettings) -> Blobs:
    """Locate all targets with numpy, for any method and bit depth: the reference that the kernel must
    equal.
    """
    seen = seen_in(packed, settings_for(packed, settings))
    located = _located(seen)
    return _in_frame(seen, located.sigma_px, steadied(seen, located)).select(seen.of_size)


def seen_in(packed: PackedField, settings: LocationSettings) -> Seen:
    """The components of a field, as a locator takes them."""
    runs, label, count = by_component(find_runs(target_bits(packed)))
    return Seen(packed, runs, label, shapes_of(runs, label, count), settings)


def _located(seen: Seen) -> Located:
    settings = seen.settings
    if settings.locator is None:
        return _locator(settings.method, seen.packed.bits)(seen)
    located = cast("Located", settings.locator(seen))
    shape = (len(seen.shapes), 2)
    if located.centres.shape != shape or located.sigma_px.shape != shape:
        found = f"centres {located.centres.shape} and sigma_px {located.sigma_px.shape}"
        raise MeasurementError(
            f"locator {settings.method!r} returned {found} for {shape[0]} components",
            "it must return a row for each component, in their order; choose method 'automatic' meanwhile",
        )
    return located


@cache
def _locator(method: str, bits: int) -> Locator:
    """The locator of a method, imported when it is first used."""
    if method == AUTOMATIC:
        method = "locale" if bits == 1 else "template"  # each measured best at its bit depths
    module, function = LOCATORS[method].split(":")
    return cast("Locator", getattr(import_module(f"{__package__}.{module}"), function))


def _in_frame(seen: Seen, sigma_px: Array, steady: Steadied) -> Blobs:
    packed, shapes = seen.packed, seen.shapes
    return Blobs(
        xy_px=steady.centres * (1.0, packed.y_step) + (0.0, packed.y0),
        sigma_px=sigma_px,
        common_px=steady.common_px,
        area_px=seen.area_px,
        width_px=(shapes.last_column - shapes.first_column + 1).astype(np.float64),
        height_px=(shapes.last_row - shapes.first_row + 1).astype(np.float64) * packed.y_step,
        at_border=shapes.touch_border(packed.rows, packed.columns),
        common_reach_px=steady.common_reach_px,
        line_jitter_px=steady.line_jitter_px,
    )


def _inside(blobs: Blobs, windows: Array) -> Mask:
    x, y = blobs.xy_px.T[:, :, np.newaxis]
    x0, y0, x1, y1 = np.asarray(windows, np.float64).reshape(-1, 4).T
    return ((x >= x0) & (x <= x1) & (y >= y0) & (y <= y1)).any(axis=1)
