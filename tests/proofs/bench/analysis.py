"""From rendered captures of the flattening ellipse to strain and tension, against its truth."""

from collections.abc import Iterator
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from tests.proofs.bench.analysed import FIELDS, HEIGHTS_MM, PERIOD_S, PHASES, Analysed, Case
from tests.proofs.bench.analysis_cost import cost

from grabberd.core.reconstruction import Points
from grabberd_liner.analysis.estimate import Estimate
from grabberd_liner.analysis.surface.fitting import fit_surface
from grabberd_liner.analysis.surface.surface import Surface
from grabberd_liner.analysis.wall.material import wall_at
from grabberd_liner.analysis.wall.strain import (
    edge_strain,
    middle_forms,
    nominal_places,
    outer_places,
    strain,
)
from grabberd_liner.chain.analysis.wall_series import Smoothings
from grabberd_liner.chain.analysis.wall_state import WallState

Array = NDArray[np.float64]

CASES = (
    Case("8 bit, jitter .12 px"),
    Case("8 bit, no jitter", jitter_px=0.0),
    Case("8 bit, mirror error .06 px", mirror_error_px=0.06),
    Case("the same, strain from phase .35", mirror_error_px=0.06, reference_phase=0.35),
    Case("1 bit, doubled", bits=1, doubled=True),
    Case("8 bit, radius 14 mm", radius_mm=14.0),
)


class Compared(NamedTuple):
    """Errors and σ of one quantity, over states and places."""

    error: Array
    sigma: Array

    @property
    def rms(self) -> float:
        """Root mean square of the error."""
        return _rms(self.error)

    @property
    def chi2(self) -> float:
        """Mean of (error / σ)²: 1 where σ is honest."""
        good = np.isfinite(self.error) & (self.sigma > 0)
        return float(np.mean((self.error[good] / self.sigma[good]) ** 2))

    def text(self, digits: int, scale: float = 1.0) -> str:
        """Error / σ (χ² per degree); "none" where there is nothing to compare."""
        if not np.isfinite(self.error).any():
            return "none"
        numbers = (f"{scale * number:.{digits}f}" for number in (self.rms, _rms(self.sigma)))
        return f"{' / '.join(numbers)} ({self.chi2:.2f})"


def _rms(values: Array) -> float:
    return float(np.sqrt(np.nanmean(values**2)))


def states_of(made: Analysed, averaged: bool) -> Iterator[tuple[WallState, int]]:
    """The states of single fields or of the mean cycle, with their moments."""
    states = made.analysis.phases if averaged else made.analysis.states
    return zip(states, made.moments_ns(averaged), strict=True)


def _points(made: Analysed, averaged: bool) -> tuple[Points, ...]:
    """Points of the same states."""
    found = made.analysis
    if not averaged:
        return tuple(field.timed.points for field in found.fields)
    assert found.cycle is not None
    assert found.cycle.average is not None
    average = found.cycle.average
    return tuple(average.points[int(np.argmin(np.abs(average.phase - p)))] for p in found.phase)


@cache
def _surfaces(made: Analysed, averaged: bool) -> list[Surface]:
    """Surfaces of the same states, fitted as the analysis fits them."""
    smoothings = Smoothings.of(made.grid, [field.timed.points for field in made.fields])
    points = _points(made, averaged)
    return [fit_surface(made.grid, one, smoothings.for_points(one)) for one in points]


@cache
def edges(made: Analysed, averaged: bool) -> Compared:
    """Strain of the edges between targets, on the outer face."""
    grid, before = made.grid, nominal_places(made.grid)
    parts = []
    for (_, moment), points in zip(states_of(made, averaged), _points(made, averaged), strict=True):
        strain = edge_strain(grid, outer_places(grid, points), before)
        stretch = _lengths(made.targets_mm(moment), strain.edge) / _lengths(grid.nominal_mm, strain.edge)
        parts.append(Compared(strain.stretch.value - stretch, strain.stretch.sigma))
    return _joined(parts)


