"""Location: from a packed field to its blobs (paper 3.5)."""

from dataclasses import replace
from functools import cache, lru_cache
from importlib import import_module
from typing import cast

import numpy as np
from numpy.typing import NDArray

from grabberd.core.field import PROGRESSIVE, PackedField
from grabberd.core.kernel import KERNEL
from grabberd.core.measurement.blobs import Blobs
from grabberd.core.measurement.compiled_location import measure_compiled, measure_grey, takes, takes_grey
from grabberd.core.measurement.labelling import by_component, find_runs, shapes_of, target_bits
from grabberd.core.measurement.line_jitter import Steadied, steadied
from grabberd.core.measurement.locators.locator import Located, Locator, Seen
from grabberd.core.measurement.settings import AUTOMATIC, LOCATORS, LocationSettings
from grabberd.errors import MeasurementError


def measure(packed: PackedField, windows: NDArray[np.float64] | None, settings: LocationSettings) -> Blobs:
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


def _in_frame(seen: Seen, sigma_px: NDArray[np.float64], steady: Steadied) -> Blobs:
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


def _inside(blobs: Blobs, windows: NDArray[np.float64]) -> NDArray[np.bool_]:
    x, y = blobs.xy_px.T[:, :, np.newaxis]
    x0, y0, x1, y1 = np.asarray(windows, np.float64).reshape(-1, 4).T
    return ((x >= x0) & (x <= x1) & (y >= y0) & (y <= y1)).any(axis=1)
