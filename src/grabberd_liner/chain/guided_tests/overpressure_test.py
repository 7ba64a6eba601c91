"""The test of overpressure: by the duration of milk flow, and by raising the vacuum until milk flows."""

from collections.abc import Sequence

import numpy as np

from grabberd_liner.analysis.estimate import Estimate, Finding
from grabberd_liner.analysis.load.overpressure import AGREED_KPA, QUANTITIES
from grabberd_liner.chain.guided_tests.outcome import Check, Evidence, Outcome, Question

_WAYS = ("derived", "raised", "map")
_FLOW = "record the sensor in the short milk tube as a channel flow, and give milk_flow in the cup's profile"

WAYS = {
    "derived": Question(
        "derived", "overpressure from the duration of milk flow", f"capture some twenty cycles; {_FLOW}"
    ),
    "raised": Question(
        "raised",
        "overpressure by raising the chamber's vacuum",
        f"hold the chamber in phase d, then raise its vacuum slowly until milk flows; {_FLOW}",
    ),
}
AGREEMENT = Question(
    "agreement",
    "two ways agree",
    "measure both within a minute: overpressure falls while a cow is milked; check the sensor of milk flow",
    "kPa",
)


def overpressure_test(captures: Sequence[Evidence]) -> Outcome:
    """Judges captures of one cow: of a pulsating chamber, and of one whose vacuum is raised in phase d."""
    found = {way: mean for way in _WAYS if (mean := _mean(f"overpressure_{way}_kpa", captures))}
    checks = [WAYS[way].answered(way in found, _reasons(f"overpressure_{way}_kpa", captures)) for way in WAYS]
    stops = (_mean(f"flow_stop_{way}_kpa", captures) for way in _WAYS)
    apart = _disagreement(found)
    findings = [*found.values(), *(one for one in stops if one), *([apart] if apart else [])]
    return Outcome((*checks, _agreement(apart)), tuple(findings))


def _mean(name: str, captures: Sequence[Evidence]) -> Finding | None:
    """Mean of a quantity over the captures that have it; None if none has."""
    known = [(value, one.common(name)) for one in captures if (value := one.quantity(name))]
    if not known:
        return None
    values, sigmas = (np.array([float(value[part]) for value, _ in known]) for part in (0, 1))
    common = float(np.mean([part for _, part in known]))
    own2 = max(float(np.mean(sigmas**2)) - common**2, 0.0) / len(known)
    return Finding.of(QUANTITIES[name], Estimate.of(values.mean(), np.sqrt(own2 + common**2)), common)


def _reasons(name: str, captures: Sequence[Evidence]) -> str:
    said = (one.said(name, "reason") or one.problem for one in captures if not one.quantity(name))
    return "; ".join(dict.fromkeys(text for text in said if text))


def _disagreement(found: dict[str, Finding]) -> Finding | None:
    """The first way's overpressure less the second's; None if there is one at most."""
    if len(found) < 2:
        return None
    first, second = list(found.values())[:2]
    words = f"{first.quantity.title.capitalize()}, less {second.quantity.title}"
    literature = f"two ways of the literature differ by less than {AGREED_KPA:.1f} kPa"
    quantity = QUANTITIES["overpressure_disagreement_kpa"]
    return Finding.of(
        quantity._replace(definition=f"{words}; {literature}."),
        Estimate.of(first.value - second.value, float(np.hypot(first.sigma, second.sigma))),
        float(np.hypot(first.common, second.common)),
    )


def _agreement(apart: Finding | None) -> Check:
    if apart is None:
        return AGREEMENT.not_checked("only one way to the overpressure, or none, has a result")
    return AGREEMENT.within(apart.estimate, 0.0, AGREED_KPA)
