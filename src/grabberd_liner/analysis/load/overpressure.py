"""Overpressure: the pressure difference across the wall in phase d beyond that at which milk just stops.

Found in up to three ways: by the duration of milk flow, by its start while the chamber's vacuum is raised
(both `analysis.vacuum.milk_flow`), and here by the map: the difference at which the contact pressure at the
teat's end reaches a stated occlusion pressure.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from grabberd.core.arrays import Array
from grabberd.errors import AnalysisError
from grabberd_liner.analysis.estimate import Estimate, Finding, Quantity
from grabberd_liner.analysis.load.liner_compression import COMPRESSION_SHARE
from grabberd_liner.analysis.load.load_profile import TEAT_END_MM, LoadProfile, mean_profile, teat_heights
from grabberd_liner.analysis.load.pressure import ChamberVacuum
from grabberd_liner.analysis.vacuum.milk_flow import AT_REST_KPA, FlowStop

AGREED_KPA = 2.0
"""By less than that, overpressure of two ways differed in the literature."""
_WIDEST_KPA = 6.0
"""Between two states: the contact pressure is no straight line over a wider range."""
_STRAIGHT = 0.2
"""Of the step between two states: how far a straight line between them misses, on walls solved as solids."""

_OP = "overpressure as in milking research (Thompson et al., doi 10.3168/jds.2020-18854)"
_DURATION = f"{_OP}, derived from the duration of milk flow"
_RAISED = f"{_OP}, by raising the chamber's vacuum until milk flows"
_BY_MAP = (
    "the canal is occluded from 80 to 90 % of the liner's vacuum on (Mein, Williams and Thiel 1987); here "
    "from where the map's contact pressure reaches the given one"
)

QUANTITIES: Mapping[str, Quantity] = {
    one.name: one
    for one in (
        Quantity(
            "flow_duration_s",
            "milk flow, duration",
            "s",
            "Duration of milk flow within a cycle, from half to half of its swing.",
            _DURATION,
        ),
        Quantity(
            "flow_stop_derived_kpa",
            "pressure difference at flow stop, derived",
            "kPa",
            "Pressure difference across the wall below which it is, in a cycle, for as long as milk flows.",
            _DURATION,
        ),
        Quantity(
            "overpressure_derived_kpa",
            "overpressure, derived",
            "kPa",
            "Pressure difference across the wall in phase d less that at flow stop, by the flow's duration.",
            _DURATION,
        ),
        Quantity(
            "flow_stop_raised_kpa",
            "pressure difference at flow start, raised",
            "kPa",
            "Pressure difference across the wall at which milk just starts to flow while the vacuum of a "
            "chamber in phase d is raised.",
            _RAISED,
        ),
        Quantity(
            "overpressure_raised_kpa",
            "overpressure, raised",
            "kPa",
            "Pressure difference across the wall in phase d less that at which milk just starts to flow.",
            _RAISED,
        ),
        Quantity(
            "flow_stop_map_kpa",
            "pressure difference at flow stop, by the map",
            "kPa",
            "Pressure difference across the wall at which the contact pressure on the last "
            f"{TEAT_END_MM:g} mm of the teat reaches the given one at which milk just stops flowing.",
            _BY_MAP,
        ),
        Quantity(
            "overpressure_map_kpa",
            "overpressure, by the map",
            "kPa",
            "Pressure difference across the wall in phase d less that at flow stop, by the map.",
            _BY_MAP,
        ),
        Quantity(
            "overpressure_disagreement_kpa",
            "overpressure, disagreement of two ways",
            "kPa",
            "Overpressure by milk flow, derived or raised, less that by the map; two ways of the literature "
            f"differ by less than {AGREED_KPA:.1f} kPa.",
            _OP,
        ),
    )
}
"""Quantities of overpressure, in the order in which they are shown."""

Found = FlowStop | str
"""Result of one way, or the reason why there is none."""


def overpressure_quantities(
    derived: Found, raised: Found, by_map: Found, gauge_sigma_kpa: float
) -> tuple[Finding, ...]:
    """All quantities, each with σ or with the reason why it is missing.

    Args:
        derived: result by the duration of the flow.
        raised: by its start while the vacuum is raised.
        by_map: by the contact pressure at the teat's end.
        gauge_sigma_kpa: σ of the difference's zero, which the overpressure is free of.
    """
    return (
        *_of_duration(derived),
        *_of_way("derived", derived, gauge_sigma_kpa),
        *_of_way("raised", raised, gauge_sigma_kpa),
        *_of_way("map", by_map, gauge_sigma_kpa),
        _disagreement(derived if isinstance(derived, FlowStop) else raised, by_map),
    )


def _of_duration(derived: Found) -> Iterator[Finding]:
    quantity = QUANTITIES["flow_duration_s"]
    if isinstance(derived, str):
        yield Finding.missing(quantity, derived)
    else:
        assert derived.duration_s is not None  # this way has one
        yield Finding.of(quantity, derived.duration_s)


def _of_way(name: str, found: Found, gauge_sigma_kpa: float) -> Iterator[Finding]:
    stop, over = QUANTITIES[f"flow_stop_{name}_kpa"], QUANTITIES[f"overpressure_{name}_kpa"]
    if isinstance(found, str):
        yield from (Finding.missing(one, found) for one in (stop, over))
        return
    at, beyond, common = found.difference_kpa, found.overpressure_kpa, found.common_kpa
    both = np.hypot([max(float(at.sigma), common), common], gauge_sigma_kpa)
    yield Finding.of(stop, Estimate.of(float(at.value), float(both[0])), float(both[1]))
    yield Finding.of(over, beyond, common)


def _disagreement(by_flow: Found, by_map: Found) -> Finding:
    quantity = QUANTITIES["overpressure_disagreement_kpa"]
    if isinstance(by_flow, str) or isinstance(by_map, str):
        return Finding.missing(quantity, "only one way to the overpressure, or none, has a result")
    (first, first_sigma), (second, second_sigma) = by_flow.overpressure_kpa, by_map.overpressure_kpa
    common = float(np.hypot(by_flow.common_kpa, by_map.common_kpa))
    off = Estimate.of(float(first - second), float(np.hypot(first_sigma, second_sigma)))
    return Finding.of(quantity, off, common)


class LoadedState(NamedTuple):
    """The load over height in one state of the wall, and the vacuum on both sides of it."""

    profile: LoadProfile
    vacuum: ChamberVacuum


def map_flow_stop(states: Sequence[LoadedState], occlusion_kpa: Estimate) -> FlowStop:
    """The difference at which the contact pressure at the teat's end is just that which stops the flow.

    The contact pressure rises with the difference, so it is read from the rising curve that fits the states
    best. Errors of different states are treated as fully correlated.

    Args:
        states: of one capture, in any order.
        occlusion_kpa: contact pressure at the teat's end, above the liner's gas, at which milk just stops.

    Raises:
        AnalysisError: no teat's end is seen, or no states close together are below and above that pressure.
    """
    if not states:
        raise AnalysisError("no state of the wall has a load over height", "give the inputs of the pressure")
    difference = np.array([one.vacuum.difference_kpa for one in states])
    lowest = min(one.vacuum.pulsation_kpa for one in states)
    at_rest = [one for one in states if one.vacuum.pulsation_kpa <= lowest + AT_REST_KPA]
    closed_kpa = float(np.median([one.vacuum.difference_kpa for one in at_rest]))
    contact_kpa, sigma_kpa = _at_end([one.profile for one in states], [one.profile for one in at_rest])
    order = np.argsort(difference)
    difference, contact_kpa, sigma_kpa = difference[order], contact_kpa[order], sigma_kpa[order]
    rising = _rising(contact_kpa, sigma_kpa)
    occlusion = float(occlusion_kpa.value)
    at_kpa, step_kpa = _passed(difference, rising, occlusion)
    own = float(np.interp(at_kpa, difference, sigma_kpa))
    spread = float(np.linalg.norm([own, COMPRESSION_SHARE * occlusion, float(occlusion_kpa.sigma)]))
    by_contact = _slope(difference, rising, occlusion, spread) * spread
    nearest = min(states, key=lambda one: abs(one.vacuum.difference_kpa - at_kpa)).vacuum
    steep = nearest.liner_slope_kpa_per_s - nearest.pulsation_slope_kpa_per_s
    sigma = float(np.linalg.norm([by_contact, _STRAIGHT * step_kpa, steep * nearest.time_sigma_s]))
    return FlowStop(
        Estimate.of(at_kpa, sigma), Estimate.of(closed_kpa - at_kpa, sigma), None, len(states), by_contact
    )


def _at_end(profiles: Sequence[LoadProfile], closed: Sequence[LoadProfile]) -> tuple[Array, Array]:
    """(S,) contact pressure on the last of the teat in each state, with σ.

    Raises:
        AnalysisError: the closed liner presses no teat, or its end is not seen.
    """
    heights = teat_heights(mean_profile(closed, np.ones(len(closed)), np.ones((len(closed),) * 2)))
    if heights.end_mm is None:
        raise AnalysisError(heights.reason, "glue targets down to where opposite walls meet below the teat")
    spans = [one.spans_within(*heights.last_of_teat_mm) for one in profiles]
    sums = [one.compression_kpa.summed(span / span.sum()) for one, span in zip(profiles, spans, strict=True)]
    return np.array([float(one.value) for one in sums]), np.array([float(one.sigma) for one in sums])


def _rising(contact_kpa: Array, sigma_kpa: Array) -> Array:
    """(S,) values that never fall, the nearest to those given (least squares)."""
    from scipy.optimize import isotonic_regression  # noqa: PLC0415 - heavy

    return np.asarray(isotonic_regression(contact_kpa, weights=1 / sigma_kpa**2).x, np.float64)


def _passed(difference: Array, rising: Array, occlusion: float) -> tuple[float, float]:
    """Difference at which the contact pressure passes the one sought, and the step between the states there.

    Raises:
        AnalysisError: it never does, or the states there are too far apart.
    """
    if not rising[0] < occlusion < rising[-1]:
        raise AnalysisError(
            f"the contact pressure at the teat's end is from {rising[0]:.1f} to {rising[-1]:.1f} kPa in all "
            f"states that have one, and never passes the {occlusion:g} kPa of flow_stop",
            "capture whole cycles, or raise the chamber's vacuum until the liner opens",
        )
    above = int(np.searchsorted(rising, occlusion))
    before, after = difference[above - 1 : above + 1]
    if after - before > _WIDEST_KPA:
        raise AnalysisError(
            f"the contact pressure at the teat's end passes {occlusion:g} kPa between states at {before:.1f} "
            f"and {after:.1f} kPa of pressure difference, which are too far apart: ask for more phases",
            f"states have to be less than {_WIDEST_KPA:g} kPa apart; capture for longer, or with more phases",
        )
    share = (occlusion - rising[above - 1]) / (rising[above] - rising[above - 1])
    return float(before + share * (after - before)), float(after - before)


def _slope(difference: Array, rising: Array, occlusion: float, reach: float) -> float:
    """Mean slope of the difference over the contact pressure within a reach of the one sought."""
    contact, first = np.unique(rising, return_index=True)
    low, high = np.clip([occlusion - reach, occlusion + reach], contact[0], contact[-1])
    ends = np.interp([low, high], contact, difference[first])
    return float((ends[1] - ends[0]) / (high - low))
