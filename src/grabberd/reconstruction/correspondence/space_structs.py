"""Structures of space.h, filled in from a rig, an object and their settings."""

import ctypes
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from grabberd.geometry import LocalField, Rig

_WHOLE, _REAL, _ADDRESS = ctypes.c_int64, ctypes.c_double, ctypes.c_void_p
_MOST_ERRORS = 36


class _LocalField(ctypes.Structure):
    _fields_ = (
        ("origin_px", _REAL * 2),
        ("step_px", _REAL),
        ("sigma_px", _ADDRESS),
        ("rows", _WHOLE),
        ("columns", _WHOLE),
    )


class _Rig(ctypes.Structure):
    _fields_ = (
        ("rotation", _REAL * 18),
        ("rates", _REAL * 54),
        ("center_mm", _REAL * 6),
        ("f_mm", _REAL * 2),
        ("origin_px", _REAL * 4),
        ("pixel_mm", _REAL * 4),
        ("image", _REAL * 240),
        ("factor", _ADDRESS),
        ("errors", _WHOLE),
        ("local", _LocalField * 2),
    )


class World(ctypes.Structure):
    """Data that do not change from field to field; keeps alive the arrays that it points to."""

    _fields_ = (
        ("rig", _Rig),
        ("targets", _WHOLE),
        ("pairs", _WHOLE),
        ("nominal_mm", _ADDRESS),
        ("neighbours", _ADDRESS),
        ("apart_mm", _ADDRESS),
        ("gate", _REAL),
        ("stretch", _REAL),
        ("unmodelled_px", _REAL),
        ("noise_mm", _REAL),
        ("blob_jitter_px", _REAL),
        ("radius_lines", _REAL),
    )
    kept: list[Any]

    @classmethod
    def of(cls, rig: Rig, arrays: dict[str, NDArray[Any]], numbers: dict[str, float]) -> Self:
        """Fill in from a rig of two views and the object's arrays and numbers, by the names above."""
        kept = {name: np.ascontiguousarray(one) for name, one in arrays.items()}
        addresses = {name: one.ctypes.data for name, one in kept.items()}
        world = cls(targets=len(kept["nominal_mm"]), pairs=len(kept["neighbours"]), **addresses, **numbers)
        world.kept = [kept, world._fill(rig)]
        return world

    def _fill(self, rig: Rig) -> list[NDArray[np.float64]]:
        for name in ("rotation", "center_mm", "f_mm", "origin_px", "pixel_mm", "image"):
            values = getattr(rig, name).ravel().tolist()
            setattr(self.rig, name, type(getattr(self.rig, name))(*values))
        self.rig.rates = (_REAL * 54)(*rig.rotation_rates.ravel().tolist())
        kept = []
        if rig.factor is not None:
            kept.append(np.ascontiguousarray(rig.factor))
            self.rig.factor, self.rig.errors = kept[-1].ctypes.data, rig.factor.shape[2]
        for index, one in enumerate(rig.local_fields):
            if one is not None:
                kept.append(np.ascontiguousarray(one.sigma_px))
                self.rig.local[index] = _local(one, kept[-1])
        return kept


def _local(field: LocalField, sigma_px: NDArray[np.float64]) -> _LocalField:
    return _LocalField(
        (_REAL * 2)(*field.origin_px), field.step_px, sigma_px.ctypes.data, *sigma_px.shape[:2]
    )


def takes(rig: Rig) -> bool:
    """True if the kernel covers this rig."""
    return len(rig.views) == 2 and (rig.factor is None or rig.factor.shape[2] <= _MOST_ERRORS)
