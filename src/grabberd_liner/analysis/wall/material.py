"""The wall's material, an input: its values, the tension by its law, and its document, one material for the
whole liner or one for each zone of rows. Modulus, thickness and mounting force never have a default.

The state before mounting → (pre-tension, `Wall.along` and `Wall.across`) → the reference state, mounted →
(measured) → the present one: the stretches compose, and the law sees them all at once.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import NamedTuple

import numpy as np

from grabberd.core.arrays import Array, Indices, Mask
from grabberd.core.geometry import Reading
from grabberd.errors import AnalysisError, InputError
from grabberd_liner.analysis.grid import Grid, NominalShape
from grabberd_liner.analysis.wall.strain import determinant, inverse, trace

LAWS = ("neo_hookean", "linear")
VARIED = ("E_mpa", "wall_mm", "F0_n")
"""Inputs whose σ contributes to that of the pressure; each has its σ in a field of its own."""

_HINT = "give the values of the very liner in the teatcup"
_ENDS = ("first_end_mm", "last_end_mm")
_CORRELATIONS = ("E_wall_correlation", "E_F0_correlation", "F0_wall_correlation")
_SIGMAS = {"E_mpa": "E_sigma_mpa", "wall_mm": "wall_sigma_mm", "F0_n": "F0_sigma_n"}


@dataclass(frozen=True, slots=True)
class Material:
    """The liner's wall as mounted, in the reference state, and its law.

    Attributes:
        E_mpa: Young's modulus.
        wall_mm: thickness of the wall, as mounted.
        poisson: ν; .5 for the law `neo_hookean`, which keeps the volume.
        F0_n: axial mounting force; 0 is allowed, but has to be given.
        radius_mm: radius of the mounted liner's middle surface: the mounting tension is F0 / 2πR. NaN where
            it is that of the object model, which `read_zones` puts in.
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
    F0_n: float
    target_mm: float
    poisson: float = 0.5
    radius_mm: float = float("nan")
    law: str = LAWS[0]
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
    above = ("E_mpa", "wall_mm", *(() if np.isnan(material.radius_mm) else ("radius_mm",)))
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
    neo_hookean: Mask

    @property
    def stiffness_n_mm(self) -> Array:
        """D = E t³ / 12 (1 − ν²) in N mm."""
        return self.E_mpa * self.wall_mm**3 / (12 * (1 - self.poisson**2))


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


def _zone_of(zones: Sequence[Zone], u_mm: Array) -> Indices:
    inside = np.array([(zone.first_u_mm <= u_mm) & (u_mm <= zone.last_u_mm) for zone in zones])
    inside = inside.reshape(len(zones), *np.shape(u_mm))
    _check(u_mm, inside.sum(axis=0) == 0, "no zone of the material")
    interior = np.array([(zone.first_u_mm < u_mm) & (u_mm < zone.last_u_mm) for zone in zones])
    _check(u_mm, interior.reshape(inside.shape).sum(axis=0) > 1, "more than one zone of the material")
    return inside.argmax(axis=0)


def _check(u_mm: Array, wrong: Mask, where: str) -> None:
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


_UNIT = np.eye(2)


def mixed_tension(first: Array, reference_first: Array, wall: Wall) -> Array:
    """(..., 2, 2) T^α_β in N/mm."""
    squared = total_stretch_squared(reference_first, wall) @ first
    neo, linear = _neo_hookean(squared, wall), _linear(squared, wall)
    return np.where(wall.neo_hookean[..., None, None], neo, linear)


def total_stretch_squared(reference_first: Array, wall: Wall) -> Array:
    """(..., 2, 2) contravariant components of B = F Fᵀ, from before mounting to the present state.

    The pre-tension acts along the rows' coordinate u.
    """
    along = np.zeros_like(reference_first)
    along[..., 0, 0] = 1 / reference_first[..., 0, 0]
    across = inverse(reference_first) - along
    return _tensor(wall.along) ** 2 * along + _tensor(wall.across) ** 2 * across


def _neo_hookean(squared: Array, wall: Wall) -> Array:
    """µ t λ3 (B − λ3² 1), with µ = E/3, t and the thickness stretch before B from the mounted wall."""
    total = determinant(squared)
    measured = np.sqrt(total) / (wall.along * wall.across)
    scale = wall.E_mpa / 3 * wall.wall_mm / measured
    return _tensor(scale) * (squared - _tensor(1 / total) * _UNIT)


