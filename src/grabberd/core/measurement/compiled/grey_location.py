"""Location with more than 1 bit by the compiled kernel: fitted discs and line shifts in one call."""

import ctypes
import math
from functools import lru_cache
from typing import Any

import numpy as np

from grabberd.core.field import PackedField
from grabberd.core.kernel import DONE, MORE_ROOM, Kernel
from grabberd.core.measurement.blobs import Blobs
from grabberd.core.measurement.compiled.binary_location import COLUMNS, ROOM, blobs_of, fail
from grabberd.core.measurement.locators.disc_image import edge_table
from grabberd.core.measurement.locators.locator import GREY
from grabberd.core.measurement.settings import LocationSettings

BY_KERNEL = ("automatic", "template")
_WHOLE, _REAL, _ADDRESS = ctypes.c_int64, ctypes.c_double, ctypes.c_void_p


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
        and settings.method in BY_KERNEL
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
