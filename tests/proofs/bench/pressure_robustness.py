"""What becomes of the contact pressure where something is off that the estimator takes for right."""

from collections.abc import Callable, Iterator, Mapping
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from tests.liner.analysis.walls import EIGHT_BITS_MM, SolvedLiner, as_points
from tests.proofs.bench.pressure_case import (
    Estimator,
    Figures,
    Given,
    Judged,
    paragraph,
    reference_points,
    refused_text,
)

from grabberd.core.reconstruction import Points
from grabberd_fake.wall_states import wall_names

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

WALLS = ("reference-round", "stiffening-blunt", "tapered-pointed")
TWO, ONE = WALLS[:2], WALLS[:1]
OFF_CENTRE = ("reference-round-across", "reference-round-towards")
RUBBING = ("rubbing-round", "rubbing-blunt", "rubbing-pointed")
STATES_KPA = (16.0, 36.0)
DRAWS = 2
"""Of the noise, for every state."""
GLUED = 37
"""Index of a target in an inner column, halfway along."""
GLUED_MM = (0.7, 0.7)
"""Along and round the liner: 1 mm."""
UNEVEN_MM, UNEVEN_LENGTH_MM = 0.05, 60.0
FIGURES = ("mean error", "RMS", "χ²", "refused")
VIEW_RAD, VIEW_SIGMA = np.radians(15.0), 10.0
"""Of one view off the middle between both; and how many times worse a place is known along it."""


HEADS = ("what is off", "walls", *FIGURES, "σ says so: mean error", *FIGURES[1:])


class Aside(NamedTuple):
    """One thing that is off.

    Attributes:
        label: the row's.
        given: what the estimator is told; `told`: the same with a σ that admits the error, if there is one.
        seen: name of the points, one of `SEEN`; `reference`: of those of the open liner, one of `REFERENCES`.
        judged: name of the places judged, one of `JUDGED`.
        unseen: what is taken for the hidden half.
    """

    label: str
    walls: tuple[str, ...] = WALLS
    given: Given = Given()
    told: Given | None = None
    columns: int = 4
    seen: str = "plain"
    reference: str = "plain"
    judged: str = "all"
    unseen: str = "free"


def table() -> str:
    """Markdown of all that may be off."""
    _estimator.cache_clear()
    _judged.cache_clear()
    rows = [_row(aside) for aside in asides()]
    states = " and ".join(f"{kpa:g}" for kpa in STATES_KPA)
    introduction = paragraph(
        f"Solved walls as above: {', '.join(WALLS)}, or the first one or two of them,",
        f"at {states} kPa over the wall; single fields of 8 bit, {DRAWS} draws of the noise,",
        "four columns unless stated. In each row one input is wrong and all",
        "others are right, first with the σ",
        "after a ramp with the empty liner, then with a σ as large as the error. Errors are estimate minus",
        "truth, kPa, at the targets; refused maps are excluded. A target glued",
        "1 mm off is judged together with",
        "its neighbours. One view alone: σ along its direction, 15° off the",
        "middle, is ten times larger. Teats",
        "off centre are round ones in the reference liner.",
    )
    return "\n".join(
        [
            introduction,
            "",
            f"| {' | '.join(HEADS)} |",
            "|" + "---|" * len(HEADS),
            *rows,
        ]
    )


def asides() -> Iterator[Aside]:
    """All rows."""
    yield Aside("nothing")
    yield from _vacuum()
    yield from _points()
    yield from _shape()
    yield from _material()


def _material() -> Iterator[Aside]:
    # Half the rows would be mirror images: thickness and pretension act the other way as much.
    for name, text, errors in (
        ("E", "E", (0.2, -0.2)),
        ("wall", "thickness", (0.05,)),
        ("F0", "pretension", (0.3,)),
    ):
        for error in errors:
            off = Given()._replace(**{name: error})
            told = off._replace(**{f"{name}_sigma": error}) if error > 0 else None
            yield Aside(f"{text} told {100 * error:+.0f} %", TWO, given=off, told=told)


