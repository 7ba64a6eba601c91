"""A liner for the tests: a tube that collapses elliptically about its middle, seen by the reference rig."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from core.geometry.rigs import calibration
from grabberd.core.geometry import project
from grabberd.core.reconstruction import ObjectModel, ViewBlobs

ROWS, COLUMNS, PITCH_MM, RADIUS_MM = 18, 6, 6.5, 13.75
TOP_MM = 4.0
SIGMA_PX = np.array([0.17, 0.225])
_ARC = np.linspace(0.0, 1.0, 2001)


def quarter(half_depth_mm: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Arc length from the top, and Y and Z over the axis, of an ellipse with the round tube's perimeter."""
    low, high = RADIUS_MM, 1.7 * RADIUS_MM
    for _ in range(50):
        half_width = 0.5 * (low + high)
        y, z = half_width * np.sin(_ARC * np.pi / 2), half_depth_mm * np.cos(_ARC * np.pi / 2)
        arc = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(y), np.diff(z)))])
        low, high = (low, half_width) if arc[-1] > RADIUS_MM * np.pi / 2 else (half_width, high)
    return arc, y, z


@lru_cache
def wall(deflection_mm: float) -> tuple[np.ndarray, np.ndarray]:
    """(108, 3) places and outward normals: constant intervals along the wall, deepest in the middle row."""
    places, normals = [], []
    x = (np.arange(ROWS) - (ROWS - 1) / 2) * PITCH_MM
    s = (np.arange(COLUMNS) - (COLUMNS - 1) / 2) * PITCH_MM
    depth = deflection_mm * np.cos(np.pi * x / (ROWS - 1) / PITCH_MM) ** 2
    for row in range(ROWS):
        arc, y, z = quarter(RADIUS_MM - depth[row])
        at_y, at_z = np.interp(abs(s), arc, y) * np.sign(s), np.interp(abs(s), arc, z)
        places.append(np.column_stack([np.full(COLUMNS, x[row]), at_y, at_z - RADIUS_MM + TOP_MM]))
        out = np.column_stack([np.zeros(COLUMNS), at_y / y[-1] ** 2, at_z / z[0] ** 2])
        normals.append(out / np.linalg.norm(out, axis=1, keepdims=True))
    return np.concatenate(places), np.concatenate(normals)


def model() -> ObjectModel:
    """The liner at rest."""
    row, column = np.divmod(np.arange(ROWS * COLUMNS, dtype=np.int32), np.int32(COLUMNS))
    return ObjectModel("liner", np.arange(1, 109, dtype=np.int32), wall(0.0)[0], row, column, 1.5, 0.05)


@dataclass(frozen=True)
class Scene:
    """One field: blobs of both views, and which target (index) each is; -1 for a false one."""

    xyz: np.ndarray
    left: ViewBlobs
    right: ViewBlobs
    left_is: np.ndarray
    right_is: np.ndarray

    @property
    def visible(self) -> set[int]:
        """Targets that have a blob in both views."""
        return (set(self.left_is.tolist()) & set(self.right_is.tolist())) - {-1}


def see(xyz, normals, rng, rig=None, noise=1.5, missing=0.1, false=0.05, sigma_px=SIGMA_PX) -> Scene:
    """What both views show of targets, in any order; missing and false ones are drawn anew for each view."""
    seen = []
    for view in (rig or calibration()).views:
        toward = view.center_mm - xyz
        facing = (toward * normals).sum(axis=1) / np.linalg.norm(toward, axis=1) > np.cos(np.radians(78))
        here = np.flatnonzero(facing & (rng.random(len(xyz)) >= missing))
        stray = round(false * len(here))
        pixels = project(view, xyz[here])
        pixels += rng.normal(size=pixels.shape) * noise * sigma_px
        low, high = pixels.min(axis=0) - 15, pixels.max(axis=0) + 15
        pixels = np.concatenate([pixels, rng.uniform(low, high, (stray, 2))])
        identity = np.concatenate([here, np.full(stray, -1)])
        order = rng.permutation(len(pixels))
        sigma = np.tile(np.maximum(noise, 0.1) * sigma_px, (len(pixels), 1))
        seen.append((ViewBlobs(pixels[order], sigma), identity[order]))
    return Scene(xyz, seen[0][0], seen[1][0], seen[0][1], seen[1][1])
