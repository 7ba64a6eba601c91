"""What a ramp with the empty liner gives, and what it is worth to the pressure on a teat."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from tests.liner.analysis.ramps import BROAD, empty, guessed, open_liner, ramp, solved_kpa
from tests.liner.analysis.walls import SolvedLiner, pressure_map, solved
from tests.proofs.bench.pressure_case import SOUGHT_KPA, Given, paragraph

from grabberd_fake.wall_states import buckling_kpa, touch_kpa
from grabberd_liner.analysis.load.collapse import Collapse, collapse
from grabberd_liner.analysis.load.empty_ramp import LinerValues, liner_values
from grabberd_liner.analysis.load.pressure import PressureModel
from grabberd_liner.analysis.wall.material import Material, Zone

Array = NDArray[np.float64]

DESIGNS = ("reference", "thin", "stiffening", "wide", "rubbing", "tapered")
STATES_KPA = (15.0, 28.0)
"""Pressure differences at which the map of a liner on a round teat is judged."""
OWN_KPA, COMMON_KPA = 0.3, 0.1
"""σ of the vacuum that is read in each level, and of the gauge's zero."""
TOUCH_LEVELS, TOUCH_OWN_KPA = 120, 0.1
DRAWS = 2
"""Of the noise of a field, for every state."""
_E_T3 = np.array([1.0, 3.0, 0.0])


class Ramped(NamedTuple):
    """The ramp of one liner, and what comes of it on a teat.

    Attributes:
        off: errors of ln E, ln t, ln F0, with `values`' covariance.
        touch: touch and buckling, by another ramp with many levels.
        mean_error_kpa: of the mean over the targets at each of `STATES_KPA`, by the material that is used.
    """

    design: str
    off: Array
    values: LinerValues
    touch: Collapse
    mean_error_kpa: dict[str, list[float]]


def table(designs: Sequence[str] = DESIGNS) -> str:
    """Markdown of both tables."""
    found = [ramped(design) for design in designs]
    return "\n".join([_introduction(), "", *value_rows(found), "", *worth_rows(found)])


def ramped(design: str) -> Ramped:
    """One liner, told with one draw of what is known before the ramp."""
    random = np.random.default_rng(list(design.encode()))
    liner, true = empty(design), (zone.material for zone in empty(design).zones())
    factors = 1 + random.normal(size=3) * list(BROAD.values())
    material = guessed(liner, *(float(factor) for factor in factors))
    kpa = solved_kpa(liner, last=1.02 * touch_kpa(liner.states))
    levels = ramp(liner, kpa, own_kpa=OWN_KPA, common_kpa=COMMON_KPA)
    values = liner_values(liner.grid, material, open_liner(liner), levels, COMMON_KPA)
    used = {"without": material, "ramp": values.material(material), "true": next(true)}
    errors = {name: _mean_errors_kpa(solved(f"{design}-round"), one) for name, one in used.items()}
    return Ramped(design, _off(liner, values), values, _touch(liner, used["ramp"]), errors)


def _touch(liner: SolvedLiner, material: Material) -> Collapse:
    kpa = np.linspace(0.0, 1.02 * touch_kpa(liner.states), TOUCH_LEVELS)
    levels = ramp(liner, kpa, own_kpa=TOUCH_OWN_KPA)
    return collapse(liner.grid, material, open_liner(liner), levels, 0.0)


def _off(liner: SolvedLiner, values: LinerValues) -> Array:
    true = [liner.design[name] for name in ("young_mpa", "wall_mm", "pretension_n")]
    off: Array = np.log(np.array([values.E_mpa, values.wall_mm, values.F0_n]) / true)
    return off


def _mean_errors_kpa(liner: SolvedLiner, material: Material) -> list[float]:
    model = PressureModel(liner.grid, [Zone(-np.inf, np.inf, material)], open_liner(liner), SOUGHT_KPA)
    seen, given = np.ones(len(liner.grid), bool), Given()
    errors = []
    for kpa in STATES_KPA:
        vacuum = given.vacuum(kpa)
        maps = [pressure_map(model, liner.points(kpa, seed), seen, vacuum) for seed in range(DRAWS)]
        true_kpa = float(liner.contact_kpa(kpa).mean())
        errors.append(float(np.mean([one.mean_kpa.value for one in maps])) - true_kpa)
    return errors


def _introduction() -> str:
    young, wall, pretension = (f"{100 * sigma:g} %" for sigma in BROAD.values())
    return paragraph(
        f"Solved liners whose modulus was known to {young}, thickness to {wall} and pretension to",
        f"{pretension}, each with one draw of these errors; a ramp without a teat, its vacuum read to",
        f"{OWN_KPA:g} kPa at each level, plus a common {COMMON_KPA:g} kPa; four columns, 8 bits. Errors of",
        "the liner's values are in % (error / stated σ); those of touch (TPPD) and buckling (CCPD) in kPa,",
        f"from {TOUCH_LEVELS} levels of {TOUCH_OWN_KPA:g} kPa. Then the errors",
        "of the mean pressure over the visible targets",
        f"on a round teat, at {' and '.join(f'{kpa:g}' for kpa in STATES_KPA)} kPa over the wall, kPa,",
        f"estimate minus truth, mean of {DRAWS} fields: with what was known before the ramp, with its",
        "`material`, and with the true values.",
    )


def value_rows(found: Sequence[Ramped]) -> Iterator[str]:
    """Rows of the liner's values, touch and buckling."""
    yield "| liner | E t³ | E | thickness | pretension | TPPD | CCPD |"
    yield "|---|---|---|---|---|---|---|"
    for one in found:
        covariance, states = one.values.covariance, empty(one.design).states
        sums = [_E_T3, *np.eye(3)]
        cells = [_percent(part @ one.off, np.sqrt(part @ covariance @ part)) for part in sums]
        touch, buckling = one.touch.touch_kpa, one.touch.buckling_kpa
        cells += [_kpa(touch.value - touch_kpa(states), touch.sigma)]
        cells += [_kpa(buckling.value - buckling_kpa(states), buckling.sigma)]
        yield f"| {one.design} | {' | '.join(cells)} |"


def worth_rows(found: Sequence[Ramped]) -> Iterator[str]:
    """Rows of what the ramp is worth on a teat."""
    yield "| liner on a round teat | without a ramp | with the ramp's material | with the true one |"
    yield "|---|---|---|---|"
    for one in found:
        cells = [", ".join(f"{error:+.1f}" for error in errors) for errors in one.mean_error_kpa.values()]
        yield f"| {one.design} | {' | '.join(cells)} |"


def _percent(error: float, sigma: float) -> str:
    return f"{100 * error:+.1f} / {100 * sigma:.1f}"


def _kpa(error: Array, sigma: Array) -> str:
    return f"{float(error):+.2f} / {float(sigma):.2f}"
