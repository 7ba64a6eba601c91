"""Question of an analysis: what it asks of every field of a capture."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from grabberd_liner.analysis import Grid, Height, Jets, Places, Plane, Surface, Tube, Zone

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Question:
    """Quantities to compute for every field of a capture.

    Attributes:
        grid: target grid of the object model; results are evaluated at its targets.
        heights_mm: heights of the sections, x in the object's frame.
        plane: origin of widths if the targets do not go all the way round.
        reference: reference state of the strain: measured, or jets (N, 15, 3) taken as exact.
        reference_places: targets in that state; None without one.
        zones: the wall's material; empty if unknown.
        over: base shape of surfaces whose targets differ from field to field; results are then evaluated at
            positions fixed in space, the nominal ones, without reference and zones.
    """

    grid: Grid
    heights_mm: tuple[float, ...] = ()
    plane: Plane | None = None
    reference: Surface | Jets | None = None
    reference_places: Places | None = None
    zones: tuple[Zone, ...] = ()
    over: Tube | Height | None = None

    @property
    def places(self) -> tuple[Array, Array]:
        """u_mm and v_mm of the targets, (N,) each."""
        return self.over.material(self.grid.nominal_mm) if self.over else (self.grid.u_mm, self.grid.v_mm)

    @property
    def outward(self) -> float:
        """1 if X_u × X_v points outward, −1 if inward; outward over a tube or a plane."""
        return 1.0 if self.over else self.grid.outward
