"""Stroke, rate, ratios, phases and lags of a pulsation: of the wall, and of the chamber's vacuum, whose
phases are also judged by the limits of ISO 5707.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from grabberd_liner.analysis.estimate import Estimate, Finding, Quantity
from grabberd_liner.analysis.pulsation.phases import Phases
from grabberd_liner.analysis.pulsation.pulsation import Pulsation

_BY_WALL = "phases of ISO 3918, by the wall's movement"
_BY_VACUUM = "ISO 3918 and ISO 6690, by the pulsation chamber's vacuum"
_RATIO = "(a + b) / (a + b + c + d)"

MOVEMENT: tuple[Quantity, Quantity] = (
    Quantity(
        "stroke_mm",
        "stroke",
        "mm",
        "Size of the wall's first principal movement in the mean cycle, told as that of the target that "
        "moves most, from the closed level to the open one; each is the mean over the part of the cycle that "
        "is within 1 % of the stroke of it.",
        "movement of the liner's wall as in laser measurements; here in space, of all targets together",
    ),
    Quantity(
        "rate_per_min", "pulsation rate", "1/min", "Cycles a minute.", "ISO 3918, by the wall's movement"
    ),
)
"""Stroke and rate."""
WALL: Mapping[str, Quantity] = {
    "a": Quantity(
        "liner_opening_s",
        "liner opening time",
        "s",
        "Time in which the wall moves from 10 to 90 % of its stroke: wall phase a.",
        _BY_WALL,
    ),
    "b": Quantity(
        "liner_open_s",
        "liner open time",
        "s",
        "Time for which the wall stays beyond 90 % of its stroke: wall phase b.",
        _BY_WALL,
    ),
    "c": Quantity(
        "liner_closing_s",
        "liner closing time",
        "s",
        "Time in which the wall moves back from 90 to 10 % of its stroke: wall phase c.",
        _BY_WALL,
    ),
}
"""Durations of wall phases; that of d is the massage's."""
WALL_RATIO = Quantity(
    "wall_ratio", "ratio by the wall's movement", "1", f"{_RATIO} of the wall phases.", _BY_WALL
)
VACUUM: Mapping[str, Quantity] = {
    letter: Quantity(
        f"phase_{letter}_s",
        f"phase {letter}",
        "s",
        f"Duration of phase {letter} of the chamber's vacuum: {what}.",
        _BY_VACUUM,
    )
    for letter, what in (
        ("a", "it rises from 4 kPa to 4 kPa below its maximum"),
        ("b", "it stays above 4 kPa below its maximum"),
        ("c", "it falls from 4 kPa below its maximum to 4 kPa"),
    )
}
"""Durations of ISO's phases; that of d has a limit."""
PULSATOR_RATIO = Quantity(
    "pulsator_ratio", "pulsator ratio", "1", f"{_RATIO} of the phases of the chamber's vacuum.", _BY_VACUUM
)
LAGS: tuple[Quantity, Quantity] = (
    Quantity(
        "opening_lag_s",
        "lag of the opening wall",
        "s",
        "Delay from half the height of the rising vacuum to half the stroke of the opening wall.",
        "response of the liner to the pulsator; by a light in the picture, or on one clock",
    ),
    Quantity(
        "closing_lag_s",
        "lag of the closing wall",
        "s",
        "Delay from half the height of the falling vacuum to half the stroke of the closing wall.",
        "response of the liner to the pulsator; by a light in the picture, or on one clock",
    ),
)
"""Opening and closing."""


def movement_quantities(pulsation: Pulsation | None, reason: str) -> tuple[Finding, ...]:
    """Stroke and rate, or the reason why there are none."""
    if pulsation is None:
        return tuple(Finding.missing(quantity, reason) for quantity in MOVEMENT)
    found = (pulsation.stroke_mm, pulsation.rate_per_min)
    return tuple(Finding.of(*one) for one in zip(MOVEMENT, found, strict=True))


def wall_quantities(phases: Phases | None, reason: str) -> tuple[Finding, ...]:
    """Durations of the wall's phases and its ratio, or the reason why there are none."""
    return _of_phases({**WALL, "ratio": WALL_RATIO}, phases, reason)


