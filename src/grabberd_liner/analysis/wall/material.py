"""The wall's material, an input without silent defaults."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.errors import AnalysisError, InputError

Array = NDArray[np.float64]

LAWS = ("neo_hookean", "linear")
VARIED = ("E_mpa", "wall_mm", "F0_n")
"""Inputs whose σ contributes to that of the pressure; each has its σ in a field of its own."""

_HINT = "give the values of the very liner in the teatcup"
_ENDS = ("first_end_mm", "last_end_mm")
_CORRELATIONS = ("E_wall_correlation", "E_F0_correlation", "F0_wall_correlation")
_SIGMAS = {"E_mpa": "E_sigma_mpa", "wall_mm": "wall_sigma_mm", "F0_n": "F0_sigma_n"}
_OPTIONAL = (*_SIGMAS.values(), *_CORRELATIONS, *_ENDS)


@dataclass(frozen=True, slots=True)
class Material:
    """The liner's wall as mounted, in the reference state, and its law.

    Attributes:
        E_mpa: Young's modulus.
        wall_mm: thickness of the wall, as mounted.
        poisson: ν; .5 for the law `neo_hookean`, which keeps the volume.
        F0_n: axial mounting force; 0 is allowed, but has to be given.
        radius_mm: radius of the mounted liner's middle surface: the mounting tension is F0 / 2πR.
        target_mm: thickness of the targets on the outer face.
        law: `neo_hookean` or `linear` (in the stretches λ − 1).
        first_end_mm: x, in the object's frame, of the end at lesser x that holds the liner; `last_end_mm`: of
            the other one. Pressures alone need them.
        E_sigma_mpa: σ of E; 0 takes E as exact. `wall_sigma_mm`, `F0_sigma_n` likewise.
        E_wall_correlation: correlation of E and wall, as a ramp with the empty liner gives it: E t³ is better
            known than either. `E_F0_correlation`, `F0_wall_correlation` likewise.

    Raises:
        InputError: values are impossible; the message names all of them.
    """

    E_mpa: float
    wall_mm: float
    poisson: float
    F0_n: float
    radius_mm: float
    target_mm: float
    law: str
    first_end_mm: float | None = None
    last_end_mm: float | None = None
    E_sigma_mpa: float = 0.0
    wall_sigma_mm: float = 0.0
    F0_sigma_n: float = 0.0
    E_wall_correlation: float = 0.0
    E_F0_correlation: float = 0.0
    F0_wall_correlation: float = 0.0

    def __post_init__(self) -> None:
        problems = [
            problem for problem in (*_numbers(self), *_law(self), _ends(self), _related(self)) if problem
        ]
        if problems:
            raise InputError(f"the wall's material cannot be used: {'; '.join(problems)}", _HINT)

    @property
    def ends_mm(self) -> tuple[float, float] | None:
        """X of both ends, in the object's frame; None if one is unknown."""
        if self.first_end_mm is None or self.last_end_mm is None:
            return None
        return self.first_end_mm, self.last_end_mm

    @property
    def correlations(self) -> tuple[float, float, float]:
        """Correlations of E and wall, of E and F0, of wall and F0."""
        return self.E_wall_correlation, self.E_F0_correlation, self.F0_wall_correlation

    @property
    def depth_mm(self) -> float:
        """Depth of the middle surface below the targets' face."""
        return self.wall_mm / 2 + self.target_mm

    def varied(self, name: str) -> "Material":
        """The material with one of `VARIED` raised by its σ."""
        return replace(self, **{name: getattr(self, name) + getattr(self, _SIGMAS[name])})


def _numbers(material: Material) -> list[str]:
    above = ("E_mpa", "wall_mm", "radius_mm")
    from_zero = ("F0_n", "target_mm", *_SIGMAS.values())
    problems = [_problem(material, name, "above 0", lambda v: v > 0) for name in above]
    problems += [_problem(material, name, "from 0", lambda v: v >= 0) for name in from_zero]
    if material.wall_mm >= 2 * material.radius_mm > 0:
        problems.append(f"wall_mm is {material.wall_mm:g}: thicker than a liner of this radius can be")
    return problems


def _problem(material: Material, name: str, expected: str, good: object) -> str:
    value = getattr(material, name)
    return "" if np.isfinite(value) and good(value) else f"{name} is {value:g}, expected {expected}"  # type: ignore[operator]


def _ends(material: Material) -> str:
    ends = material.ends_mm
    if ends is None or ends[0] < ends[1]:
        return ""
    return f"first_end_mm is {ends[0]:g}, expected below last_end_mm, {ends[1]:g}"


def _related(material: Material) -> str:
    young_wall, young_force, wall_force = correlations = material.correlations
    determinant = 1 + 2 * young_wall * young_force * wall_force - sum(np.square(correlations))
    if determinant >= 0 and max(map(abs, correlations)) <= 1:
        return ""
    said = ", ".join(f"{one:g}" for one in correlations)
    return f"the correlations of E, wall and F0 are {said}, which no three values can have"


