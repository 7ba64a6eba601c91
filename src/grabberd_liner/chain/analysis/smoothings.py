"""One choice of smoothing for each part of the wall's stroke: an open wall is smoother than a closed one."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grabberd.core.reconstruction import Points
from grabberd.errors import AnalysisError
from grabberd_liner.analysis import Grid, Smoothing, choose_smoothing

LEVELS = 5
"""Parts of the stroke. Each ends at half the departure of the next one, since the prior's amplitude grows
with the departure: a prior that suits a nearly open wall treats the points of a moving one as outliers."""


@dataclass(frozen=True, slots=True, eq=False)
class Smoothings:
    """Smoothings by the wall's departure from its nominal shape.

    Attributes:
        grid: target grid of the object model.
        limits_mm: (L - 1,) ascending departures that separate the levels.
        choices: L smoothings with one correlation length, that of the level with the greatest departure.
    """

    grid: Grid
    limits_mm: NDArray[np.float64]
    choices: tuple[Smoothing, ...]

    @classmethod
    def of(cls, grid: Grid, fields: Sequence[Points]) -> "Smoothings":
        """Choose from the fields of a capture.

        Raises:
            AnalysisError: no field has enough points for a surface.
        """
        departures = np.array([departure_mm(grid, points) for points in fields])
        known = departures[np.isfinite(departures)]
        if not len(known):
            raise AnalysisError(f"there are no points in {len(fields)} fields", "measure the capture first")
        limits = known.max() * 0.5 ** np.arange(LEVELS - 1, 0, -1)
        level = np.searchsorted(limits, departures)
        ascending = np.argsort(departures)
        parts = [[fields[k] for k in ascending[level[ascending] == one]] for one in range(LEVELS)]
        return cls(grid, limits, _choices(grid, parts, fields))

    def for_points(self, points: Points) -> Smoothing:
        """Smoothing of one field."""
        return self.choices[int(np.searchsorted(self.limits_mm, departure_mm(self.grid, points)))]


def _choices(
    grid: Grid, parts: Sequence[Sequence[Points]], fields: Sequence[Points]
) -> tuple[Smoothing, ...]:
    """Smoothing of each part; a part without fields, or with poor ones only, takes that of the part above."""
    chosen: list[Smoothing] = []
    # The greatest departure has the most signal to show the correlation length: it is estimated there and
    # held for the flatter levels.
    for part in reversed(parts):
        above = chosen[-1] if chosen else None
        try:
            chosen.append(choose_smoothing(grid, part, along_mm=above.along_mm if above else None))
        except AnalysisError:
            chosen.append(above or choose_smoothing(grid, fields))
    return tuple(reversed(chosen))


def departure_mm(grid: Grid, points: Points) -> float:
    """Root mean square departure of the points from the nominal shape."""
    if not len(points):
        return float("nan")
    off = points.xyz_mm - grid.nominal_mm[grid.indices(points.target)]
    return float(np.sqrt((off**2).sum(axis=1).mean()))