def _linear(squared: Array, wall: Wall) -> Array:
    """E t / (1 − ν²) [(1 − ν) ε + ν tr ε 1] with ε = V − 1, V² = B; V by Cayley and Hamilton."""
    root = np.sqrt(determinant(squared))
    stretch = (squared + _tensor(root) * _UNIT) / _tensor(np.sqrt(trace(squared) + 2 * root))
    strain = stretch - _UNIT
    own, even = _tensor(1 - wall.poisson), _tensor(wall.poisson * trace(strain))
    scale = wall.E_mpa * wall.wall_mm / (1 - wall.poisson**2)
    return _tensor(scale) * (own * strain + even * _UNIT)


def _tensor(scalar: Array) -> Array:
    return np.asarray(scalar)[..., None, None]


_KEYS = tuple(field.name for field in fields(Material))
_ZONE_KEYS = ("rows", *_KEYS)
_OPTIONAL_KEYS = tuple(
    name for name in _KEYS if any(part in name for part in ("sigma", "end", "correlation", "radius"))
)
_DOCUMENT_HINT = "give the values of the very liner in the teatcup"


class Part(NamedTuple):
    """A material as a document gives it, for the first to the last of its rows; None: for all of them."""

    rows: tuple[int, int] | None
    material: Material


def read_zones(document: Mapping[str, object], grid: Grid) -> tuple[Zone, ...]:
    """The zones of a document on the grid of an object model, as `read_parts` takes it.

    Args:
        document: see `read_parts`.
        grid: targets of the object model, which tell the wall's radius where the document does not.

    Raises:
        InputError: See `read_parts`; or there is no radius.
    """
    whole = 0, int(grid.row.max())
    return tuple(
        Zone.of_rows(*(rows or whole), grid.u_pitch_mm, _with_radius(one, grid))
        for rows, one in read_parts(document)
    )


def _with_radius(material: Material, grid: Grid) -> Material:
    if not np.isnan(material.radius_mm):
        return material
    face_mm = NominalShape.of(grid).radius_mm
    if not face_mm:
        raise InputError(
            "the wall's material lacks radius_mm, and the object model's targets lie on no tube",
            _DOCUMENT_HINT,
        )
    return replace(material, radius_mm=face_mm - material.depth_mm)


def read_parts(document: Mapping[str, object]) -> tuple[Part, ...]:
    """The materials of a document: the keys of `Material`, or `zones`, a list with the same keys and `rows`.

    Args:
        document: {E_mpa: …, wall_mm: …, …}, or {zones: [{rows: [first, last], E_mpa: …, …}, …]}, rows counted
            from 0 as in the grid, both included.

    Raises:
        InputError: a key is missing, unknown or of a wrong type (all are named), or values are impossible.
    """
    reading = Reading("the wall's material")
    if "zones" not in document:
        material = _material(reading, document, "", _KEYS)
        reading.finish(_DOCUMENT_HINT)
        return (Part(None, Material(**material)),)  # type: ignore[arg-type]
    reading.keys("", document, ("zones",))
    entries = _entries(reading, document["zones"])
    found = [_zone(reading, entry, f"zones[{at}].") for at, entry in enumerate(entries)]
    reading.finish(_DOCUMENT_HINT)
    return tuple(Part((first, last), Material(**material)) for first, last, material in found)  # type: ignore[arg-type]


def _entries(reading: Reading, zones: object) -> list[Mapping[str, object]]:
    if isinstance(zones, str) or not isinstance(zones, Sequence) or not zones:
        reading.refuse("zones", zones, "a list of zones")
        return []
    wrong = [zone for zone in zones if not isinstance(zone, Mapping)]
    for zone in wrong:
        reading.refuse("zones", zone, f"a mapping of {', '.join(_ZONE_KEYS)}")
    return [] if wrong else list(zones)


def _zone(reading: Reading, entry: Mapping[str, object], where: str) -> tuple[int, int, dict[str, object]]:
    first, last = reading.numbers(entry.get("rows"), where + "rows", (2,))
    if not (0 <= first <= last and float(first).is_integer() and float(last).is_integer()):
        reading.refuse(where + "rows", entry.get("rows"), "first and last row, counted from 0")
    return int(first), int(last), _material(reading, entry, where, _ZONE_KEYS)


def _material(
    reading: Reading, entry: Mapping[str, object], where: str, known: Sequence[str]
) -> dict[str, object]:
    reading.keys(where, entry, known)
    values: dict[str, object] = {"law": reading.text(entry, "law", where) if "law" in entry else LAWS[0]}
    # The law neo_hookean keeps the volume, so that Poisson's ratio has no choice.
    optional = (*_OPTIONAL_KEYS, "law", *(("poisson",) if values["law"] == LAWS[0] else ()))
    for name in _KEYS:
        if name != "law" and not (name in optional and name not in entry):
            values[name] = reading.number(entry, name, where)
    return values
