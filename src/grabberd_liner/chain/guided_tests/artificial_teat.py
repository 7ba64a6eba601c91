"""The check of the pressure: an artificial teat whose pressure is known, in steps up and down."""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from grabberd.core.arrays import Array
from grabberd.core.geometry.document_reader import finite
from grabberd_liner.analysis.comparison import Line, straight_line
from grabberd_liner.analysis.estimate import Estimate, Finding, Quantity
from grabberd_liner.analysis.mixed_model import observations
from grabberd_liner.chain.guided_tests.outcome import LINE, POINTS, Check, Curve, Evidence, Outcome, Question
from grabberd_liner.chain.guided_tests.recipes import KNOWN_KPA, KNOWN_SIGMA_KPA

_SLOPE, _OFFSET_KPA = 0.10, 0.5
_LEAST_STEPS = 3
_HYSTERESIS_KPA = 1.0
_KNOWN_SIGMA_KPA = 0.1
"""Of a water column that is read to a centimetre."""
_ALIKE_KPA = 0.05
_SHARE = "rig and liner"

STEPS = Question(
    "steps", "known pressures", "label every capture with the pressure in the teat: known_kpa, from 0 up"
)
PRESSURE = Question(
    "pressure_found",
    "every step has a pressure",
    "complete the liner's profile; give the capture of the reference state along, with the others",
)
SLOPE = Question(
    "slope",
    "slope of found over known pressure",
    "E·t of the liner is wrong by that factor: make a ramp, accept its offer, and evaluate again",
    "1",
)
OFFSET = Question(
    "offset",
    "found pressure at 0",
    "check F0_n and the reference state: mount, make the reference test, and capture the steps again",
    "kPa",
)
ZERO = Question(
    "zero_step",
    "pressure of the step at 0",
    "let the water out, wait for the rubber, and capture it again",
    "kPa",
)
HYSTERESIS = Question(
    "hysteresis",
    "difference between up and down",
    "go slower, and wait before each capture; what stays is the rubber's, and part of the uncertainty",
    "kPa",
)


class _Steps(NamedTuple):
    """N steps with a pressure, in the order of time."""

    known_kpa: Array
    known_sigma_kpa: Array
    found_kpa: Array
    sigma_kpa: Array
    common_kpa: Array


def artificial_teat_test(captures: Sequence[Evidence]) -> Outcome:
    """Judges captures of the steps, the oldest first; those without a known pressure are left out."""
    labelled = [(one, known) for one in captures if (known := known_kpa(one)) is not None]
    values = sorted({round(known / _ALIKE_KPA) for _, known in labelled})
    enough = len(values) >= _LEAST_STEPS and values[0] == 0
    checks = [
        STEPS.answered(
            enough,
            f"{len(values)} different pressures are labelled{'' if values[:1] == [0] else ', and none is 0'}",
            f"at least {_LEAST_STEPS}, with 0",
        )
    ]
    lacking = [(one, known) for one, known in labelled if math.isnan(one.mean_contact_kpa()[0].value)]
    said = "; ".join(f"{known:g} kPa ({one.id}): {one.no_pressure}" for one, known in lacking)
    checks.append(PRESSURE.answered(bool(labelled) and not lacking, said or "no capture is labelled"))
    steps = _steps([one for one in labelled if one not in lacking])
    line = _line(steps)
    checks += [*_of_line(line), *_of_steps(steps)]
    return Outcome(tuple(checks), tuple(_findings(line, steps)), tuple(_curves(steps, line)))


def known_kpa(one: Evidence) -> float | None:
    """Pressure in the teat, from the capture's label; None if it has none that is a number."""
    return finite(one.labelled(KNOWN_KPA))


def _known_sigma_kpa(one: Evidence) -> float:
    value = one.labelled(KNOWN_SIGMA_KPA)
    return value if value > 0 else _KNOWN_SIGMA_KPA


def _steps(labelled: Sequence[tuple[Evidence, float]]) -> _Steps:
    found = [one.mean_contact_kpa() for one, _ in labelled]
    return _Steps(
        np.array([known for _, known in labelled]),
        np.array([_known_sigma_kpa(one) for one, _ in labelled]),
        np.array([float(value.value) for value, _ in found]),
        np.array([float(value.sigma) for value, _ in found]),
        np.array([common for _, common in found]),
    )


