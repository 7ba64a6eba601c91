"""Structures of kernel.h and grey.h used by location, member by member."""

import ctypes
from typing import Any

from grabberd.measurement.locale.locale import NOISES
from grabberd.measurement.locale.locale_sizes import FRACTIONS

_WHOLE, _REAL, _ADDRESS = ctypes.c_int64, ctypes.c_double, ctypes.c_void_p


class Table(ctypes.Structure):
    """Tables for one target size and one threshold, one per noise level."""

    _fields_ = (
        ("values", _ADDRESS * len(NOISES)),
        ("length", _WHOLE),
        ("columns", _WHOLE),
        ("rows", _WHOLE),
        ("wide", ctypes.c_int32),
        ("high", ctypes.c_int32),
        ("fraction", _REAL),
    )
    windows: Any


class Fullness(ctypes.Structure):
    """Fullness of interpolated rows for one target size."""

    _fields_ = (("half_width_px", _REAL), ("half_height_px", _REAL), ("ratio", _REAL * len(FRACTIONS)))


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


class Settings(ctypes.Structure):
    """Inputs of location at 1 bit, other than the picture."""

    _fields_ = (
        ("min_diameter_px", _REAL),
        ("max_diameter_px", _REAL),
        ("line_jitter_px", _REAL),
        ("locale", _WHOLE),
        ("tables", _ADDRESS),
        ("table_count", _WHOLE),
        ("fullness", _ADDRESS),
        ("fullness_count", _WHOLE),
    )
