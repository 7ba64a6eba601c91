"""Liner compression, teat load, massage and overpressure of the mean cycle."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.analysis.estimate import Estimate, Joint
from grabberd.analysis.load.compression.closed_liner import (
    CERTAIN,
    TeatHeights,
    mean_profile,
    phase_weights,
    teat_heights,
)
from grabberd.analysis.load.compression.load_profile import LoadProfile
from grabberd.analysis.pulsation.phases import Phases
from grabberd.analysis.quantity import Finding, Quantity
from grabberd.errors import AnalysisError

Array = NDArray[np.float64]

TEAT_END_MM = 10.0
"""Length of tube, up to the teat's end, over which compression there is averaged: shorter patches blur."""
COMPRESSION_SHARE, LOAD_SHARE = 0.08, 0.04
"""σ of the estimator itself by the value, on walls solved as solids, beyond that of its inputs and noise.

Contact is never quite 0 in the prior, so pressures come out too high rather than too low.
"""
_DRAWS, _SEED = 400, 5
"""Of profiles, to find how far the place of a maximum scatters: its σ to 4 %."""

_ARC = "round the wall from its middle to 10 mm, or to the outermost targets if they are nearer"
_ON_TEAT = "over the heights at which the closed wall presses the teat"
_CLOSED = "mean over wall phase d"
_LITERATURE = "liner compression as in milking research: pressure of the closed liner on the teat's tissue"

QUANTITIES: Mapping[str, Quantity] = {
    one.name: one
    for one in (
        Quantity(
            "liner_compression_mean_kpa",
            "liner compression, mean",
            "kPa",
            f"Contact pressure of the closed liner, {_CLOSED}, {_ARC} and {_ON_TEAT}.",
            _LITERATURE,
        ),
        Quantity(
            "liner_compression_greatest_kpa",
            "liner compression, greatest",
            "kPa",
            f"Greatest over height of the contact pressure, {_CLOSED} and {_ARC}; noise raises it.",
            _LITERATURE,
        ),
        Quantity(
            "liner_compression_greatest_x_mm",
            "height of the greatest liner compression",
            "mm",
            "Height on the mounted tube, x in the object's frame, at which liner compression is greatest.",
            _LITERATURE,
        ),
        Quantity(
            "liner_compression_teat_end_kpa",
            "liner compression at the teat's end",
            "kPa",
            f"Contact pressure of the closed liner on the last {TEAT_END_MM:g} mm of the teat, {_CLOSED} and "
            f"{_ARC}.",
            _LITERATURE,
        ),
        Quantity(
            "teat_end_x_mm",
            "height of the teat's end",
            "mm",
            "Height on the mounted tube, x in the object's frame, of the last section, towards where "
            f"opposite walls meet, that presses by more than {CERTAIN:g} σ with the walls held apart.",
            "found from the wall's load and gap",
        ),
        Quantity(
            "teat_load_peak_n_per_mm",
            "teat load per height, greatest",
            "N/mm",
            "Greatest over height of the force per length of tube with which one side of the closed liner "
            f"presses the teat, {_CLOSED}; noise raises it.",
            "contact pressure over the half of the wall that faces the cameras, its flanks included",
        ),
        Quantity(
            "teat_load_n",
            "teat load",
            "N",
            f"Force with which one side of the closed liner presses the teat, {_CLOSED}, {_ON_TEAT}.",
            "contact pressure over the half of the wall that faces the cameras, its flanks included",
        ),
        Quantity(
            "massage_time_s",
            "massage, duration",
            "s",
            "Duration of wall phase d, during which the liner is closed.",
            "phases of ISO 3918, by the wall's movement",
        ),
        Quantity(
            "massage_pressure_kpa",
            "massage, pressure",
            "kPa",
            "Mean over wall phase d of the liner compression's mean, that is the pressure of the massage.",
            _LITERATURE,
        ),
        Quantity(
            "overpressure_kpa",
            "overpressure",
            "kPa",
            f"Contact pressure on the last {TEAT_END_MM:g} mm of the teat at full closure, the phase of "
            "greatest load, less the contact pressure at which milk just stops flowing, as given.",
            "overpressure as in milking research, but from contact pressure; the physiological way raises "
            "the chamber's vacuum until milk flows",
        ),
    )
}


_OF_THE_END = ("liner_compression_teat_end_kpa", "teat_end_x_mm", "overpressure_kpa")


class LinerCompression(NamedTuple):
    """Quantities of the closed liner.

    Attributes:
        findings: one for each of `QUANTITIES`, in their order.
        closed: load over height, mean over wall phase d; None if there is none.
        heights: where it presses the teat; None if that is unknown.
    """

    findings: tuple[Finding, ...]
    closed: LoadProfile | None
    heights: TeatHeights | None


