"""Model pictures of a capture's fields, all with the same box and colour scale to make them comparable."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.arrays import Array
from grabberd.core.reconstruction import ObjectModel, Points
from grabberd.errors import AnalysisError
from grabberd_liner.analysis.grid import Grid
from grabberd_liner.analysis.surface.fitting import choose_smoothing, fit_surface
from grabberd_liner.analysis.surface.smoothing import Smoothing
from grabberd_liner.analysis.surface.surface import Mesh, Surface, middles
from grabberd_liner.analysis.wall.strain import curvature_per_m, outer_forms, outer_strain
from grabberd_liner.render.wire_model import Box, Look, Painted, Scale, wire_model

_SPREAD = 12
"""Number of evenly spread fields from which box and colours are chosen."""


class Stage(NamedTuple):
    """A surface at one field and the reference, with their meshes."""

    surface: Surface
    mesh: Mesh
    reference: Mesh


class Quantity(NamedTuple):
    """Quantity shown in colour: its label, in ASCII, and its values at the mesh's corners (P, Q)."""

    label: str
    values: Callable[[Stage], Array]


def _curvature(stage: Stage) -> Array:
    return curvature_per_m(outer_forms(stage.mesh.jets, stage.surface.outward))[..., 0]


def _strain(stage: Stage) -> Array:
    stretch: Array = outer_strain(stage.mesh.jets, stage.reference.jets).stretch[..., 0] - 1
    return 100 * stretch


def _movement(stage: Stage) -> Array:
    return np.linalg.norm(stage.mesh.xyz_mm - stage.reference.xyz_mm, axis=-1)


def _sigma(stage: Stage) -> Array:
    u_mm, v_mm = stage.mesh.u_mm, stage.mesh.v_mm
    place = stage.surface.propagate(lambda jets: jets[..., 0, :], u_mm.ravel(), v_mm.ravel(), highest=0)
    spread: Array = np.sqrt((place.sigma**2).sum(axis=1))
    return spread.reshape(u_mm.shape)


QUANTITIES = {
    "height": Quantity("z  mm", lambda stage: stage.mesh.xyz_mm[..., 2]),
    "curvature": Quantity("kappa 1  1/m", _curvature),
    "strain": Quantity("strain 1  %", _strain),
    "movement": Quantity("moved  mm", _movement),
    "sigma": Quantity("sigma  mm", _sigma),
}
"""Height over the object's xy plane; greater principal curvature of the outer face; greater principal strain
of the outer face and distance moved, both since the reference field; σ of the position."""


@dataclass(frozen=True, slots=True, eq=False)
class Modelling:
    """Estimator of the surfaces of a capture's fields.

    Attributes:
        grid: target grid of the object model.
        smoothing: common smoothing of all fields.
    """

    grid: Grid
    smoothing: Smoothing

    @classmethod
    def of(cls, model: ObjectModel, fields: Sequence[Points]) -> "Modelling":
        """The estimator with a smoothing chosen for these fields.

        Raises:
            AnalysisError: there is no grid, or no field has enough points for a surface.
        """
        grid = Grid.of(model)
        if not grid.homologous:
            raise AnalysisError(
                f"the targets of {model.name!r} are others in every field: there is no model to draw",
                "`grabberd analyse` gives its surface and sections field by field",
            )
        return cls(grid, choose_smoothing(grid, fields))

    def surface(self, points: Points) -> Surface:
        """The surface of a field.

        Raises:
            AnalysisError: the points determine no surface.
        """
        return fit_surface(self.grid, points, self.smoothing)


@dataclass(slots=True, eq=False)
class Gallery:
    """Draws fields of a capture in the same style.

    Attributes:
        modelling: estimator of the surfaces.
        reference: mesh of the reference field for strain and movement.
        quantity: quantity shown in colour, or None for shading only.
        box: space shown by all pictures.
        scale: scale of the colours.
    """

    modelling: Modelling
    reference: Mesh
    quantity: Quantity | None
    box: Box
    scale: Scale | None = field(default=None)

    @classmethod
    def of(
        cls, modelling: Modelling, fields: Sequence[Points], reference: Points, quantity: str | None
    ) -> "Gallery":
        """A gallery with box and colours that suit these fields.

        Args:
            modelling: estimator of the surfaces.
            fields: all fields to be drawn.
            reference: reference field for strain and movement.
            quantity: one of `QUANTITIES`, or None.

        Raises:
            AnalysisError: no field, or not the reference, determines a surface.
        """
        stages = _stages(modelling, fields, Mesh.of(modelling.surface(reference)))
        shown = np.concatenate([_supported_corners(stage.mesh) for stage in stages])
        gallery = cls(
            modelling, stages[0].reference, QUANTITIES[quantity] if quantity else None, Box.round(shown)
        )
        if gallery.quantity:
            values = [gallery.values(stage)[stage.mesh.supported] for stage in stages]
            gallery.scale = Scale.over(gallery.quantity.label, np.concatenate(values))
        return gallery

    def values(self, stage: Stage) -> Array:
        """(P − 1, Q − 1) values of the quantity at the facets."""
        assert self.quantity is not None
        return middles(self.quantity.values(stage))

    def picture(self, points: Points | None, look: Look, caption: str) -> NDArray[np.uint8]:
        """(height, width, 3) uint8: the model at one field, or the empty box if it has no surface."""
        try:
            surface = self.modelling.surface(points) if points is not None else None
        except AnalysisError:
            surface = None
        outward, painted = self.modelling.grid.outward, None
        if surface is None:
            return wire_model(None, outward, self.box, look, caption=f"{caption}: no surface")
        mesh = Mesh.of(surface)
        if self.scale:
            painted = Painted(self.values(Stage(surface, mesh, self.reference)), self.scale)
        return wire_model(mesh, outward, self.box, look, painted, caption)


def _stages(modelling: Modelling, fields: Sequence[Points], reference: Mesh) -> list[Stage]:
    chosen = np.unique(np.linspace(0, len(fields) - 1, _SPREAD).round().astype(int))
    stages, last = [], None
    for index in chosen:
        try:
            surface = modelling.surface(fields[index])
        except AnalysisError as error:
            last = error
            continue
        stages.append(Stage(surface, Mesh.of(surface), reference))
    if not stages:
        raise last or AnalysisError("no fields to draw", "choose fields that have points")
    return stages


def _supported_corners(mesh: Mesh) -> Array:
    return mesh.xyz_mm.reshape(-1, 3)[np.unique(mesh.corners())]