def _lengths(places: Array, edge: NDArray[np.intp]) -> Array:
    length: Array = np.linalg.norm(places[edge[:, 1]] - places[edge[:, 0]], axis=1)
    return length


def _joined(parts: list[Compared]) -> Compared:
    return Compared(*(np.concatenate([np.empty(0), *(part[k] for part in parts)]) for k in (0, 1)))


@cache
def places(made: Analysed, averaged: bool) -> dict[str, Compared]:
    """(states, targets) of strain, curvature and tension."""
    parts: dict[str, list[Compared]] = {}
    each = zip(states_of(made, averaged), _surfaces(made, averaged), strict=True)
    for (state, moment), surface in each:
        wall = made.wall(moment)
        assert state.tension_n_per_m is not None
        for name, estimate, true in (
            ("ε", _strain(made, state, surface), np.einsum("nii->ni", wall.strain)),
            ("κ", state.curvature_per_m, _principal(wall.curvature_per_m)),
            ("T", state.tension_n_per_m, _principal(wall.tension_n_per_m)),
        ):
            for k in (0, 1):
                compared = Compared(estimate.value[:, k] - true[:, k], estimate.sigma[:, k])
                parts.setdefault(f"{name}{k + 1}", []).append(compared)
    return {name: Compared(*(np.array([p[k] for p in some]) for k in (0, 1))) for name, some in parts.items()}


def _strain(made: Analysed, state: WallState, surface: Surface) -> Estimate:
    """(N, 2) Green-Lagrange along and round: of principal ones no σ holds where the wall is not strained."""
    grid, reference = made.grid, made.analysis.reference
    depth = wall_at(made.analysis.inputs.zones, grid.u_mm).depth_mm

    def values(now: Array, then: Array) -> Array:
        faces = (middle_forms(face, depth, grid.outward).tangents for face in (now, then))
        lagrange = strain(*faces).green_lagrange
        return np.stack([lagrange[..., 0, 0], lagrange[..., 1, 1]], axis=-1)

    at = grid.u_mm, grid.v_mm
    if isinstance(reference, Surface):
        found = surface.propagate(values, *at, reference, highest=2)
    else:
        found = surface.propagate(lambda now: values(now, reference), *at, highest=2)
    return Estimate(*(np.where(state.within[:, None], part, np.nan) for part in found))


def _principal(tensor: Array) -> Array:
    values: Array = np.linalg.eigvalsh(tensor)[:, ::-1]
    return values


def widths(made: Analysed, averaged: bool) -> Compared:
    """Distance between opposite walls: twice that from the plane of symmetry."""
    parts = []
    for state, moment in states_of(made, averaged):
        found = [section.distance_mm for section in state.sections]
        true = made.distance_mm(moment)
        assert len(found) == len(true)
        value, sigma = np.array([(one.value, one.sigma) for one in found if one]).T
        parts.append(Compared(2 * (value - true), 2 * sigma))
    return _joined(parts)


def table() -> str:
    """Errors with their σ, what they were to be, and what the analysis costs."""
    made = [(case.name, Analysed(case)) for case in CASES]
    parts = (_strains(made), _fields(made), _shapes(made), cost(made[0][1]))
    return "\n\n".join([_PREFACE, *parts, _REMARKS])


_PREFACE = f"""{FIELDS} fields at 50 Hz of a liner that pulsates every {PERIOD_S} s; 2 % noise, spread
.8 px, line jitter .12 px and ideal mirrors unless said; the exact calibration; strain
from the nominal shape. RMS error / RMS stated σ (χ² per degree). Single fields, and
{PHASES} phases of the mean cycle. Both views see four of the six columns of targets:
*inner* are the middle two, *outermost* the other two, at the fold of the closed wall."""
_REMARKS = """What misses its goal, and why:

- The middle surface's strain in the mean cycle, and κ1 and tension of the closed wall's
  outermost columns: the wall bends there within a pitch, beyond what is seen. It is so without
  any noise too (the mean cycle's points are good to .005 mm, χ² 1.0), so averaging does not help;
  more columns would. σ says it, but for κ2 there in the mean cycle, whose χ² is 3.
- χ² of κ1 and tension is .2 to .6 at the inner columns and up to 1.5 at the outermost:
  the prior is the same all round, and a closed wall is flat in its middle and folded at its
  sides. The map's σ of the middle is twice what it need be, that of the sides up to a fifth too
  small; over all targets, κ1 has about .8.
- Widths of the mean cycle: the crown lies halfway between two columns, where a closed wall's bend
  is the prior's guess; without line jitter it is no better.
- Uneven mirrors do the same to all fields. No σ from one field's points can contain that; σ of
  what counts from a measured phase (strain along, tension) is honest again, that of
  shapes (κ2, widths) is not."""

