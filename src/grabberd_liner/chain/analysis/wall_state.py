"""State of the wall at one field or phase, computed from its points (paper 3.8), and the question it
answers: what an analysis asks of every field of a capture.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.arrays import Array, Indices, Mask
from grabberd.core.geometry import Rig
from grabberd.core.reconstruction import Points, SingleViewImages
from grabberd.errors import AnalysisError
from grabberd_liner.analysis.estimate import Estimate
from grabberd_liner.analysis.grid import Grid
from grabberd_liner.analysis.load.pressure import PressureMap
from grabberd_liner.analysis.load.wall_surfaces import MiddleSurface
from grabberd_liner.analysis.pulsation.movement import TimedPoints
from grabberd_liner.analysis.surface.free_surface import Height, Tube
from grabberd_liner.analysis.surface.jets import Jets
from grabberd_liner.analysis.surface.sections import (
    Area,
    Face,
    Plane,
    Section,
    sections,
    surface_area,
    volume_mm3,
)
from grabberd_liner.analysis.surface.surface import Surface, propagate
from grabberd_liner.analysis.wall.material import VARIED, Wall, Zone, mixed_tension, varied, wall_at
from grabberd_liner.analysis.wall.strain import (
    Forms,
    Places,
    edge_strain,
    middle_forms,
    mixed,
    outer_forms,
    outer_places,
    principal_values,
    triangle_strain,
)


class FieldPoints(NamedTuple):
    """The points of one field; `time_s` from the capture's first field."""

    n: int
    timed: TimedPoints


class SingleViews(NamedTuple):
    """Sources for targets that one view alone sees.

    Attributes:
        rig: whose views saw the points; None if such targets are of no use.
        images: gives their images in some fields, by the field's number, where the points lack them; or None.
    """

    rig: Rig | None = None
    images: Callable[[Sequence[int]], Mapping[int, SingleViewImages]] | None = None

    def points(self, fields: Sequence[FieldPoints]) -> list[Points]:
        """Points of some fields, with these images where they are known."""
        images = self.images([one.n for one in fields]) if self.images else {}
        return [
            replace(one.timed.points, single=images[one.n]) if one.n in images else one.timed.points
            for one in fields
        ]


_SEEN_IN = 0.5
"""Share of the fields of an average in which a target has to be seen."""


def averaged_fields(fields: Sequence[FieldPoints], count: int) -> list[FieldPoints]:
    """Means of so many fields each, one after the other, numbered from 0; the last may be of fewer."""
    if count <= 1:
        return list(fields)
    parts = [fields[first : first + count] for first in range(0, len(fields), count)]
    return [FieldPoints(n, _mean([one.timed for one in part])) for n, part in enumerate(parts)]


def _mean(fields: Sequence[TimedPoints]) -> TimedPoints:
    time_s = float(np.mean([one.time_s for one in fields]))
    return TimedPoints(time_s, _mean_points([one.points for one in fields]))


def _mean_points(parts: Sequence[Points]) -> Points:
    joined = Points.joined(parts)
    mean = _Mean(joined.target, len(parts))
    return Points(
        mean.known,
        mean.of(joined.xyz_mm),
        mean.of(joined.covariance_mm2) / mean.count[:, np.newaxis, np.newaxis],
        mean.of(joined.calibration_covariance_mm2),
        mean.of(joined.image_px),
        mean.of(joined.residual_px),
        _mean_singles([one.single for one in parts if one.single], len(parts), mean.known),
    )