def _vacuum() -> Iterator[Aside]:
    for what, error in (
        ("pressure difference", 1.0),
        ("clock by 10 ms at 300 kPa/s: pressure difference", 3.0),
    ):
        for sign in (1, -1):
            off = Given(kpa=sign * error)
            told = off._replace(kpa_sigma=float(np.hypot(Given().kpa_sigma, error)))
            yield Aside(f"{what} told {sign * error:+.0f} kPa", given=off, told=told)


def _points() -> Iterator[Aside]:
    yield Aside("half the columns hidden: the seen ones", ONE, seen="half", judged="seen")
    yield Aside("half the columns hidden: the hidden ones", ONE, seen="half", judged="hidden")
    yield Aside("one view alone", seen="one view")
    for reference, text in (("glued", "seen"), ("without", "not seen")):
        label = f"a target glued 1 mm off, {text} in the reference"
        yield Aside(label, ONE, seen="glued", reference=reference, judged="glued")
    yield Aside("no reference, the object model's places", reference="none")
    uneven = f"mirrors uneven: z off by {UNEVEN_MM:g} mm over {UNEVEN_LENGTH_MM:g} mm"
    yield Aside(f"{uneven}, reference too", ONE, seen="uneven", reference="uneven")
    yield Aside(f"{uneven}, no reference", seen="uneven", reference="none")
    yield Aside("six columns, nothing off", TWO, columns=6)
    yield Aside("hidden half mirrored, nothing off", TWO, unseen="mirrored")


def _shape() -> Iterator[Aside]:
    yield Aside("friction of .3 on the teat", RUBBING)
    for wall in OFF_CENTRE:
        if wall not in wall_names():
            continue
        side = wall.rsplit("-", 1)[1]
        for columns in (4, 6):
            for hidden in ("free", "mirrored"):
                label = f"teat 1 mm off, {side} the view; {columns} columns, hidden half {hidden}"
                yield Aside(label, (wall,), columns=columns, unseen=hidden)


def maps(aside: Aside, given: Given, states_kpa: tuple[float, ...] = STATES_KPA) -> list[Judged]:
    """All maps of a row, as an estimator finds them that is told this."""
    found = []
    for wall in aside.walls:
        chosen = JUDGED[aside.judged](_liner(wall, aside.columns))
        judged = _judged(wall, aside.columns, given, aside.seen, aside.reference, aside.unseen, states_kpa)
        found += [one.only(chosen) for one in judged]
    return found


@cache
def _judged(
    wall: str,
    columns: int,
    given: Given,
    seen: str,
    reference: str,
    unseen: str,
    states_kpa: tuple[float, ...],
) -> list[Judged]:
    liner = _liner(wall, columns)
    # One estimator is told all pressure differences: its linearised models do not depend on them.
    material = given._replace(kpa=Given().kpa, kpa_sigma=Given().kpa_sigma)
    estimator = _estimator(wall, columns, material, reference, unseen)
    found = []
    for outer_kpa in states_kpa:
        for draw in range(DRAWS):
            points = SEEN[seen](liner, outer_kpa, np.random.default_rng(draw))
            found.append(estimator.judged(points, outer_kpa, given.vacuum(outer_kpa)))
    return found


def _row(aside: Aside) -> str:
    cells = [aside.label, str(len(aside.walls)), *_cells(maps(aside, aside.given))]
    cells += _cells(maps(aside, aside.told)) if aside.told else [""] * 4
    return f"| {' | '.join(cells)} |"


def _cells(found: list[Judged]) -> list[str]:
    figures = Figures.of_places(found)
    if not np.isfinite(figures.rms):
        return ["none", "none", "none", refused_text(found)]
    return [f"{figures.bias:+.1f}", f"{figures.rms:.1f}", f"{figures.chi2:.2f}", refused_text(found)]


@cache
def _liner(wall: str, columns: int) -> SolvedLiner:
    return SolvedLiner(wall, columns)


@cache
def _estimator(wall: str, columns: int, given: Given, reference: str, unseen: str) -> Estimator:
    liner = _liner(wall, columns)
    return Estimator(liner, given, REFERENCES[reference](liner), unseen)


