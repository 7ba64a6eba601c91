"""The wall at one field or phase: all that follows from its points (paper 3.8)."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.analysis import (
    Area,
    ChamberVacuum,
    Estimate,
    Forms,
    Grid,
    Jets,
    Plane,
    PressureMap,
    PressureModel,
    Section,
    Smoothing,
    Surface,
    Zone,
    curvature_per_m,
    fit_surface,
    middle_forms,
    outer_forms,
    section,
    surface_area,
    volume_mm3,
    wall_at,
    wall_tension,
)
from grabberd.analysis.material import VARIED, Wall, varied
from grabberd.analysis.strain import strain
from grabberd.errors import AnalysisError
from grabberd.reconstruction import Points

Array = NDArray[np.float64]
OfJets = Callable[[Jets, Jets | None], Array]

_BENT = 2
"""The highest derivative that curvature, strain of the middle surface and tension look at."""


@dataclass(frozen=True, slots=True, eq=False)
class Question:
    """What is asked of every field of a capture alike.

    Attributes:
        grid: of the object model; the places are its targets.
        heights_mm: of the sections.
        plane: what widths are taken from, where the targets do not go round.
        reference: the state that strain is counted from: measured, or jets (N, 15, 3) taken as exact.
        zones: the wall's material; none where it was not given.
        pressure: the model of the maps, where all that it takes was given.
    """

    grid: Grid
    heights_mm: tuple[float, ...] = ()
    plane: Plane | None = None
    reference: Surface | Jets | None = None
    zones: tuple[Zone, ...] = ()
    pressure: PressureModel | None = None

    @property
    def places(self) -> tuple[Array, Array]:
        """u_mm and v_mm of the targets, (N,) each."""
        return self.grid.u_mm, self.grid.v_mm


class WallState(NamedTuple):
    """The wall at the N targets of the grid; NaN where data do not support a place.

    Attributes:
        surface: the outer (target) face.
        within: (N,) whether data support each place.
        xyz_mm: (N, 3) the smooth face at the targets, object's frame.
        curvature_per_m: (N, 2) κ1 ≥ κ2 of the middle surface where the wall's material is known, of the outer
            face otherwise.
        strain: (N, 2) principal strains λ − 1 of the same surface, the greater first; None without reference.
        tension_n_per_m: (N, 2) T1 ≥ T2, its σ from points and material; None without reference or material.
        pressure: the map; None where something that it takes was not given, or nothing is determined.
        area: of the outer face.
        sections: at the heights that were asked for and that the wall reaches.
        volume_mm3: between first and last of them and the plane; None without.
        problems: what was survived, in words.
    """

    surface: Surface
    within: NDArray[np.bool_]
    xyz_mm: Estimate
    curvature_per_m: Estimate
    strain: Estimate | None
    tension_n_per_m: Estimate | None
    pressure: PressureMap | None
    area: Area
    sections: tuple[Section, ...]
    volume_mm3: Estimate | None
    problems: tuple[str, ...]


def wall_state(
    points: Points, question: Question, smoothing: Smoothing, vacuum: ChamberVacuum | None = None
) -> WallState:
    """The wall at one field.

    Raises:
        AnalysisError: the points make no surface.
    """
    surface = fit_surface(question.grid, points, smoothing)
    within = surface.within(*question.places)
    problems = list(surface.problems)
    pressure = _pressure(surface, question, vacuum, problems)
    sections = _sections(surface, question, problems)
    curvature, strained, tension = _of_the_wall(surface, question)
    return WallState(
        surface=surface,
        within=within,
        xyz_mm=_masked(_xyz(surface, question), within),
        curvature_per_m=_masked(curvature, within),
        strain=strained and _masked(strained, within),
        tension_n_per_m=tension and _masked(tension, within),
        pressure=pressure,
        area=surface_area(surface),
        sections=sections,
        volume_mm3=_volume(surface, question, sections),
        problems=tuple(problems),
    )


def _xyz(surface: Surface, question: Question) -> Estimate:
    places = question.places
    straight = np.broadcast_to(np.eye(3), (len(places[0]), 1, 3, 3))
    return Estimate(surface.jets(*places)[:, 0], surface.sigma(straight, *places))


def _masked(estimate: Estimate, within: NDArray[np.bool_]) -> Estimate:
    return Estimate(*(np.where(within[:, np.newaxis], part, np.nan) for part in estimate))


def _of_the_wall(surface: Surface, question: Question) -> tuple[Estimate, Estimate | None, Estimate | None]:
    """Curvature, strain and tension at once: they share the forms, which are most of the work."""
    wall, others = _walls(question)
    together = _against(surface, question, lambda now, then: _values(question, wall, now, then))
    curvature, strained, tension = (
        Estimate(together.value[:, k : k + 2], together.sigma[:, k : k + 2]) for k in (0, 2, 4)
    )
    if question.reference is None:
        return curvature, None, None
    if wall is None:
        return curvature, strained, None
    now, then = surface.jets(*question.places), _reference_jets(question)
    shares = [_values(question, other, now, then)[:, 4:] - tension.value for other in others]
    sigma = np.sqrt(tension.sigma**2 + sum((share**2 for share in shares), np.zeros_like(tension.sigma)))
    return curvature, strained, Estimate(tension.value, sigma)


@lru_cache(maxsize=4)
def _walls(question: Question) -> tuple[Wall | None, tuple[Wall, ...]]:
    """The material at the places, and with one of its inputs a σ higher."""
    if not question.zones:
        return None, ()
    changed = (varied(question.zones, name) for name in VARIED)
    u_mm = question.grid.u_mm
    return wall_at(question.zones, u_mm), tuple(wall_at(zones, u_mm) for zones in changed if zones)


def _values(question: Question, wall: Wall | None, now: Jets, then: Jets | None) -> Array:
    """(..., N, 2 to 6) curvature; with a reference strain; with material too tension: two values of each."""
    present = _forms(question, wall, now)
    values = [curvature_per_m(present).values]
    if then is not None:
        before = _forms(question, wall, then)
        values.append(strain(present.tangents, before.tangents).stretch.values - 1)
        if wall is not None:
            values.append(wall_tension(present, before.first, wall).principal_n_per_m.values)
    return np.concatenate(np.broadcast_arrays(*values), axis=-1)


def _forms(question: Question, wall: Wall | None, jets: Jets) -> Forms:
    outward = question.grid.outward
    return outer_forms(jets, outward) if wall is None else middle_forms(jets, wall.depth_mm, outward)


def _against(surface: Surface, question: Question, function: OfJets) -> Estimate:
    """With σ of the reference too, where it was measured."""
    if isinstance(question.reference, Surface):
        return surface.propagate(function, *question.places, question.reference, highest=_BENT)
    then = question.reference
    return surface.propagate(lambda now: function(now, then), *question.places, highest=_BENT)


def _reference_jets(question: Question) -> Jets:
    reference = question.reference
    if isinstance(reference, Surface):
        return reference.jets(*question.places)
    assert reference is not None
    return reference


def _pressure(
    surface: Surface, question: Question, vacuum: ChamberVacuum | None, problems: list[str]
) -> PressureMap | None:
    if question.pressure is None or vacuum is None:
        return None
    try:
        return question.pressure.map(surface, vacuum)
    except AnalysisError as error:
        problems.append(error.message)
        return None


def _sections(surface: Surface, question: Question, problems: list[str]) -> tuple[Section, ...]:
    found = []
    for height_mm in question.heights_mm:
        try:
            found.append(section(surface, height_mm, question.plane))
        except AnalysisError as error:
            problems.append(error.message)
    return tuple(found)


def _volume(surface: Surface, question: Question, sections: tuple[Section, ...]) -> Estimate | None:
    if question.plane is None or len(sections) < 2:
        return None
    return volume_mm3(surface, (sections[0].x_mm, sections[-1].x_mm), question.plane)
