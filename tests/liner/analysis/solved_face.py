"""Outer face of walls that were solved as solids: its sections, area and volume, from their tables alone."""

from typing import NamedTuple

import numpy as np

from grabberd_fake.wall_states import Patch

from .walls import SolvedLiner


class Outline(NamedTuple):
    """A section from the first column of targets to the last, over the plane z = 0.

    Attributes:
        length_mm, chord_mm: along it, and between its ends; `distance_mm`: of it from the plane at y = 0.
        area_mm2: between it and the plane.
    """

    length_mm: float
    chord_mm: float
    distance_mm: float
    area_mm2: float


class SolvedFace:
    """The face at one pressure difference, between the outermost targets."""

    def __init__(self, liner: SolvedLiner, outer_kpa: float) -> None:
        """Samples it finely."""
        theta = np.linspace(liner.theta[0], liner.theta[-1], 241)
        x_mm = np.linspace(liner.x_mm[0], liner.x_mm[-1], 681)
        self._points, _ = Patch(liner.states, x_mm, theta).surface(liner.states.outer_mm(outer_kpa))

    def outline(self, height_mm: float) -> Outline:
        """The section at x = `height_mm`."""
        points = self._at(height_mm)
        return Outline(
            float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum()),
            float(np.linalg.norm(points[-1] - points[0])),
            float(np.interp(0.0, points[:, 1], points[:, 2])),
            float(np.trapezoid(points[:, 2], points[:, 1])),
        )

    def volume_mm3(self, first_mm: float, last_mm: float) -> float:
        """Between two sections and the plane."""
        heights = np.linspace(first_mm, last_mm, 111)
        return float(np.trapezoid([self.outline(height).area_mm2 for height in heights], heights))

    def area_mm2(self) -> float:
        """Of the whole face."""
        points = self._points
        along, across = np.diff(points, axis=0), np.diff(points, axis=1)
        lower, upper = np.cross(along[:, :-1], across[:-1]), np.cross(along[:, 1:], across[1:])
        return float((np.linalg.norm(lower, axis=2) + np.linalg.norm(upper, axis=2)).sum() / 2)

    def _at(self, height_mm: float) -> np.ndarray:
        columns = self._points.transpose(1, 0, 2)
        return np.array([[np.interp(height_mm, one[:, 0], part) for part in one.T] for one in columns])