def _plain(liner: SolvedLiner, outer_kpa: float, random: np.random.Generator) -> Points:
    return _noisy(liner.places_mm(outer_kpa), random)


def _noisy(places_mm: Array, random: np.random.Generator) -> Points:
    return as_points(places_mm + random.normal(size=places_mm.shape) * EIGHT_BITS_MM, EIGHT_BITS_MM)


def _half(liner: SolvedLiner, outer_kpa: float, random: np.random.Generator) -> Points:
    return _plain(liner, outer_kpa, random).select(_first_half(liner))


def _first_half(liner: SolvedLiner) -> Mask:
    half: Mask = 2 * liner.grid.column < liner.grid.column.max() + 1
    return half


def _glued_mm(liner: SolvedLiner, outer_kpa: float) -> Array:
    places = liner.places_mm(outer_kpa)
    places[GLUED] = liner.moved_mm(outer_kpa, *GLUED_MM)[GLUED]
    return places


def _glued(liner: SolvedLiner, outer_kpa: float, random: np.random.Generator) -> Points:
    return _noisy(_glued_mm(liner, outer_kpa), random)


def _near_glued(liner: SolvedLiner) -> Mask:
    apart = [np.abs(part - part[GLUED]) for part in (liner.grid.row, liner.grid.column)]
    near: Mask = np.maximum(*apart) <= 1
    return near


def _uneven(places_mm: Array) -> Array:
    """Places as mirrors show them that are not flat."""
    wave = 2 * np.pi * places_mm[:, :2] / UNEVEN_LENGTH_MM
    return places_mm + np.outer(UNEVEN_MM * np.sin(wave[:, 0]) * np.cos(wave[:, 1]), [0.0, 0.0, 1.0])


def _through_mirrors(liner: SolvedLiner, outer_kpa: float, random: np.random.Generator) -> Points:
    return _noisy(_uneven(liner.places_mm(outer_kpa)), random)


def _one_view(liner: SolvedLiner, outer_kpa: float, random: np.random.Generator) -> Points:
    along = np.array([0.0, np.sin(VIEW_RAD), np.cos(VIEW_RAD)])
    deep = VIEW_SIGMA * EIGHT_BITS_MM[2]
    covariance = np.diag(EIGHT_BITS_MM**2) + deep**2 * np.outer(along, along)
    places = liner.places_mm(outer_kpa)
    noise = random.multivariate_normal(np.zeros(3), covariance, size=len(places))
    points = as_points(places + noise, EIGHT_BITS_MM)
    points.covariance_mm2[:] = covariance
    return points


def _glued_reference(liner: SolvedLiner) -> Points:
    points = _open(liner)
    points.xyz_mm[GLUED] += _glued_mm(liner, 0.0)[GLUED] - liner.places_mm(0.0)[GLUED]
    return points


def _uneven_reference(liner: SolvedLiner) -> Points:
    points = _open(liner)
    points.xyz_mm[:] = _uneven(points.xyz_mm)
    return points


def _open(liner: SolvedLiner) -> Points:
    return reference_points(liner, np.random.default_rng(0))


SEEN: Mapping[str, Callable[[SolvedLiner, float, np.random.Generator], Points]] = {
    "plain": _plain,
    "half": _half,
    "glued": _glued,
    "uneven": _through_mirrors,
    "one view": _one_view,
}
REFERENCES: Mapping[str, Callable[[SolvedLiner], Points | None]] = {
    "plain": _open,
    "none": lambda _: None,
    "glued": _glued_reference,
    "without": lambda liner: _open(liner).select(np.arange(len(liner.grid)) != GLUED),
    "uneven": _uneven_reference,
}
JUDGED: Mapping[str, Callable[[SolvedLiner], Mask]] = {
    "all": lambda liner: np.ones(len(liner.grid), bool),
    "seen": _first_half,
    "hidden": lambda liner: ~_first_half(liner),
    "glued": _near_glued,
}
