"""A pulsator by the limits of ISO 5707."""

from typing import NamedTuple

import numpy as np

from grabberd_liner.analysis.estimate import Estimate
from grabberd_liner.analysis.pulsation.phases import Phases
from grabberd_liner.analysis.quantity import Finding, Quantity

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
    return Estimate(np.asarray(share), np.asarray(part_sigma / period + share * period_sigma / period))
