"""How far the contact pressure is off, on solved walls that its prior was not made with."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from tests.liner.analysis.walls import (
    EIGHT_BITS_MM,
    ONE_BIT_MM,
    SolvedLiner,
    outermost_alone,
    rig,
    with_noise,
)
from tests.proofs.bench.pressure_case import (
    REFERENCE_MM,
    Estimator,
    Figures,
    Given,
    Judged,
    paragraph,
    refused_text,
)

DESIGNS = ("stiffening", "wide", "rubbing", "tapered")
"""Set aside: the prior was made with other liners."""
EMPTY = "empty"
TEATS = ("round", "blunt", "pointed", EMPTY)
FOUR, FOUR_AND_TWO, SIX = "4", "4 + 2", "6"
COLUMNS = {FOUR: DESIGNS, FOUR_AND_TWO: ("tapered", "rubbing"), SIX: ("tapered", "rubbing")}
"""Columns that both views see, and those beside them that one view alone sees; liners judged with them."""
NOISE_MM = {8: EIGHT_BITS_MM, 1: ONE_BIT_MM}
PHASES = {"closing": (16.0,), "closed": (30.0, 40.0)}
"""Pressure differences, kPa, of the states that are judged."""
FIELD, PHASE, CYCLE = "one field", "phase mean", "cycle mean"
FIELDS = {FIELD: 1, PHASE: 10}
"""Number of fields whose points are averaged."""
DRAWS = 2
"""Of the noise, for every state."""


class Found(NamedTuple):
    """One map of a case, and where it belongs in the tables.

    Attributes:
        averaged: `FIELD`, `PHASE` or `CYCLE`; `phase`: one of `PHASES`, "all" for a cycle's mean.
        inner: (N,) True for targets that are not in an outermost column.
    """

    design: str
    teat: str
    columns: str
    bits: int
    averaged: str
    phase: str
    outer_kpa: float
    judged: Judged
    inner: NDArray[np.bool_]


def table() -> str:
    """Markdown of all tables."""
    found = [one for name, columns in _cases() for one in case(name, columns)]
    return "\n".join([_introduction(), "", *_pooled(found), "", *_by_teat(found), "", *_by_state(found)])


def _cases() -> Iterator[tuple[str, str]]:
    for columns, designs in COLUMNS.items():
        for design in designs:
            for teat in TEATS:
                if columns == FOUR or teat != EMPTY:
                    yield f"{design}-{teat}", columns


def case(name: str, columns: str, phases: dict[str, tuple[float, ...]] = PHASES) -> list[Found]:
    """All maps of one wall, by an estimator that is told its values with one draw of their errors."""
    liner = SolvedLiner(name, 4 if columns == FOUR else 6)
    random = np.random.default_rng([len(columns), *name.encode()])
    given = Given.drawn(random)
    shown = outermost_alone if columns == FOUR_AND_TWO else with_noise
    reference = shown(liner, liner.places_mm(0.0), REFERENCE_MM, random)
    estimator = Estimator(liner, given, reference, rig=rig())
    found = []
    for phase, states in phases.items():
        for outer_kpa in states:
            for bits, sigma_mm in NOISE_MM.items():
                for averaged, fields in FIELDS.items():
                    make = partial(_found, liner, columns, bits, averaged, phase, outer_kpa)
                    for _ in range(DRAWS):
                        deviation = sigma_mm / np.sqrt(fields)
                        points = shown(liner, liner.places_mm(outer_kpa), deviation, random)
                        judged = estimator.judged(points, outer_kpa, given.vacuum(outer_kpa))
                        found.append(make(judged))
    return found + [
        _found(liner, columns, bits, CYCLE, "all", np.nan, judged)
        for bits in NOISE_MM
        for judged in _cycles(found, bits)
    ]


def _found(
    liner: SolvedLiner,
    columns: str,
    bits: int,
    averaged: str,
    phase: str,
    outer_kpa: float,
    judged: Judged,
) -> Found:
    design, teat = liner.name.split("-")
    return Found(design, teat, columns, bits, averaged, phase, outer_kpa, judged, liner.inner)


def _cycles(found: Sequence[Found], bits: int) -> Iterator[Judged]:
    """Means over the cycle's phase means; σ is averaged as it is, for the liner's errors are common."""
    maps = [one.judged for one in found if (one.bits, one.averaged) == (bits, PHASE)]
    for draw in range(DRAWS):
        kept = [one for one in maps[draw::DRAWS] if not one.refused]
        if not kept:
            yield Judged.refusal(len(maps[0].error_kpa))
            continue
        yield Judged(
            np.mean([one.error_kpa for one in kept], axis=0),
            np.mean([one.sigma_kpa for one in kept], axis=0),
            float(np.mean([one.mean_error_kpa for one in kept])),
            float(np.mean([one.mean_sigma_kpa for one in kept])),
            False,
        )


def _introduction() -> str:
    closing, closed = (", ".join(f"{kpa:g}" for kpa in states) for states in PHASES.values())
    return paragraph(
        "Walls solved as solids, by equations that the estimator does not",
        "share, with the noise of 8 or 1 bit",
        "added to the target positions (no pictures are rendered). The liners",
        f"({', '.join(DESIGNS)}) are not those from which the prior of the load",
        "was made. There are four columns",
        f"of 18 targets, 6.5 mm apart; on {' and '.join(COLUMNS[SIX])} also six,",
        "and four plus two (4 + 2), of",
        "which one view sees the first only, and the other the last. For each wall, the errors of modulus,",
        "thickness, pretension and pressure difference are drawn once from the",
        "σ given to the estimator: 3.5 %,",
        "2 %, 10 % and .5 kPa, as after a ramp with the empty liner.",
        f"Closing: {closing} kPa over the wall; closed: {closed} kPa.",
        f"A phase mean is the mean of {FIELDS[PHASE]} fields,",
        "a cycle mean that of these states' phase means, with σ taken as common to them.",
        "RMS error / RMS stated σ (χ²), kPa; refused maps are excluded, and their share is given.",
    )


HEADS = ("inner columns", "outermost seen", "mean of the seen part", "refused")


def _pooled(found: Sequence[Found]) -> Iterator[str]:
    yield "All teats together, the empty liner apart (below)."
    yield ""
    yield from _head("columns", "bits", "of", "phase")
    for columns in COLUMNS:
        for bits in NOISE_MM:
            for averaged, phases in _ways():
                for phase in phases:
                    labels = (columns, str(bits), averaged, phase)
                    wanted = (columns, bits, averaged, phase)
                    yield _row(labels, [one for one in found if _key(one) == wanted and one.teat != EMPTY])


def _by_teat(found: Sequence[Found]) -> Iterator[str]:
    yield "Single fields, teat by teat."
    yield ""
    yield from _head("columns", "bits", "teat", "phase")
    for columns in COLUMNS:
        for bits in NOISE_MM:
            for teat in TEATS:
                for phase in PHASES if columns == FOUR or teat != EMPTY else ():
                    labels = (columns, str(bits), "none" if teat == EMPTY else teat, phase)
                    wanted = (columns, bits, FIELD, phase)
                    yield _row(labels, [one for one in found if _key(one) == wanted and one.teat == teat])


def _by_state(found: Sequence[Found]) -> Iterator[str]:
    yield "Single fields of 8 bit with four columns, all teats, by the pressure difference and by the liner."
    yield ""
    yield from _head("kPa or liner")
    single = [one for one in found if (one.columns, one.bits, one.averaged) == (FOUR, 8, FIELD)]
    pressed = [one for one in single if one.teat != EMPTY]
    for kpa in (kpa for states in PHASES.values() for kpa in states):
        yield _row((f"{kpa:g}",), [one for one in pressed if one.outer_kpa == kpa])
    for design in DESIGNS:
        yield _row((design,), [one for one in pressed if one.design == design])


def _ways() -> Iterator[tuple[str, tuple[str, ...]]]:
    for averaged in FIELDS:
        yield averaged, tuple(PHASES)
    yield CYCLE, ("all",)


def _key(one: Found) -> tuple[str, int, str, str]:
    return one.columns, one.bits, one.averaged, one.phase


def _head(*labels: str) -> Iterator[str]:
    yield f"| {' | '.join([*labels, *HEADS])} |"
    yield "|" + "---|" * (len(labels) + len(HEADS))


def _row(labels: Sequence[str], found: Sequence[Found]) -> str:
    def places(chosen: Callable[[Found], NDArray[np.bool_]]) -> str:
        return Figures.of_places(one.judged.only(chosen(one)) for one in found).text()

    maps = [one.judged for one in found]
    cells = [places(lambda one: one.inner), places(lambda one: ~one.inner), Figures.of_means(maps).text()]
    return f"| {' | '.join([*labels, *cells, refused_text(maps)])} |"
