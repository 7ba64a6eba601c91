"""How far curvature and strain of the middle surface are off on solved walls, by either method."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from tests.liner.analysis.solved_middle import solved_middle
from tests.liner.analysis.walls import SolvedLiner, as_points, pressure_map
from tests.proofs.bench.pressure_accuracy import DESIGNS, NOISE_MM, TEATS
from tests.proofs.bench.pressure_case import SOUGHT_KPA, Figures, Given, paragraph, reference_points

from grabberd.core.reconstruction import Points
from grabberd.errors import AnalysisError
from grabberd_liner.analysis.estimate import Estimate
from grabberd_liner.analysis.load.pressure import PressureModel
from grabberd_liner.analysis.surface.fitting import fit_surface
from grabberd_liner.analysis.wall.strain import outer_places
from grabberd_liner.chain.analysis.wall_series import Smoothings
from grabberd_liner.chain.analysis.wall_state import EQUILIBRIUM, SMOOTH, Question, WallState, wall_states

Array = NDArray[np.float64]

PHASES = {"open": (4.0, 8.0), "closing": (16.0,), "closed": (30.0, 40.0)}
"""Pressure differences, kPa, of the states that are judged."""
COLUMNS = 4
QUANTITIES = ("κ1, 1/m", "κ2, 1/m", "ε1, %", "ε2, %")
_PER_CENT = 100.0


class Compared(NamedTuple):
    """Errors and σ (N, 4) of one state's `QUANTITIES`, by one method.

    Attributes:
        refused: true if the wall's equilibrium gave none.
    """

    method: str
    bits: int
    phase: str
    inner: NDArray[np.bool_]
    error: Array
    sigma: Array
    refused: bool = False


def table() -> str:
    """Markdown of all tables."""
    found = [one for design in DESIGNS for teat in TEATS for one in case(f"{design}-{teat}")]
    return "\n".join([_introduction(found), "", *_rows(found)])


def case(name: str, phases: dict[str, tuple[float, ...]] = PHASES) -> list[Compared]:
    """All states of one wall, told its values with one draw of their errors."""
    liner = SolvedLiner(name, COLUMNS)
    random = np.random.default_rng([COLUMNS, *name.encode()])
    given = Given.drawn(random)
    zones, reference = liner.zones(**given.material(liner)), reference_points(liner, random)
    model = PressureModel(liner.grid, zones, reference, SOUGHT_KPA)
    found = []
    for bits, sigma_mm in NOISE_MM.items():
        states = {kpa: _points(liner, kpa, sigma_mm, random) for some in phases.values() for kpa in some}
        smoothings = Smoothings.of(liner.grid, [reference, *states.values()])
        before = fit_surface(liner.grid, reference, smoothings.for_points(reference))
        places = outer_places(liner.grid, reference)
        question = Question(liner.grid, reference=before, reference_places=places, zones=tuple(zones))
        for phase, some in phases.items():
            for kpa in some:
                surface = fit_surface(liner.grid, states[kpa], smoothings.for_points(states[kpa]))
                try:
                    seen = np.ones(len(liner.grid), bool)
                    pressure = pressure_map(model, states[kpa], seen, given.vacuum(kpa))
                except AnalysisError:
                    pressure = None
                both = wall_states([states[kpa]] * 2, [surface] * 2, question, [pressure, None])
                for wanted, state in zip((EQUILIBRIUM, SMOOTH), both, strict=True):
                    found.append(_compared(liner, kpa, state, wanted, bits, phase))
    return found


def _points(liner: SolvedLiner, outer_kpa: float, sigma_mm: Array, random: np.random.Generator) -> Points:
    noise = random.normal(size=(len(liner.grid), 3)) * sigma_mm
    return as_points(liner.places_mm(outer_kpa) + noise, sigma_mm)


def _compared(
    liner: SolvedLiner, kpa: float, state: WallState, method: str, bits: int, phase: str
) -> Compared:
    true = solved_middle(liner, kpa)
    assert state.strain is not None
    pairs = (state.curvature_per_m, true.curvature_per_m, 1.0), (state.strain, true.strain, _PER_CENT)
    error, sigma = (np.hstack(parts) for parts in zip(*(_scaled(*pair) for pair in pairs), strict=True))
    return Compared(method, bits, phase, liner.inner, error, sigma, state.method != method)


def _scaled(estimate: Estimate, true: Array, scale: float) -> tuple[Array, Array]:
    return scale * (estimate.value - true), scale * estimate.sigma


def _introduction(found: Sequence[Compared]) -> str:
    refused = np.mean([one.refused for one in found if one.method == EQUILIBRIUM])
    states = "; ".join(f"{phase}: {', '.join(f'{k:g}' for k in some)} kPa" for phase, some in PHASES.items())
    return paragraph(
        f"Liners solved as solids ({', '.join(DESIGNS)}; teats {', '.join(TEATS)}), four columns of targets,",
        "single fields, with the same inputs as in the tables of the contact",
        "pressure. The truth is the layer",
        "with half of the rubber on either side, from splines through the",
        "solid's outer face, whose nodes are",
        "3.25 mm apart along the tube and 1.1 mm around it, so κ2 itself is accurate to a few per m where it",
        f"changes fast. {states}. RMS error / RMS stated σ (χ²), for the wall in",
        "equilibrium that explains the",
        "targets, and for the smooth surface through them, which is used",
        "without material, reference, ends or",
        "vacuum.",
        f"States without an equilibrium: {100 * refused:.0f} %, left out.",
    )


def _rows(found: Sequence[Compared]) -> Iterator[str]:
    yield f"| bits | phase | columns | from | {' | '.join(QUANTITIES)} |"
    yield "|" + "---|" * (4 + len(QUANTITIES))
    for bits in NOISE_MM:
        for phase in PHASES:
            for columns in ("inner", "outermost"):
                for method in (EQUILIBRIUM, SMOOTH):
                    labels = f"| {bits} | {phase} | {columns} | {method}"
                    some = [
                        one
                        for one in found
                        if (one.bits, one.phase, one.method, one.refused) == (bits, phase, method, False)
                    ]
                    cells = [_figures(some, columns == "inner", k).text() for k in range(len(QUANTITIES))]
                    yield f"{labels} | {' | '.join(cells)} |"


def _figures(found: Sequence[Compared], inner: bool, quantity: int) -> Figures:
    def joined(parts: list[Array]) -> Array:
        return np.concatenate(parts) if parts else np.empty(0)

    chosen = [(one, one.inner if inner else ~one.inner) for one in found]
    return Figures.of(
        joined([one.error[at, quantity] for one, at in chosen]),
        joined([one.sigma[at, quantity] for one, at in chosen]),
    )