def vacuum_quantities(phases: Phases | None, reason: str) -> tuple[Finding, ...]:
    """Durations of ISO's phases and the pulsator ratio, or the reason why there are none."""
    return _of_phases({**VACUUM, "ratio": PULSATOR_RATIO}, phases, reason)


def lag_quantities(lags_s: Sequence[Estimate], clock_sigma_s: float, reason: str) -> tuple[Finding, ...]:
    """Lags of the opening and of the closing wall.

    Args:
        lags_s: both, with the σ of their noise; empty if they are unknown.
        clock_sigma_s: σ of the vacuum's clock against the camera's.
        reason: why they are unknown.
    """
    if not lags_s:
        return tuple(Finding.missing(quantity, reason) for quantity in LAGS)
    whole = [Estimate(one.value, np.hypot(one.sigma, clock_sigma_s)) for one in lags_s]
    return tuple(Finding.of(quantity, one, clock_sigma_s) for quantity, one in zip(LAGS, whole, strict=True))


def _of_phases(quantities: Mapping[str, Quantity], phases: Phases | None, reason: str) -> tuple[Finding, ...]:
    if phases is None:
        return tuple(Finding.missing(quantity, reason) for quantity in quantities.values())
    value, sigma = phases.durations_s
    known = {letter: Estimate(value[k], sigma[k]) for k, letter in enumerate("abcd")}
    known["ratio"] = phases.ratio
    return tuple(Finding.of(quantity, known[key]) for key, quantity in quantities.items())


MET, NOT_MET, NOT_CERTAIN = "met", "not met", "not certain"
_CERTAIN = 2.0
"""σ that a value has to be away from its limit for a verdict."""
_OPEN, _CLOSED = 1, 3
NO_CURVE = "the pulsation chamber's vacuum is not known as a curve: its phases have no durations"
"""Why the phases have no durations, where there are none."""
_SOURCE = "ISO 5707; phases as in ISO 3918 and ISO 6690, by the pulsation chamber's vacuum"


class Limit(NamedTuple):
    """A least value that a standard asks for."""

    quantity: Quantity
    least: float


LIMITS: tuple[Limit, ...] = (
    Limit(
        Quantity(
            "phase_b_share",
            "phase b of the cycle",
            "1",
            "Duration of phase b of the chamber's vacuum by that of the cycle; at least .30.",
            _SOURCE,
        ),
        0.30,
    ),
    Limit(
        Quantity(
            "phase_d_share",
            "phase d of the cycle",
            "1",
            "Duration of phase d of the chamber's vacuum by that of the cycle; at least .15.",
            _SOURCE,
        ),
        0.15,
    ),
    Limit(
        Quantity(
            "phase_d_s",
            "phase d",
            "s",
            "Duration of phase d of the chamber's vacuum; at least .150 s.",
            _SOURCE,
        ),
        0.150,
    ),
)


def pulsator_limits(phases: Phases | None) -> tuple[Finding, ...]:
    """The phases of a vacuum, each with its verdict: met, not met, or not certain within 2 σ of the limit."""
    if phases is None or phases.defined_by != "vacuum":
        return tuple(Finding.missing(limit.quantity, NO_CURVE) for limit in LIMITS)
    duration = Estimate(phases.durations_s.value[_CLOSED], phases.durations_s.sigma[_CLOSED])
    values = (_share(phases, _OPEN), _share(phases, _CLOSED), duration)
    return tuple(
        Finding.of(limit.quantity, value)._replace(verdict=verdict(value, limit.least))
        for limit, value in zip(LIMITS, values, strict=True)
    )


def verdict(found: Estimate, least: float) -> str:
    """Verdict on a least value: met, not met, or not certain within 2 σ of it."""
    margin = float(found.value) - least
    if abs(margin) < _CERTAIN * float(found.sigma):
        return NOT_CERTAIN
    return MET if margin >= 0 else NOT_MET


def _share(phases: Phases, index: int) -> Estimate:
    """Share of the cycle; the errors of phase and cycle may go together, so both count in full."""
    part, part_sigma = phases.durations_s.value[index], phases.durations_s.sigma[index]
    period, period_sigma = float(phases.period_s.value), float(phases.period_s.sigma)
    share = part / period
    return Estimate.of(share, part_sigma / period + share * period_sigma / period)