Made = list[tuple[str, Analysed]]


def _strains(made: Made) -> str:
    """Strain of edges and of the middle surface at the targets."""
    head = ["capture", "edges", "along, inner", "round, inner"]
    rows = [("to be, single fields", "jitter .35, none .15", "", "")]
    for name, one in made:
        for averaged in (False, True):
            edge, place = edges(one, averaged), _split(one, averaged)["inner"]
            values = (edge, place["ε1"], place["ε2"])
            rows.append((f"{name}{_of(averaged)}", *(value.text(2, 100) for value in values)))
    return _markdown("Strain in %.", head, rows)


def _fields(made: Made) -> str:
    """Curvature and tension at the targets."""
    head = ["capture", "columns", "κ1, 1/m", "κ2, 1/m", "T1, N/m", "T2, N/m"]
    rows = [("to be", "", *["χ² .8 to 1.2"] * 4)]
    for name, one in made:
        for averaged in (False, True):
            for columns, place in _split(one, averaged).items():
                values = [place["κ1"].text(1), place["κ2"].text(2), place["T1"].text(0), place["T2"].text(0)]
                rows.append((f"{name}{_of(averaged)}", columns, *values))
    return _markdown("Curvature and tension of the middle surface.", head, rows)


def _shapes(made: Made) -> str:
    """Section widths, cycle and wall phases."""
    head = [
        "capture",
        "width, mm",
        "width of phases, mm",
        "cycle, error / σ, ms",
        "wall phases a to d, error / σ, ms",
    ]
    rows = [("to be", ".05", "", "2", "")]
    for name, one in made:
        cycle = one.analysis.cycle
        assert cycle is not None
        pulsation = cycle.pulsation
        period = f"{1e3 * (pulsation.period_s - PERIOD_S):.3f} / {1e3 * pulsation.period_sigma_s:.3f}"
        rows.append((name, widths(one, False).text(3), widths(one, True).text(3), period, _wall_phases(one)))
    heights = ", ".join(f"{height:g}" for height in HEIGHTS_MM)
    return _markdown(f"Distance of opposite walls at x = {heights} mm, and the cycle.", head, rows)


def _wall_phases(made: Analysed) -> str:
    cycle = made.analysis.cycle
    if cycle is None or cycle.wall is None:
        return "none"
    error = 1e3 * (cycle.wall.durations_s.value - made.wall_phases_s)
    sigma = 1e3 * cycle.wall.durations_s.sigma
    return ", ".join(f"{one:+.1f} / {given:.1f}" for one, given in zip(error, sigma, strict=True))


def _split(made: Analysed, averaged: bool) -> dict[str, dict[str, Compared]]:
    """By columns: those seen in most fields, but the first and the last; and these two."""
    column = made.grid.column
    seen = np.mean([state.within for state in made.analysis.states], axis=0) > 0.5
    first, last = column[seen].min(), column[seen].max()
    chosen = {"inner": (column > first) & (column < last), "outermost": (column == first) | (column == last)}
    all_places = places(made, averaged)
    return {
        columns: {
            name: Compared(one.error[:, which], one.sigma[:, which]) for name, one in all_places.items()
        }
        for columns, which in chosen.items()
    }


def _of(averaged: bool) -> str:
    return ", phases" if averaged else ""


def _markdown(title: str, head: list[str], rows: list[tuple[str, ...]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join([title, "", *(f"| {' | '.join(line)} |" for line in lines)])