def liner_compression(
    phase: Array,
    profiles: Sequence[LoadProfile | None],
    wall: Phases,
    flow_stop_kpa: Estimate | None,
) -> LinerCompression:
    """Quantities of the closed liner in the mean cycle.

    Args:
        phase: (P,) phases from 0 to 1, ascending, from the beginning of wall phase a.
        profiles: (P,) the load over height at each; None where it is unknown.
        wall: the wall's phases.
        flow_stop_kpa: contact pressure at the teat's end at which milk just stops flowing; None if unknown.
    """
    massage = Estimate(wall.durations_s.value[3], wall.durations_s.sigma[3])
    found: dict[str, Estimate] = {"massage_time_s": massage}
    share = float(massage.value / wall.durations_s.value.sum())
    weights = phase_weights(phase, 1 - share, 1.0)
    known = [int(k) for k in np.flatnonzero(weights) if profiles[int(k)] is not None]
    if not known:
        reason = (
            f"no load is known at any of the {np.count_nonzero(weights)} phases within wall phase d"
            if weights.any()
            else f"none of the {len(phase)} phases of the mean cycle lies within wall phase d; ask for more"
        )
        return LinerCompression(_findings(found, {}, reason), None, None)
    closing = [profile for k in known if (profile := profiles[k]) is not None]
    closed = mean_profile(closing, weights[known])
    try:
        heights = teat_heights(closed)
    except AnalysisError as error:
        return LinerCompression(_findings(found, {}, error.message), closed, None)
    found |= _of_closed(closed, heights)
    reasons = dict.fromkeys(_OF_THE_END, heights.reason)
    if heights.end_mm is not None:
        found |= _of_the_end(closed, closing, heights.teat, heights.end_mm, flow_stop_kpa)
        reasons["overpressure_kpa"] = (
            "flow_stop was not given: the contact pressure at the teat's end at which milk just stops flowing"
        )
    return LinerCompression(_findings(found, reasons, ""), closed, heights)


def _of_closed(closed: LoadProfile, heights: TeatHeights) -> dict[str, Estimate]:
    over = heights.teat * closed.spans_mm
    mean = _with_model(closed.compression_kpa.summed(over / over.sum()))
    greatest, greatest_x_mm = _greatest(closed.compression_kpa, heights.teat, closed.x_mm)
    peak, _ = _greatest(closed.load_n_per_mm, heights.teat, closed.x_mm)
    return {
        "liner_compression_mean_kpa": mean,
        "liner_compression_greatest_kpa": _with_model(greatest),
        "liner_compression_greatest_x_mm": greatest_x_mm,
        "teat_load_peak_n_per_mm": _with_model(peak, LOAD_SHARE),
        "teat_load_n": _with_model(closed.load_n_per_mm.summed(over), LOAD_SHARE),
        "massage_pressure_kpa": mean,
    }


def _of_the_end(
    closed: LoadProfile,
    closing: Sequence[LoadProfile],
    teat: NDArray[np.bool_],
    end_mm: Estimate,
    flow_stop_kpa: Estimate | None,
) -> dict[str, Estimate]:
    found = {"liner_compression_teat_end_kpa": _at_end(closed, teat, end_mm), "teat_end_x_mm": end_mm}
    if flow_stop_kpa is not None:
        fullest = max(closing, key=lambda one: float(one.load_n_per_mm.value @ (teat * one.spans_mm)))
        at_end = _at_end(fullest, teat, end_mm)
        sigma = np.hypot(at_end.sigma, flow_stop_kpa.sigma)
        found["overpressure_kpa"] = Estimate(at_end.value - flow_stop_kpa.value, sigma)
    return found


def _at_end(profile: LoadProfile, teat: NDArray[np.bool_], end_mm: Estimate) -> Estimate:
    """Compression over the last `TEAT_END_MM` of the teat."""
    from_end_mm = np.abs(profile.x_mm - float(end_mm.value))
    over = teat * (from_end_mm < TEAT_END_MM) * profile.spans_mm
    return _with_model(profile.compression_kpa.summed(over / over.sum()))


def _with_model(found: Estimate, share: float = COMPRESSION_SHARE) -> Estimate:
    return Estimate(found.value, np.hypot(found.sigma, share * np.abs(found.value)))


def _greatest(joint: Joint, teat: NDArray[np.bool_], x_mm: Array) -> tuple[Estimate, Estimate]:
    """Greatest value, and its height; σ of the height from draws of the profile."""
    value, covariance, at_mm = joint.value[teat], joint.covariance[np.ix_(teat, teat)], x_mm[teat]
    index = int(np.argmax(value))
    root = np.linalg.cholesky(covariance + 1e-9 * np.trace(covariance) * np.eye(len(value)))
    draws = value + np.random.default_rng(_SEED).normal(size=(_DRAWS, len(value))) @ root.T
    scatter_mm = np.sqrt(np.mean((at_mm[draws.argmax(axis=1)] - at_mm[index]) ** 2))
    spacing_mm = float(np.diff(x_mm).mean())
    height = Estimate(np.asarray(at_mm[index]), np.hypot(scatter_mm, spacing_mm / np.sqrt(12)))
    return Estimate(value[index], np.sqrt(covariance[index, index])), height


def _findings(
    found: Mapping[str, Estimate], reasons: Mapping[str, str], otherwise: str
) -> tuple[Finding, ...]:
    return tuple(
        Finding.of(quantity, found[name])
        if name in found
        else Finding.missing(quantity, reasons.get(name, otherwise))
        for name, quantity in QUANTITIES.items()
    )
