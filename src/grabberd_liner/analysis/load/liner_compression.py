"""Liner compression above the liner's gas and above atmosphere, teat load and massage of the mean cycle."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from grabberd.core.arrays import Array, Mask
from grabberd.errors import AnalysisError
from grabberd_liner.analysis.estimate import Estimate, Finding, Joint, Quantity
from grabberd_liner.analysis.load.load_profile import (
    END_SHARE,
    TEAT_END_MM,
    ChosenHeights,
    LoadProfile,
    TeatHeights,
    mean_profile,
    phase_weights,
    teat_heights,
)
from grabberd_liner.analysis.pulsation.phases import Phases

COMPRESSION_SHARE, AT_END_SHARE = 0.05, 0.02
"""Shares by which a compression errs beyond its covariance, on walls solved as solids: along the teat, where
its flanks press little, and at its end. A load does not."""
BEYOND_FLOW_STOP = "teat_end_beyond_flow_stop_kpa"
_DRAWS, _SEED = 400, 5
"""Of profiles, to find how far the place of a maximum scatters: its σ to 4 %."""

_ARC = "round the wall from its middle to 10 mm, or to the outermost targets if they are nearer"
_ON_TEAT = "from the first row of targets on the teat to the teat's end"
_CLOSED = "mean over wall phase d"
_HERE = (
    "liner compression as in milking research, but above the gas in the liner; the literature's, 5 to 12 kPa "
    "at the apex (Mein, Williams and Thiel 1987), is above atmosphere"
)
_LITERATURE = "liner compression as in milking research: pressure of the closed liner on the teat's tissue"
_SIDE = "contact pressure over the half of the wall that faces the cameras, its flanks included"
_BELOW_END = f"on the last {TEAT_END_MM:g} mm of the teat"
_COMPRESSIONS = (
    (
        "liner_compression_mean_kpa",
        "liner compression, mean",
        f"{_CLOSED}, {_ARC} and {_ON_TEAT}: the pressure of the massage",
    ),
    (
        "liner_compression_greatest_kpa",
        "liner compression, greatest",
        f"greatest over height, {_CLOSED} and {_ARC}; noise raises it",
    ),
    (
        "liner_compression_teat_end_kpa",
        "liner compression at the teat's end",
        f"{_BELOW_END}, {_CLOSED} and {_ARC}",
    ),
)
"""Compressions: name, title and what is averaged."""


def above_atmosphere(name: str) -> str:
    """Name of a compression above atmosphere, from its name above the gas in the liner."""
    return name.replace("_kpa", "_above_atmosphere_kpa")


def _quantities() -> Iterator[Quantity]:
    for name, title, what in _COMPRESSIONS:
        pressed = "Contact pressure of the closed liner above the gas in it"
        yield Quantity(name, title, "kPa", f"{pressed}: {what}.", _HERE)
        less = f"The same as {name}, less the vacuum in the liner, {_CLOSED}."
        yield Quantity(above_atmosphere(name), f"{title}, above atmosphere", "kPa", less, _LITERATURE)
    yield Quantity(
        "liner_compression_greatest_x_mm",
        "height of the greatest liner compression",
        "mm",
        "Height on the mounted tube, x in the object's frame, at which liner compression is greatest.",
        _LITERATURE,
    )
    yield Quantity(
        "teat_end_x_mm",
        "height of the teat's end",
        "mm",
        "Height on the mounted tube, x in the object's frame, at which liner compression, towards where "
        f"opposite walls meet, has fallen to {100 * END_SHARE:g} % of its greatest.",
        "found from the wall's load and gap",
    )
    yield Quantity(
        "teat_load_peak_n_per_mm",
        "teat load per height, greatest",
        "N/mm",
        "Greatest over height of the force per length of tube with which one side of the closed liner "
        f"presses the teat, {_CLOSED}; noise raises it.",
        _SIDE,
    )
    yield Quantity(
        "teat_load_n",
        "teat load",
        "N",
        f"Force with which one side of the closed liner presses the teat, {_CLOSED}, {_ON_TEAT}.",
        _SIDE,
    )
    yield Quantity(
        "massage_time_s",
        "massage, duration",
        "s",
        "Duration of wall phase d, during which the liner is closed.",
        "phases of ISO 3918, by the wall's movement",
    )
    yield Quantity(
        BEYOND_FLOW_STOP,
        "contact pressure at the teat's end beyond flow stop",
        "kPa",
        f"Contact pressure {_BELOW_END} at full closure, the phase of greatest load, less the contact "
        "pressure at which milk just stops flowing, as given.",
        "no overpressure, which is a pressure difference across the wall: some five times as much",
    )


QUANTITIES: Mapping[str, Quantity] = {one.name: one for one in _quantities()}
_OF_THE_END = (
    "liner_compression_teat_end_kpa",
    above_atmosphere("liner_compression_teat_end_kpa"),
    "teat_end_x_mm",
    BEYOND_FLOW_STOP,
)
_NO_LINER_VACUUM = "the vacuum in the liner is not known"


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
    correlation: Array | None = None,
    liner_kpa: Estimate | None = None,
) -> LinerCompression:
    """Quantities of the closed liner in the mean cycle.

    Args:
        phase: (P,) phases from 0 to 1, ascending, from the beginning of wall phase a.
        profiles: (P,) the load over height at each; None where it is unknown.
        wall: the wall's phases.
        flow_stop_kpa: contact pressure at the teat's end at which milk just stops flowing; None if unknown.
        correlation: (P, P) of the noise of the points at two phases; None if it goes together in full.
        liner_kpa: (P,) vacuum in the liner, below atmosphere; None if unknown.
    """
    massage = Estimate(wall.durations_s.value[3], wall.durations_s.sigma[3])
    found = {"massage_time_s": Finding.of(QUANTITIES["massage_time_s"], massage)}
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
    alike = np.ones((len(phase),) * 2) if correlation is None else correlation
    closed = mean_profile(closing, weights[known], alike[np.ix_(known, known)])
    try:
        heights = teat_heights(closed)
    except AnalysisError as error:
        return LinerCompression(_findings(found, {}, error.message), closed, None)
    choice = ChosenHeights.of(closed, heights)
    found |= _by_name(_of_closed(closed, heights, choice))
    reasons = dict.fromkeys(_OF_THE_END, heights.reason) if heights.reason else {}
    if heights.end_mm is not None:
        found |= _by_name(_of_the_end(closed, closing, heights, choice, flow_stop_kpa))
        reasons[BEYOND_FLOW_STOP] = (
            "flow_stop was not given: the contact pressure at the teat's end at which milk just stops flowing"
        )
    if liner_kpa is not None:
        found |= _by_name(_above_atmosphere(found, liner_kpa, weights))
    return LinerCompression(_findings(found, reasons, _NO_LINER_VACUUM), closed, heights)


def _above_atmosphere(found: Mapping[str, Finding], liner_kpa: Estimate, weights: Array) -> Iterator[Finding]:
    """Compressions less the liner's vacuum.

    That is in the pressure difference as well, where its error partly cancels: σ is never too small.
    """
    share = weights / weights.sum()
    liner, sigma_kpa = float(share @ liner_kpa.value), float(share @ liner_kpa.sigma)
    for name, _, _ in _COMPRESSIONS:
        if one := found.get(name):
            sigma, common = (float(np.hypot(part, sigma_kpa)) for part in (one.sigma, one.common))
            yield Finding(QUANTITIES[above_atmosphere(name)], one.value - liner, sigma, common=common)


def _of_closed(closed: LoadProfile, heights: TeatHeights, choice: ChosenHeights) -> Iterator[Finding]:
    over = closed.spans_within(heights.first_mm, heights.last_mm)
    yield _sum("liner_compression_mean_kpa", closed, over / over.sum(), choice.mean_kpa2)
    greatest, greatest_x_mm = _greatest(closed.compression_kpa, heights.teat, closed.x_mm)
    yield _sum("liner_compression_greatest_kpa", closed, greatest)
    yield Finding.shared(QUANTITIES["liner_compression_greatest_x_mm"], greatest_x_mm)
    peak, _ = _greatest(closed.load_n_per_mm, heights.teat, closed.x_mm)
    yield _sum("teat_load_peak_n_per_mm", closed, peak)
    yield _sum("teat_load_n", closed, over, choice.load_n2)


def _of_the_end(
    closed: LoadProfile,
    closing: Sequence[LoadProfile],
    heights: TeatHeights,
    choice: ChosenHeights,
    flow_stop_kpa: Estimate | None,
) -> Iterator[Finding]:
    assert heights.end_mm is not None
    last_mm, end_mm = heights.last_of_teat_mm, heights.end_mm
    yield _at_end("liner_compression_teat_end_kpa", closed, last_mm, end_mm, choice.end_kpa2)
    yield Finding.shared(QUANTITIES["teat_end_x_mm"], end_mm)
    if flow_stop_kpa is not None:
        teat_mm = (heights.first_mm, heights.last_mm)
        fullest = max(closing, key=lambda one: float(one.load_n_per_mm.value @ one.spans_within(*teat_mm)))
        at_end = _at_end(BEYOND_FLOW_STOP, fullest, last_mm, end_mm, choice.end_kpa2)
        sigma, common = (float(np.hypot(one, flow_stop_kpa.sigma)) for one in (at_end.sigma, at_end.common))
        yield at_end._replace(value=at_end.value - float(flow_stop_kpa.value), sigma=sigma, common=common)


def _at_end(
    name: str, profile: LoadProfile, within_mm: tuple[float, float], end_mm: Estimate, chosen: float
) -> Finding:
    """Compression over the last of the teat.

    It falls off steeply there, so σ has the part of the end's σ, which moves both limits.
    """
    over = profile.spans_within(*within_mm)
    found = _sum(name, profile, over / over.sum(), chosen)
    limits_kpa = np.interp(within_mm, profile.x_mm, profile.compression_kpa.value)
    by_end_kpa = np.diff(limits_kpa)[0] / TEAT_END_MM * end_mm.sigma
    sigma, common = (float(np.hypot(one, by_end_kpa)) for one in (found.sigma, found.common))
    return found._replace(sigma=sigma, common=common)


def _sum(name: str, profile: LoadProfile, weights: Array, chosen: float = 0.0) -> Finding:
    """Sum over height of the load for a quantity in N, or of the compression for one in kPa.

    Args:
        name: of the quantity.
        profile: the load over height.
        weights: (H,) of the heights.
        chosen: variance of the sum by the noise in the choice of its heights.
    """
    of_load = QUANTITIES[name].unit.startswith("N")
    found = (profile.load_n_per_mm if of_load else profile.compression_kpa).summed(weights)
    share = 0.0 if of_load else AT_END_SHARE if name in _OF_THE_END else COMPRESSION_SHARE
    variance = float(found.sigma) ** 2 + float(share * found.value) ** 2
    own = 0.0
    if profile.noise is not None:
        count = len(weights)
        part = slice(count, 2 * count) if of_load else slice(count)
        own = max(float(weights @ profile.noise.covariance[part, part] @ weights), 0.0)
    # Whatever is not noise of what was seen is the same in all captures that are given the same.
    common = np.sqrt(max(variance - own, 0.0))
    return Finding.of(QUANTITIES[name], Estimate(found.value, np.sqrt(variance + chosen)), float(common))


def _greatest(joint: Joint, teat: Mask, x_mm: Array) -> tuple[Array, Estimate]:
    """Weights that pick the greatest value, and its height; σ of that from draws of the profile."""
    value, covariance, at_mm = joint.value[teat], joint.covariance[np.ix_(teat, teat)], x_mm[teat]
    index = int(np.argmax(value))
    root = np.linalg.cholesky(covariance + 1e-9 * np.trace(covariance) * np.eye(len(value)))
    draws = value + np.random.default_rng(_SEED).normal(size=(_DRAWS, len(value))) @ root.T
    scatter_mm = np.sqrt(np.mean((at_mm[draws.argmax(axis=1)] - at_mm[index]) ** 2))
    spacing_mm = float(np.diff(x_mm).mean())
    height = Estimate.of(at_mm[index], np.hypot(scatter_mm, spacing_mm / np.sqrt(12)))
    return np.asarray(x_mm == at_mm[index], np.float64), height


def _by_name(found: Iterable[Finding]) -> dict[str, Finding]:
    return {one.quantity.name: one for one in found}


def _findings(
    found: Mapping[str, Finding], reasons: Mapping[str, str], otherwise: str
) -> tuple[Finding, ...]:
    return tuple(
        found.get(name) or Finding.missing(quantity, reasons.get(name, otherwise))
        for name, quantity in QUANTITIES.items()
    )
