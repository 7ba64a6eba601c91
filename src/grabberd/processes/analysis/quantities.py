"""The field's own quantities in an analysis: each with σ, or with the reason why it is missing."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from grabberd.analysis import Estimate
from grabberd.analysis.load.compression.liner_compression import QUANTITIES, liner_compression
from grabberd.analysis.pulsation.pulsator_limits import liner_times, pulsator_limits
from grabberd.analysis.quantity import Finding
from grabberd.processes.analysis.analyse import Analysis

_NO_CYCLE = "there is no mean cycle"
_NO_WALL_PHASES = "the wall's movement has no four phases"


def quantities(analysis: Analysis) -> tuple[Finding, ...]:
    """All of them, in the order in which they are shown."""
    cycle = analysis.cycle
    wall = cycle.wall if cycle else None
    times = liner_times(wall, _NO_WALL_PHASES if cycle else _NO_CYCLE)
    vacuum = analysis.source.phases if analysis.source else None
    return (*_of_the_load(analysis), *times, *pulsator_limits(vacuum))


def _of_the_load(analysis: Analysis) -> tuple[Finding, ...]:
    cycle = analysis.cycle
    if cycle is None or cycle.wall is None:
        reason = _NO_WALL_PHASES if cycle else _NO_CYCLE
        return tuple(Finding.missing(quantity, reason) for quantity in QUANTITIES.values())
    profiles = [state.pressure.profile if state.pressure else None for state in analysis.phases]
    found = liner_compression(analysis.phase, profiles, cycle.wall, analysis.inputs.flow_stop_kpa)
    if any(profiles):
        return found.findings
    # That no load is known has a cause, which the inputs may tell.
    lacks = [text.partition(":")[0] for text in analysis.inputs.lacks if "pressure" in text]
    if not lacks:
        return found.findings
    said = f"there is no pressure without {', '.join(dict.fromkeys(lacks))}"
    return tuple(one._replace(reason=said) if one.reason else one for one in found.findings)


def quantity_values(found: Sequence[Finding]) -> dict[str, Any]:
    """Values of the table `quantities` by column name."""
    quantity = [one.quantity for one in found]
    return {
        **{name: np.array([getattr(one, name) for one in quantity]) for name in quantity[0]._fields},
        "value": Estimate(np.array([one.value for one in found]), np.array([one.sigma for one in found])),
        **{name: np.array([getattr(one, name) for one in found]) for name in ("verdict", "reason")},
    }
