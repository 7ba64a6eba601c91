"""How surely an empty liner is told from one with a teat, where the analysis expects a teat."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from tests.liner.analysis.walls import EIGHT_BITS_MM, ONE_BIT_MM, SolvedLiner, with_noise
from tests.proofs.bench.pressure_accuracy import EMPTY
from tests.proofs.bench.pressure_case import (
    Estimator,
    Given,
    Judged,
    paragraph,
    reference_points,
    refused_text,
)

from grabberd_fake.wall_states import wall_names

STATES_KPA = (10.0, 12.0, 14.0, 16.0, 20.0, 25.0, 30.0, 40.0)
"""From the open wall to the closed one."""


class Seen(NamedTuple):
    """One map, of a wall and a pressure difference."""

    wall: str
    outer_kpa: float
    judged: Judged

    @property
    def empty(self) -> bool:
        """True without a teat."""
        return self.wall.endswith(EMPTY)

    @property
    def reported_kpa(self) -> float:
        """The mean over the targets, as the map has it."""
        return self.judged.mean_error_kpa + float(SolvedLiner(self.wall).contact_kpa(self.outer_kpa).mean())


def table(walls: Sequence[str] | None = None, states_kpa: Sequence[float] = STATES_KPA) -> str:
    """Markdown, of all walls by default."""
    chosen = walls or wall_names()
    found = [one for wall in chosen for one in seen(wall, states_kpa)]
    return "\n".join([_introduction(len(chosen)), "", *_rows(found, states_kpa)])


def seen(wall: str, states_kpa: Sequence[float]) -> Iterator[Seen]:
    """Maps of one wall, of 8 and of 1 bit, its values told with one draw of errors."""
    liner, random = SolvedLiner(wall), np.random.default_rng(list(wall.encode()))
    given = Given.drawn(random)
    estimator = Estimator(liner, given, reference_points(liner, random))
    for outer_kpa in states_kpa:
        for sigma_mm in (EIGHT_BITS_MM, ONE_BIT_MM):
            points = with_noise(liner, liner.places_mm(outer_kpa), sigma_mm, random)
            yield Seen(wall, outer_kpa, estimator.judged(points, outer_kpa, given.vacuum(outer_kpa)))


def _introduction(walls: int) -> str:
    return paragraph(
        f"All {walls} solved walls, four columns, single fields of 8 and of 1",
        "bit, with the same inputs as in the",
        "tables of the contact pressure; the analysis does not know that there is no teat. For maps that are",
        "reported nevertheless, the greatest mean over the targets: up to the touch point nothing presses",
        "there, afterwards the liner itself. The limits are those by which the quantities distinguish a teat",
        "from walls that meet; none was adapted to these walls.",
    )


def _rows(found: Sequence[Seen], states_kpa: Sequence[float]) -> Iterator[str]:
    yield "| kPa over the wall | empty: refused | greatest mean of the others, kPa | on a teat: refused |"
    yield "|---|---|---|---|"
    for outer_kpa in states_kpa:
        here = [one for one in found if one.outer_kpa == outer_kpa]
        empty, pressed = ([one for one in here if one.empty is wanted] for wanted in (True, False))
        kept = [one.reported_kpa for one in empty if not one.judged.refused]
        greatest = f"{max(kept):.1f}" if kept else "none"
        refused = (refused_text([one.judged for one in some]) for some in (empty, pressed))
        yield f"| {outer_kpa:g} | {next(refused)} | {greatest} | {next(refused)} |"
