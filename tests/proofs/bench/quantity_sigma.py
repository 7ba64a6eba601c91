"""Whether quantities scatter by their own σ with noise, and by the common one with what is given."""

import multiprocessing
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from tests.liner.analysis.ramps import BROAD, empty, guessed, ramp
from tests.liner.analysis.walls import EIGHT_BITS_MM, SolvedLiner, with_noise
from tests.proofs.bench.pressure_case import LINER_VACUUM_KPA, Given, paragraph

from grabberd_fake.wall_states import buckling_kpa, touch_kpa
from grabberd_liner.analysis.estimate import Finding
from grabberd_liner.analysis.load.collapse import collapse
from grabberd_liner.analysis.load.empty_ramp import liner_values, ramp_quantities
from grabberd_liner.analysis.pulsation.movement import TimedPoints
from grabberd_liner.chain.analysis.analyse import FieldPoints, analyse
from grabberd_liner.chain.analysis.inputs import read_inputs
from grabberd_liner.chain.analysis.quantities import quantities

Array = NDArray[np.float64]

LINER, PROCESSES = "tapered-round", 4
FIELDS, FIELD_S, PERIOD_S, PHASES = 100, 0.02, 0.97, 12
MOST_KPA = 40.0
"""Pressure difference over the closed wall."""
CORNERS, AT_CORNERS_KPA = (0.0, 0.12, 0.5, 0.62, 1.0), (MOST_KPA, 0.0, 0.0, MOST_KPA, MOST_KPA)
"""Of the pulsation: in cycles, and the pressure difference there."""
CAPTURES, GIVEN, ANALYSED = 20, 10, 8
"""Captures with noise, draws of what is given, and fields of each capture before its burst."""
_FINE_S = 1e-4
_LOAD = ("liner_compression_mean_kpa", "liner_compression_greatest_kpa", "liner_compression_teat_end_kpa")
SHOWN = (
    *_LOAD,
    *("teat_load_peak_n_per_mm", "teat_load_n", "teat_end_beyond_flow_stop_kpa", "stroke_mm", "rate_per_min"),
    *("liner_opening_s", "liner_open_s", "liner_closing_s", "massage_time_s", "wall_ratio"),
)
FLOW_STOP = {"kpa": 9.0, "sigma_kpa": 1.0}
EMPTY, RAMP_KPA = "thin", np.concatenate([np.linspace(0.0, 5.4, 6), np.linspace(5.6, 8.4, 18)])
"""Liner of the ramps, and their pressure differences."""
LEVEL_KPA, GAUGE_KPA = 0.05, 0.1
"""σ of a level's pressure difference, and of the gauge's zero."""
_GUESSES = {"young": "E_mpa", "thickness": "wall_mm", "pretension": "F0_n"}


class Drawn(NamedTuple):
    """A quantity in many captures: its value, σ and common part (N,)."""

    value: Array
    sigma: Array
    common: Array

    @classmethod
    def of(cls, captures: Sequence[Mapping[str, Finding]], name: str) -> "Drawn":
        """A quantity by its name."""
        each = [capture[name] for capture in captures]
        return cls(*(np.array([getattr(one, part) for one in each]) for part in ("value", "sigma", "common")))

    @property
    def own2(self) -> float:
        """Mean square of the part of σ that is each capture's alone."""
        return float(np.mean(self.sigma**2 - self.common**2))

    @property
    def variance(self) -> float:
        """How far the values scatter."""
        return float(self.value.var(ddof=1))


def table() -> str:
    """Markdown of all quantities, of captures on a teat and of ramps."""
    with multiprocessing.get_context("spawn").Pool(PROCESSES) as pool:
        milked, ramps = (
            [
                pool.map(partial(of, drawn=drawn), range(count), 1)
                for drawn, count in ((False, CAPTURES), (True, GIVEN))
            ]
            for of in (found, ramp_found)
        )
    lines = [*_rows(LINER, SHOWN, *milked, truth(SolvedLiner(LINER)))]
    return "\n".join(
        [_introduction(), "", *lines, *_rows(f"{EMPTY}-empty", tuple(ramps[0][0]), *ramps, _own())]
    )