def _mean_singles(
    parts: Sequence[SingleViewImages], fields: int, by_both: NDArray[np.int32]
) -> SingleViewImages | None:
    if not parts:
        return None
    target, view, image_px, sigma_px = (
        np.concatenate([getattr(one, name) for one in parts])
        for name in ("target", "view", "image_px", "sigma_px")
    )
    alone = ~np.isin(target, by_both)
    # A target that now one view sees alone and now the other would count twice: the view that sees it more.
    mean = _Mean(2 * target[alone] + view[alone], fields)
    variance = mean.of(np.square(sigma_px[alone])) / mean.count[:, np.newaxis]
    image_px = mean.of(image_px[alone])
    best = np.lexsort((-mean.count, mean.known // 2))
    _, first = np.unique(mean.known[best] // 2, return_index=True)
    at = best[first]
    known = mean.known[at]
    return SingleViewImages(
        (known // 2).astype(np.int32), (known % 2).astype(np.intp), image_px[at], np.sqrt(variance[at])
    )


class _Mean:
    """Means over the rows that belong to the same key, of the keys that most fields have."""

    def __init__(self, keys: NDArray[np.int32], fields: int) -> None:
        known, self._at, count = np.unique(keys, return_inverse=True, return_counts=True)
        self._often, self._count = count >= _SEEN_IN * fields, count
        self.known, self.count = known[self._often], count[self._often]

    def of(self, values: Array) -> Array:
        """Means of (N, …) values."""
        summed = np.zeros((len(self._count), *values.shape[1:]))
        np.add.at(summed, self._at, values)
        mean: Array = summed / self._count.reshape(-1, *(1,) * (values.ndim - 1))
        return mean[self._often]


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


class TargetStrains(NamedTuple):
    """Stretches of triangles of neighbouring targets, and of the edges between two; no more is kept.

    Attributes:
        triangle: (K,) indices of `Grid.triangles`; `triangle_stretch`: (K, 2) principal ones.
        edge: (E, 2) indices of the targets; `edge_stretch`: (E,).
    """

    triangle: Indices
    triangle_stretch: Estimate
    edge: Indices
    edge_stretch: Estimate


def target_strains(points: Points, question: Question) -> TargetStrains | None:
    """The strains; None without a reference state, or if no target is seen in both states."""
    if question.reference_places is None:
        return None
    grid, reference = question.grid, question.reference_places
    places = outer_places(grid, points)
    try:
        triangles, edges = triangle_strain(grid, places, reference), edge_strain(grid, places, reference)
    except AnalysisError:
        return None
    return TargetStrains(triangles.triangle, triangles.stretch, edges.edge, edges.stretch)


OfJets = Callable[[Jets, Jets | None], Array]

EQUILIBRIUM, SMOOTH = "equilibrium", "smooth"
_BENT = 2
"""Highest derivative that curvature, strain of the middle surface and tension depend on."""


class WallState(NamedTuple):
    """The wall at the N targets of the grid; NaN at targets without supporting data.

    It holds no surface: with its covariance, that of a capture's every field would fill the memory.

    Attributes:
        within: (N,) True for targets that are supported by data.
        xyz_mm: (N, 3) points of the outer face at the targets, object's frame.
        method: where all but `strains` is from: `EQUILIBRIUM`, the wall that explains the targets, or
            `SMOOTH`, the surface through them.
        curvature_per_m: (N, 2) κ1 ≥ κ2 of the middle surface if the wall's material is known, else of the
            outer face.
        strain: (N, 2) principal strains λ − 1 of the same surface, the greater first; None without reference.
        tension_n_per_m: (N, 2) T1 ≥ T2, its σ from points and material; None without reference or material.
        pressure: pressure map; None if an input is missing or the wall has no equilibrium.
        area: area of the outer face.
        sections: sections at those requested heights that the wall reaches.
        volume_mm3: volume between the first and last section and the plane; None without a plane.
        strains: strains of triangles and edges between targets; None without reference, or if no target is
            seen in both states.
        misfit: of the points by the face, as in `Face`.
        problems: problems that did not prevent a result, as sentences.
    """

    within: Mask
    xyz_mm: Estimate
    method: str
    curvature_per_m: Estimate
    strain: Estimate | None
    tension_n_per_m: Estimate | None
    pressure: PressureMap | None
    area: Area
    sections: tuple[Section, ...]
    volume_mm3: Estimate | None
    strains: TargetStrains | None
    misfit: float
    problems: tuple[str, ...]


def wall_states(
    points: Sequence[Points],
    faces: Sequence[Face],
    question: Question,
    maps: Sequence[PressureMap | None],
) -> list[WallState]:
    """The wall at several fields, evaluated together, which is faster than one by one.

    Args:
        points: points of the fields.
        faces: the outer face at each; a `Surface` unless the map has a middle surface.
        question: quantities to compute.
        maps: map of the pressure at each field; None where there is none.
    """
    middles = [one.middle if one else None for one in maps]
    surfaces = [
        one for one, known in zip(faces, middles, strict=True) if isinstance(one, Surface) and not known
    ]
    smooth = iter(_smooth(surfaces, question))
    walls = [middle or next(smooth) for middle in middles]
    each = zip(points, faces, walls, maps, strict=True)
    return [_state(*one, question) for one in each]


class _SmoothWall(NamedTuple):
    """Quantities as in `MiddleSurface`, of a smooth surface; None for those that were not asked for."""

    curvature_per_m: Estimate
    strain: Estimate | None
    tension_n_per_m: Estimate | None


def _state(
    points: Points,
    face: Face,
    wall: MiddleSurface | _SmoothWall,
    pressure: PressureMap | None,
    question: Question,
) -> WallState:
    within = face.within(*question.places)
    found, missed = sections(face, question.heights_mm, question.plane)
    return WallState(
        within=within,
        xyz_mm=_masked(face.places_mm(*question.places), within),
        method=EQUILIBRIUM if isinstance(wall, MiddleSurface) else SMOOTH,
        curvature_per_m=_masked(wall.curvature_per_m, within),
        strain=wall.strain and _masked(wall.strain, within),
        tension_n_per_m=wall.tension_n_per_m and _masked(wall.tension_n_per_m, within),
        # The state has what is of the middle surface, where data support it.
        pressure=pressure and pressure._replace(middle=None),
        area=surface_area(face),
        sections=found,
        volume_mm3=_volume(face, question, found),
        strains=target_strains(points, question),
        misfit=face.misfit,
        problems=(*face.problems, *_refused(pressure), *missed),
    )


def _refused(pressure: PressureMap | None) -> tuple[str, ...]:
    """The reason why a map has no pressure anywhere, if it has none."""
    if pressure is None:
        return ()
    if len(set(pressure.reason)) == 1 and pressure.reason[0]:  # of the field, so the same for many of them
        return pressure.reason[:1]
    try:
        pressure.determined()
    except AnalysisError as error:
        return (error.message,)
    return ()


def _masked(estimate: Estimate, within: Mask) -> Estimate:
    return Estimate(*(np.where(within[:, np.newaxis], part, np.nan) for part in estimate))


def _smooth(surfaces: Sequence[Surface], question: Question) -> list[_SmoothWall]:
    """Curvature, strain and tension at once: they share the forms, which are most of the work."""
    if not surfaces:
        return []
    wall, others = _walls(question)
    stacked = _against(surfaces, question, lambda now, then: _values(question, wall, now, then))
    parts = [_parts(Estimate(*one)) for one in zip(*stacked, strict=True)]
    if question.reference is None or wall is None:
        return parts
    now = np.stack([surface.jets(*question.places) for surface in surfaces])
    then = _reference_jets(question)[np.newaxis]
    # Only the tension depends on the material (columns 4 and 5). Each input is varied by its σ and the
    # changes are added in quadrature: the inputs are independent of one another and of the points.
    shares = [_values(question, other, now, then)[..., 4:] - stacked.value[..., 4:] for other in others]
    material = sum((share**2 for share in shares), np.zeros_like(stacked.value[..., 4:]))
    return [_with_material(part, more) for part, more in zip(parts, material, strict=True)]


def _parts(stacked: Estimate) -> _SmoothWall:
    """Split (N, 2 to 6) into pairs; None for quantities that were not computed."""
    pairs = [Estimate(*(part[:, k : k + 2] for part in stacked)) for k in (0, 2, 4)]
    return _SmoothWall(pairs[0], *(pair if pair.value.size else None for pair in pairs[1:]))


def _with_material(part: _SmoothWall, more: Array) -> _SmoothWall:
    """Add the material's share (N, 2) to the tension's variance."""
    assert part.tension_n_per_m is not None
    value, sigma = part.tension_n_per_m
    return part._replace(tension_n_per_m=Estimate(value, np.sqrt(sigma**2 + more)))


@lru_cache(maxsize=4)
def _walls(question: Question) -> tuple[Wall | None, tuple[Wall, ...]]:
    """The material at the targets, then the material with one of its inputs raised by its σ."""
    if not question.zones:
        return None, ()
    changed = (varied(question.zones, name) for name in VARIED)
    u_mm = question.grid.u_mm
    return wall_at(question.zones, u_mm), tuple(wall_at(zones, u_mm) for zones in changed if zones)


def _values(question: Question, wall: Wall | None, now: Jets, then: Jets | None) -> Array:
    """(..., N, 2 to 6) curvature, with a reference also strain, with material also tension; pairs of each."""
    present = _forms(question, wall, now)
    values = [1e3 * principal_values(mixed(present.first, present.second_per_mm))]
    if then is not None:
        before = _forms(question, wall, then).first
        values.append(np.sqrt(principal_values(mixed(before, present.first))) - 1)
        if wall is not None:
            values.append(1e3 * principal_values(mixed_tension(present.first, before, wall)))
    return np.concatenate(np.broadcast_arrays(*values), axis=-1)


def _forms(question: Question, wall: Wall | None, jets: Jets) -> Forms:
    outward = question.outward
    return outer_forms(jets, outward) if wall is None else middle_forms(jets, wall.depth_mm, outward)


def _against(surfaces: Sequence[Surface], question: Question, function: OfJets) -> Estimate:
    """Propagate a function of the present and the reference state, with σ of a measured reference."""
    if isinstance(question.reference, Surface):
        return propagate(surfaces, function, question.places, question.reference, highest=_BENT)
    then = question.reference
    return propagate(surfaces, lambda now: function(now, then), question.places, highest=_BENT)


def _reference_jets(question: Question) -> Jets:
    reference = question.reference
    if isinstance(reference, Surface):
        return reference.jets(*question.places)
    assert reference is not None
    return reference


def _volume(face: Face, question: Question, sections: tuple[Section, ...]) -> Estimate | None:
    if question.plane is None or len(sections) < 2:
        return None
    return volume_mm3(face, (sections[0].x_mm, sections[-1].x_mm), question.plane)