def _line(steps: _Steps) -> Line | None:
    if len(np.unique(np.round(steps.known_kpa / _ALIKE_KPA))) < _LEAST_STEPS:
        return None
    # Where the slope is about 1, σ of what is known moves a point as far as that of what was found.
    sigma = np.hypot(steps.sigma_kpa, steps.known_sigma_kpa)
    shares = [_SHARE] * len(sigma)
    return straight_line(observations(steps.found_kpa, sigma, steps.common_kpa, shares), steps.known_kpa)


def _of_line(line: Line | None) -> Iterator[Check]:
    if line is None:
        yield from (ask.not_checked("too few steps have a pressure") for ask in (SLOPE, OFFSET))
        return
    yield SLOPE.within(Estimate.of(line.slope.value, line.slope.sigma), 1.0, _SLOPE)
    yield OFFSET.within(Estimate.of(line.offset.value, line.offset.sigma), 0.0, _OFFSET_KPA)


def _of_steps(steps: _Steps) -> Iterator[Check]:
    at_zero = np.abs(steps.known_kpa) < _ALIKE_KPA
    if at_zero.any():
        first = int(np.flatnonzero(at_zero)[0])
        sigma = float(np.hypot(steps.sigma_kpa[first], steps.known_sigma_kpa[first]))
        yield ZERO.agrees(Estimate.of(steps.found_kpa[first], sigma), 0.0, sigma)
    else:
        yield ZERO.not_checked("no step at 0 has a pressure")
    found = hysteresis_kpa(steps)
    if found is None:
        yield HYSTERESIS.not_checked("no pressure was captured both upwards and downwards")
    else:
        yield HYSTERESIS.within(Estimate.of(*found), 0.0, _HYSTERESIS_KPA)


def hysteresis_kpa(steps: _Steps) -> tuple[float, float] | None:
    """Found pressure downwards less upwards, on average over the pressures captured both ways, and its σ."""
    if not len(steps.known_kpa):
        return None
    top = int(np.argmax(steps.known_kpa))
    rank = np.round(steps.known_kpa / _ALIKE_KPA)
    up, down = rank[:top], rank[top + 1 :]
    both = [at for at in np.unique(up) if at in down]
    if not both:
        return None
    own = np.sqrt(np.maximum(steps.sigma_kpa**2 - steps.common_kpa**2, 0.0) + steps.known_sigma_kpa**2)
    differences, variances = [], []
    for at in both:
        before, after = np.flatnonzero(rank[:top] == at), top + 1 + np.flatnonzero(rank[top + 1 :] == at)
        differences.append(steps.found_kpa[after].mean() - steps.found_kpa[before].mean())
        variances.append(np.mean(own[after] ** 2) / len(after) + np.mean(own[before] ** 2) / len(before))
    return float(np.mean(differences)), float(np.sqrt(np.sum(variances)) / len(both))


def _findings(line: Line | None, steps: _Steps) -> Iterator[Finding]:
    of = "docs/howto/pressure.md"
    slope = Quantity("slope", "slope", "1", "Change of the found pressure by that of the known one.", of)
    offset = Quantity("offset_kpa", "offset", "kPa", "Found pressure on the line where the known is 0.", of)
    for quantity, found in ((slope, line and line.slope), (offset, line and line.offset)):
        if found is None:
            yield Finding.missing(quantity, "too few steps have a pressure")
        else:
            yield Finding(quantity, found.value, found.sigma, common=found.common)
    between = hysteresis_kpa(steps)
    definition = "Found pressure downwards less upwards, at the same known one."
    quantity = Quantity("hysteresis_kpa", "hysteresis", "kPa", definition, of)
    if between is None:
        yield Finding.missing(quantity, "no pressure was captured both upwards and downwards")
    else:
        yield Finding.of(quantity, Estimate.of(*between))


def _curves(steps: _Steps, line: Line | None) -> Iterator[Curve]:
    axes = (("known pressure", "kPa"), ("found pressure", "kPa"))
    if not len(steps.known_kpa):
        return
    yield Curve("steps", "steps", axes, POINTS, steps.known_kpa, steps.found_kpa, steps.sigma_kpa)
    x = np.array([0.0, float(steps.known_kpa.max())])
    nothing = np.full(2, np.nan)
    yield Curve("equal", "equal", axes, LINE, x, x, nothing)
    if line is not None:
        y = line.offset.value + line.slope.value * x
        yield Curve("line", "line through the steps", axes, LINE, x, y, nothing)