def _law(material: Material) -> list[str]:
    problems = []
    if material.law not in LAWS:
        problems.append(f"law is {material.law!r}, known are {', '.join(LAWS)}")
    if not 0 <= material.poisson <= 0.5:
        problems.append(f"poisson is {material.poisson:g}, expected 0 to .5")
    elif material.law == "neo_hookean" and material.poisson != 0.5:
        problems.append(f"poisson is {material.poisson:g}, but the law neo_hookean keeps the volume: .5")
    return problems


class Zone(NamedTuple):
    """A part of the liner with a material of its own, from one coordinate u along the liner to another.

    Attributes:
        first_u_mm: start of the zone; `last_u_mm`: its end, both included.
        material: material of the zone.
    """

    first_u_mm: float
    last_u_mm: float
    material: Material

    @classmethod
    def of_rows(cls, first: int, last: int, pitch_mm: float, material: Material) -> "Zone":
        """The zone of some rows of targets, extended by half a pitch at both ends."""
        return cls((first - 0.5) * pitch_mm, (last + 0.5) * pitch_mm, material)


class Wall(NamedTuple):
    """The material at N positions; (V, N) for several variants of it.

    Attributes:
        E_mpa: Young's modulus; `wall_mm`: thickness; `poisson`: Poisson's ratio.
        along: axial stretch of the wall by the pre-tension before the reference state; `across`: the
            accompanying stretch round it.
        depth_mm: depth of the middle surface below the targets' face.
        neo_hookean: True for the neo-Hookean law, False for the linear one.
    """

    E_mpa: Array
    wall_mm: Array
    poisson: Array
    along: Array
    across: Array
    depth_mm: Array
    neo_hookean: NDArray[np.bool_]

    @property
    def stiffness_n_mm(self) -> Array:
        """D = E t³ / 12 (1 − ν²) in N mm."""
        return self.E_mpa * self.wall_mm**3 / (12 * (1 - self.poisson**2))


def lacking(inputs: Mapping[str, object]) -> tuple[str, ...]:
    """Names of the missing inputs of a material, which tension and pressure need."""
    needed = [field.name for field in fields(Material) if field.name not in _OPTIONAL]
    return tuple(name for name in needed if inputs.get(name) is None)


def wall_at(zones: Sequence[Zone], u_mm: Array) -> Wall:
    """The wall at N positions along the liner.

    Raises:
        AnalysisError: a position lies in no zone or in two.
    """
    chosen = _zone_of(zones, u_mm)
    walls = [_wall(zone.material) for zone in zones]
    return Wall(*(np.array(values)[chosen] for values in zip(*walls, strict=True)))


def varied(zones: Sequence[Zone], name: str) -> list[Zone] | None:
    """The zones with one of `VARIED` raised by its σ in all of them; None if none has a σ of it."""
    if not any(getattr(zone.material, _SIGMAS[name]) for zone in zones):
        return None
    return [zone._replace(material=zone.material.varied(name)) for zone in zones]


def _zone_of(zones: Sequence[Zone], u_mm: Array) -> NDArray[np.intp]:
    inside = np.array([(zone.first_u_mm <= u_mm) & (u_mm <= zone.last_u_mm) for zone in zones])
    inside = inside.reshape(len(zones), *np.shape(u_mm))
    _check(u_mm, inside.sum(axis=0) == 0, "no zone of the material")
    interior = np.array([(zone.first_u_mm < u_mm) & (u_mm < zone.last_u_mm) for zone in zones])
    _check(u_mm, interior.reshape(inside.shape).sum(axis=0) > 1, "more than one zone of the material")
    chosen: NDArray[np.intp] = inside.argmax(axis=0)
    return chosen


def _check(u_mm: Array, wrong: NDArray[np.bool_], where: str) -> None:
    if wrong.any():
        places = u_mm[wrong]
        raise AnalysisError(
            f"{wrong.sum()} places lie in {where}, from u = {places.min():.1f} to {places.max():.1f} mm",
            "let the zones follow each other along the liner, from its first row of targets to its last",
        )


def _wall(material: Material) -> tuple[float, float, float, float, float, float, bool]:
    along, across = pre_stretch(material)
    neo = material.law == "neo_hookean"
    return (material.E_mpa, material.wall_mm, material.poisson, along, across, material.depth_mm, neo)


def pre_stretch(material: Material) -> tuple[float, float]:
    """Stretches along and round the liner due to the mounting force, with the wall free to narrow.

    They yield the tension F0 / 2πR along the liner and none round it: λ³ − λ F0/(2πR µ t) = 1 for the
    neo-Hookean law (µ = E/3, t as mounted), λ = 1 + F0/(2πR E t) for the linear one.
    """
    load = material.F0_n / (2 * np.pi * material.radius_mm * material.E_mpa * material.wall_mm)
    if material.law == "linear":
        return 1 + load, 1 - material.poisson * load
    along = neo_hookean_stretch(3 * load)
    return along, along**-0.5


def neo_hookean_stretch(load: float) -> float:
    """λ with λ² − 1/λ = load, of a bar that is free to narrow; the load is divided by its section and by µ.

    The section is that of the stretched bar: λ³ − load λ = 1.
    """
    # From beyond the root, where the cubic is convex, Newton's method comes down to it.
    stretch, last = max(1.0, 1.0 + load), np.inf
    while stretch < last:
        last = stretch
        stretch -= (stretch**3 - load * stretch - 1) / (3 * stretch**2 - load)
    return last