def _introduction() -> str:
    return paragraph(
        f"A solved wall that pulsates: {FIELDS} fields of 8 bit, two cycles of {PERIOD_S:g} s; all but the",
        f"first {ANALYSED} are a burst that is merged by phase. First,",
        f"{CAPTURES} captures with different noise,",
        "each starting elsewhere in the cycle, with true inputs: they scatter by the own part of σ (χ²",
        f"is scatter² / own², .47 to 1.73 in 95 of 100 tries of {CAPTURES}). Then {GIVEN} analyses of one",
        "capture with modulus, thickness, pretension and pressure difference drawn from their σ (3.5 %, 2 %,",
        "10 %, .5 kPa): they scatter by no more than the common part, which",
        "also includes the estimator's own",
        "error. The truth is that of the wall's first principal movement; loads",
        "are judged in other sections.",
        "The same for ramps with an empty liner: with different noise, and with the gauge's zero",
        f"({GAUGE_KPA:g} kPa) and the prior knowledge (20 %, 5 %, 30 %) drawn.",
    )


def _own() -> dict[str, float]:
    """True values of the empty liner."""
    design, states = empty(EMPTY).design, empty(EMPTY).states
    young, wall_mm = design["young_mpa"], design["wall_mm"]
    return {
        "E_mpa": young,
        "wall_mm": wall_mm,
        "F0_n": design["pretension_n"],
        "stiffness_n_mm": young * wall_mm**3 / 9,
        "touch_kpa": touch_kpa(states),
        "buckling_kpa": buckling_kpa(states),
    }


def _rows(
    name: str,
    shown: Sequence[str],
    captures: Sequence[Mapping[str, Finding]],
    given: Sequence[Mapping[str, Finding]],
    true: Mapping[str, float],
) -> Iterator[str]:
    yield from (f"{name}:", "")
    yield "| quantity | mean | true | σ | own | scatter | χ² | common | scatter with what is given |"
    yield "|" + "---|" * 9
    for quantity in shown:
        own, shared = Drawn.of(captures, quantity), Drawn.of(given, quantity)
        chi2 = own.variance / own.own2 if own.own2 > 0 else np.nan
        cells = [
            f"{own.value.mean():.5g}",
            f"{true[quantity]:.5g}" if quantity in true else "",
            f"{own.sigma.mean():.2g}",
            f"{np.sqrt(own.own2):.2g}",
            f"{np.sqrt(own.variance):.2g}",
            f"{chi2:.2f}",
            f"{np.sqrt(np.mean(shared.common**2)):.2g}",
            f"{np.sqrt(shared.variance):.2g}",
        ]
        yield f"| {quantity} | {' | '.join(cells)} |"
    yield ""


def ramp_found(seed: int, *, drawn: bool) -> dict[str, Finding]:
    """Quantities of one ramp, by name: with noise, or with what is given drawn from its σ."""
    liner, random = empty(EMPTY), np.random.default_rng([13, seed])
    factors = {name: 1 + drawn * BROAD[key] * random.normal() for name, key in _GUESSES.items()}
    material, noise = guessed(liner, **factors), 0 if drawn else seed
    reference = with_noise(liner, liner.places_mm(0.0), EIGHT_BITS_MM, np.random.default_rng([17, noise]))
    levels = ramp(liner, RAMP_KPA, noise, LEVEL_KPA)
    off_kpa = drawn * GAUGE_KPA * random.normal()
    levels = [
        one._replace(difference=one.difference._replace(kpa=one.difference.kpa + off_kpa)) for one in levels
    ]
    values = liner_values(liner.grid, material, reference, levels, GAUGE_KPA)
    ends = collapse(liner.grid, values.material(material), reference, levels, GAUGE_KPA)
    return {one.quantity.name: one for one in ramp_quantities(values, ends, ("", ""))}


def difference_kpa(time_s: Array) -> Array:
    """Pressure difference over the wall; the cycle begins with time 0."""
    kpa: Array = np.interp(np.mod(time_s, PERIOD_S) / PERIOD_S, CORNERS, AT_CORNERS_KPA)
    return kpa


