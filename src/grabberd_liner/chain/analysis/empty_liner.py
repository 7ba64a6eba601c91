"""A ramp with the empty liner: its own values, its collapse, and the material for the other captures."""

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from typing import Any, NamedTuple, TypeVar

import numpy as np

from grabberd.core.geometry import Rig
from grabberd.core.reconstruction import Points
from grabberd.errors import AnalysisError
from grabberd_liner.analysis.estimate import Estimate, Finding
from grabberd_liner.analysis.grid import Grid
from grabberd_liner.analysis.load.collapse import Collapse, RampLevel, collapse
from grabberd_liner.analysis.load.empty_ramp import COLLAPSE, VALUES, LinerValues, liner_values
from grabberd_liner.analysis.load.load_prior import Difference
from grabberd_liner.analysis.load.pressure import ChamberVacuum
from grabberd_liner.analysis.wall.material import Material
from grabberd_liner.chain.analysis.inputs import CHAMBERS, CHANNEL, AnalysisInputs, missing
from grabberd_liner.chain.analysis.vacuum_inputs import channel_sigma_kpa, recorded_channel

T = TypeVar("T")

_MOST_LEVELS = 400
"""Fields of a ramp that are looked at: every few, if it has more."""
_DIGITS = 5


class EmptyLiner(NamedTuple):
    """Result of a ramp; None for what it does not determine.

    Attributes:
        values: the liner's own values, with `material`: the given one with these values.
        collapse: pressure differences at which it buckles and at which its walls touch.
        reasons: why there are no values, and why there is no collapse; empty where there are.
    """

    values: LinerValues | None
    material: Material | None
    collapse: Collapse | None
    reasons: tuple[str, str] = ("", "")


def empty_liner(
    grid: Grid,
    inputs: AnalysisInputs,
    reference: Points | None,
    points: Sequence[Points],
    vacuum: Sequence[ChamberVacuum],
    rig: Rig | None,
    note: Callable[[str], None],
) -> EmptyLiner:
    """Evaluates a ramp.

    Args:
        grid: targets of the object model.
        inputs: of the analysis; with material and both vacuums.
        reference: targets of the open liner; None for the object model's.
        points: of the fields.
        vacuum: at each of the fields.
        rig: whose views saw the points; None if targets that one view alone sees are of no use.
        note: takes note of a problem: why the data do not determine a result.

    Raises:
        InputError: the σ of a logger's zero is missing.
    """
    material, common_kpa = _material(inputs), _common_sigma_kpa(inputs)
    every = -(-len(points) // _MOST_LEVELS)
    levels = [
        RampLevel(one, _difference(at, common_kpa))
        for one, at in zip(points[::every], vacuum[::every], strict=True)
        if len(one)
    ]
    values, no_values = _tried(lambda: liner_values(grid, material, reference, levels, common_kpa, rig))
    found = values.material(material) if values else None
    ends, no_ends = _tried(lambda: collapse(grid, found or material, reference, levels, common_kpa))
    for reason in filter(None, (no_values, no_ends)):
        note(reason)
    return EmptyLiner(values, found, ends, (no_values, no_ends))


def _tried(function: Callable[[], T]) -> tuple[T | None, str]:
    """Result of a function, or the reason why the data do not determine it."""
    try:
        return function(), ""
    except AnalysisError as error:
        return None, error.message


def ramp_values(empty: EmptyLiner | None, found: Mapping[str, Finding]) -> dict[str, Any]:
    """Values of the table `ramp` by column name; the quantities among them are given by name."""
    values, material, *_ = empty or EmptyLiner(None, None, None)
    rows = 0 if empty is None else 1
    quantities = {name: found[name].estimate for name in (*VALUES, *COLLAPSE)}
    return {
        **{name: Estimate(*(np.full(rows, part) for part in one)) for name, one in quantities.items()},
        "load_misfit": np.full(rows, values.misfit if values else np.nan),
        "levels": np.full(rows, len(values.used) if values else 0),
        "material": np.full(rows, json.dumps(material_document(material)) if material else "", object).astype(
            str
        ),
    }


def material_document(material: Material) -> dict[str, object]:
    """The material as it is given to an analysis."""
    return {
        name: float(f"{value:.{_DIGITS}g}") if isinstance(value, float) else value
        for name, value in asdict(material).items()
        if value is not None
    }


def _material(inputs: AnalysisInputs) -> Material:
    if len(inputs.zones) != 1:
        raise AnalysisError(
            f"a ramp needs one material for the whole liner, not {len(inputs.zones)} zones",
            "give one material",
        )
    return inputs.zones[0].material


def _common_sigma_kpa(inputs: AnalysisInputs) -> float:
    """σ that the pressure differences of all fields share: of constants, and of a logger's zero."""
    given = {name: inputs.vacuum[name] for name in CHAMBERS}
    constant = [one["sigma_kpa"] for one in given.values() if one not in ("log", CHANNEL)]
    recorded = [recorded_channel(name, inputs.channels) for name in given if given[name] == CHANNEL]
    constant += [channel_sigma_kpa(inputs.vacuum, one) for one in recorded]
    if len(constant) < len(given):
        if "gauge_sigma_kpa" not in inputs.vacuum:
            raise missing(
                "vacuum.gauge_sigma_kpa", "the logger's zero sets the scale of the liner's stiffness"
            )
        constant.append(inputs.vacuum["gauge_sigma_kpa"])
    return float(np.linalg.norm(constant))


def _difference(vacuum: ChamberVacuum, common_kpa: float) -> Difference:
    # The σ of constants is in that of every field as well, and is taken out of it.
    own = max(vacuum.difference_sigma_kpa**2 - common_kpa**2, 0.0)
    return Difference(vacuum.difference_kpa, float(np.sqrt(own)))
