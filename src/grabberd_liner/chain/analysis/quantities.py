"""The field's own quantities in an analysis: each with σ, or with the reason why it is missing."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

from grabberd.core.arrays import Array
from grabberd.errors import AnalysisError, InputError
from grabberd_liner.analysis.estimate import Estimate, Finding
from grabberd_liner.analysis.load.empty_ramp import ramp_quantities
from grabberd_liner.analysis.load.liner_compression import QUANTITIES, liner_compression
from grabberd_liner.analysis.load.overpressure import (
    Found,
    LoadedState,
    map_flow_stop,
    overpressure_quantities,
)
from grabberd_liner.analysis.load.pressure import ChamberVacuum
from grabberd_liner.analysis.pulsation.phase_average import PhaseAverage
from grabberd_liner.analysis.pulsation.phases import (
    NO_CURVE,
    lag_quantities,
    laser_quantities,
    movement_quantities,
    pulsator_limits,
    vacuum_quantities,
    wall_quantities,
)
from grabberd_liner.analysis.vacuum.milk_flow import (
    DifferenceCurve,
    FlowCurve,
    FlowStop,
    derived_flow_stop,
    raised_flow_stop,
)
from grabberd_liner.chain.analysis.analyse import Analysis
from grabberd_liner.chain.analysis.wall_state import WallState

_NO_CYCLE = "there is no mean cycle"
_NO_WALL_PHASES = "the wall's movement has no four phases"
_NO_TEAT = "there is no teat: the capture is a ramp with the empty liner"
_NO_RAMP = "the capture is no ramp with the empty liner"
_NO_VALUES = "a ramp needs a reference, one material and both vacuums"
_NO_VACUUM = "the vacuum on both sides of the wall is not known"
_NO_FLOW = (
    "milk_flow was not given: whether the capture's channel flow, of a sensor of flow, light or conductivity "
    "in the short milk tube, reads high or low while milk flows"
)
_NO_OCCLUSION = (
    "flow_stop was not given: the contact pressure at the teat's end at which milk just stops flowing"
)
_NO_LAG = "the vacuum has no clock that a light, or the capture itself, relates to the camera's"


def quantities(analysis: Analysis) -> tuple[Finding, ...]:
    """All of them, in the order in which they are shown.

    Whatever shows or exports one of them takes it from here, so that it is the same number everywhere.
    """
    cycle, vacuum = analysis.cycle, analysis.source.phases if analysis.source else None
    wall, reason = cycle.wall if cycle else None, _without_phases(analysis)
    no_curve = _NO_TEAT if analysis.inputs.empty else NO_CURVE
    return (
        *_of_the_load(analysis),
        *movement_quantities(cycle.pulsation if cycle else None, reason),
        *wall_quantities(wall, reason),
        *laser_quantities(cycle.pulsation if cycle else None, reason),
        *vacuum_quantities(vacuum, no_curve),
        *pulsator_limits(vacuum, no_curve),
        *_lags(analysis),
        *_of_the_ramp(analysis),
        *_overpressure(analysis),
    )


def left_out(reasons: Iterable[tuple[str, str]]) -> list[str]:
    """Quantities without a value, those that lack the same together, in sentences.

    Args:
        reasons: title of each quantity, and why it has no value; empty if it has one. What only captures of
            another kind have is not left out of this one.
    """
    lacking: dict[str, list[str]] = {}
    for title, reason in reasons:
        if reason and reason not in (_NO_RAMP, _NO_TEAT):
            lacking.setdefault(reason, []).append(title)
    return [f"{'; '.join(titles)}: {reason}" for reason, titles in lacking.items()]


def _without_phases(analysis: Analysis) -> str:
    """The reason why there are no wall phases, where there are none."""
    if analysis.inputs.empty:
        return _NO_TEAT
    return _NO_WALL_PHASES if analysis.cycle else _NO_CYCLE


def _lags(analysis: Analysis) -> tuple[Finding, ...]:
    source, lag = analysis.source, analysis.source.lag if analysis.source else None
    if source is None or lag is None:
        return lag_quantities((), np.nan, _NO_TEAT if analysis.inputs.empty else _NO_LAG)
    shifts = ((lag.opening_shift_s, lag.opening_sigma_s), (lag.closing_shift_s, lag.closing_sigma_s))
    each = [Estimate.of(value, sigma) for value, sigma in shifts]
    return lag_quantities(each, source.time_sigma_s, "")


def _of_the_ramp(analysis: Analysis) -> tuple[Finding, ...]:
    empty = analysis.empty
    if empty is None:
        return ramp_quantities(None, None, (_NO_VALUES if analysis.inputs.empty else _NO_RAMP,) * 2)
    return ramp_quantities(empty.values, empty.collapse, empty.reasons)


def _of_the_load(analysis: Analysis) -> tuple[Finding, ...]:
    cycle = analysis.cycle
    if cycle is None or cycle.wall is None:
        reason = _without_phases(analysis)
        return tuple(Finding.missing(quantity, reason) for quantity in QUANTITIES.values())
    profiles = [state.pressure.profile if state.pressure else None for state in analysis.phases]
    flow_stop_kpa, alike = analysis.inputs.flow_stop_kpa, _correlation(cycle.average, analysis.phase)
    liner_kpa = _liner_kpa(analysis.phase_vacuum)
    found = liner_compression(analysis.phase, profiles, cycle.wall, flow_stop_kpa, alike, liner_kpa)
    if any(profiles):
        return found.findings
    # That no load is known has a cause, which the inputs may tell.
    lacks = [text.partition(":")[0] for text in analysis.inputs.lacks if " pressure" in text]
    if not lacks:
        return found.findings
    said = f"there is no pressure without {', '.join(dict.fromkeys(lacks))}"
    return tuple(one._replace(reason=said) if one.reason else one for one in found.findings)


def _liner_kpa(vacuum: Sequence[ChamberVacuum]) -> Estimate | None:
    """(P,) vacuum in the liner at the phases; None where it is not known."""
    if not vacuum:
        return None
    return Estimate(
        *(np.array(part) for part in zip(*((v.liner_kpa, v.liner_sigma_kpa) for v in vacuum), strict=True))
    )


def _overpressure(analysis: Analysis) -> tuple[Finding, ...]:
    """Overpressure in every way that the capture allows."""
    if analysis.inputs.empty:
        return overpressure_quantities(_NO_TEAT, _NO_TEAT, _NO_TEAT, 0.0)
    by_map = _by_map(analysis)
    if analysis.source is None:
        return overpressure_quantities(_NO_VACUUM, _NO_VACUUM, by_map, 0.0)
    flow, gauge_sigma_kpa = analysis.inputs.milk_flow, analysis.source.gauge_sigma_kpa
    if flow is None:
        return overpressure_quantities(_NO_FLOW, _NO_FLOW, by_map, gauge_sigma_kpa)
    try:
        curve = analysis.source.difference(float(flow.time_s[0]), float(flow.time_s[-1]))
    except InputError as error:
        return overpressure_quantities(error.message, error.message, by_map, gauge_sigma_kpa)
    derived, raised = (_by_flow(way, curve, flow) for way in (derived_flow_stop, raised_flow_stop))
    return overpressure_quantities(derived, raised, by_map, gauge_sigma_kpa)


def _by_flow(
    way: Callable[[DifferenceCurve, FlowCurve], FlowStop], curve: DifferenceCurve, flow: FlowCurve
) -> Found:
    try:
        return way(curve, flow)
    except AnalysisError as error:
        return error.message


def _by_map(analysis: Analysis) -> Found:
    """Result by the mean cycle, or by the fields if its phases are too few."""
    occlusion_kpa = analysis.inputs.flow_stop_kpa
    if occlusion_kpa is None:
        return _NO_OCCLUSION
    reason = ""
    for states, vacuum in (
        (analysis.phases, analysis.phase_vacuum),
        (analysis.states, analysis.vacuum),
    ):
        try:
            return map_flow_stop(_loaded(states, vacuum), occlusion_kpa)
        except AnalysisError as error:
            reason = reason or error.message
    return reason


def _loaded(states: Sequence[WallState], vacuum: Sequence[ChamberVacuum]) -> list[LoadedState]:
    """The states with a load over height."""
    both = zip(states, vacuum, strict=True) if vacuum else ()
    return [
        LoadedState(state.pressure.profile, at)
        for state, at in both
        if state.pressure and state.pressure.profile
    ]


def _correlation(average: PhaseAverage | None, phase: Array) -> Array | None:
    """(P, P) of the noise at those phases of a mean cycle that could be analysed."""
    if average is None:
        return None
    among = np.isin(average.phase, phase)
    return average.correlation[np.ix_(among, among)]


def quantity_values(found: Sequence[Finding]) -> dict[str, Any]:
    """Values of the table `quantities` by column name."""
    quantity = [one.quantity for one in found]
    return {
        **{name: np.array([getattr(one, name) for one in quantity]) for name in quantity[0]._fields},
        "value": Estimate(np.array([one.value for one in found]), np.array([one.sigma for one in found])),
        "sigma_common": np.array([one.common for one in found]),
        **{name: np.array([getattr(one, name) for one in found]) for name in ("verdict", "reason")},
    }