def found(seed: int, *, drawn: bool) -> dict[str, Finding]:
    """Quantities of one capture, by name: with noise, or with what is given drawn from its σ."""
    liner, random = SolvedLiner(LINER), np.random.default_rng([11, 0 if drawn else seed])
    given = Given.drawn(np.random.default_rng([7, seed])) if drawn else Given()
    # The first field is the reference state, so that it has to show an open wall; the wall has to close
    # before the burst begins, or nobody would know when in the burst's cycle the capture was.
    start_s = CORNERS[2] * PERIOD_S - random.uniform(0.3, 0.7) * ANALYSED * FIELD_S
    times_s = start_s + np.arange(FIELDS) * FIELD_S
    places = (liner.places_mm(float(kpa)) for kpa in difference_kpa(times_s))
    points = [with_noise(liner, place, EIGHT_BITS_MM, random) for place in places]
    fields = [FieldPoints(n, TimedPoints(n * FIELD_S, one)) for n, one in enumerate(points)]
    inputs = read_inputs(_inputs(liner, given, start_s), liner.grid)
    # Quantities are those of the mean cycle: no field of a burst that is merged with it is analysed itself.
    made = analyse([fields[:ANALYSED], fields[ANALYSED:]], liner.grid, inputs)
    return {one.quantity.name: one for one in quantities(made)}


def _inputs(liner: SolvedLiner, given: Given, start_s: float) -> dict[str, object]:
    log_s = np.arange(-0.1, FIELDS * FIELD_S + 0.1, 0.004)
    chamber_kpa = LINER_VACUUM_KPA - difference_kpa(start_s + log_s) - given.kpa
    rows = (f"{time_s:.4f},{kpa:.4f}" for time_s, kpa in zip(log_s, chamber_kpa, strict=True))
    ends = {"first_end_mm": -65.0, "last_end_mm": 65.0}
    rubber = {"law": "neo_hookean", "poisson": 0.5, "target_mm": 0.0, "radius_mm": liner.design["radius_mm"]}
    return {
        "reference": {"field": 0},
        "material": given.material(liner) | ends | rubber,
        "vacuum": {
            "pulsation": "log",
            "liner": {"kpa": LINER_VACUUM_KPA, "sigma_kpa": given.kpa_sigma},
            "log": "\n".join(["time_s,pulsation_vacuum_kpa", *rows]),
            "offset": {"s": 0.0, "sigma_s": 0.0005},
        },
        "sought_kpa": 1.0,
        "phases": PHASES,
        "flow_stop": FLOW_STOP,
    }


def truth(liner: SolvedLiner) -> dict[str, float]:
    """What the wall does: its first principal movement, at steps of a tenth of a millisecond."""
    time_s = np.arange(0.0, PERIOD_S, _FINE_S)
    kpa = np.linspace(0.0, MOST_KPA, 801)
    places = np.array([liner.places_mm(float(one)).ravel() for one in kpa])
    at = np.searchsorted(kpa, difference_kpa(time_s)).clip(0, len(kpa) - 1)
    weight = np.bincount(at, minlength=len(kpa))[:, np.newaxis] / len(at)
    moved = places - (weight * places).sum(axis=0)
    direction = np.linalg.svd(np.sqrt(weight) * moved, full_matrices=False)[2][0]
    amount = moved @ direction
    stroke_mm = abs(amount[0] - amount[-1]) * np.linalg.norm(direction.reshape(-1, 3), axis=1).max()
    share = (amount[at] - amount[-1]) / (amount[0] - amount[-1])
    low, high = share < 0.1, share > 0.9
    middle, opening = ~low & ~high, time_s < CORNERS[2] * PERIOD_S
    a, b, c, d = (float(one.sum() * _FINE_S) for one in (middle & opening, high, middle & ~opening, low))
    return {
        "stroke_mm": float(stroke_mm),
        "rate_per_min": 60.0 / PERIOD_S,
        "liner_opening_s": a,
        "liner_open_s": b,
        "liner_closing_s": c,
        "massage_time_s": d,
        "wall_ratio": (a + b) / PERIOD_S,
    }
