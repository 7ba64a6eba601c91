"""The test of the empty liner by a slow ramp of the vacuum: its collapse, and its own stiffness."""

import json
import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from grabberd.core.arrays import Array, Mask
from grabberd_liner.analysis.estimate import Estimate
from grabberd_liner.analysis.load.empty_ramp import LAW_SIGMA
from grabberd_liner.analysis.load.load_fit import MISFIT_ALARM
from grabberd_liner.chain.analysis.profile_inputs import Profile
from grabberd_liner.chain.guided_tests.outcome import (
    LINE,
    MARK,
    Check,
    Curve,
    Evidence,
    Offer,
    Outcome,
    Question,
    exact,
    findings_of,
)

_OPEN_KPA = 2.0
"""Greatest pressure difference of the first field: there every liner is open still."""
_FASTEST_KPA_PER_S = 2.0
"""A pressure difference that rises faster shows rubber that is stiffer than at rest.

Between buckling and touch lie 3 to 5 kPa, of which a wall then has less than some two seconds.
"""
_FASTEST_MM_PER_S = 30.0
"""Of the wall: .6 mm a field; a wall that jumps passes no states of rest."""
_LEAST_LEVELS = 10
_GAUGE_KPA = 0.35
"""σ of the pressure difference, of two gauges of .2 kPa each; .1 kPa is 1 % of the stiffness."""
_STIFFNESS_SHARE = 0.05
_LEAST_PRIOR = 0.1
"""Of its σ before: a ramp that says nothing new of a value has learnt this much at least."""
_NAMES = ("touch_kpa", "buckling_kpa", "stiffness_n_mm", "E_mpa", "wall_mm", "F0_n")
_PRIORS = {"E_mpa": "E_sigma_mpa", "wall_mm": "wall_sigma_mm", "F0_n": "F0_sigma_n"}
_SLOWER = "let the vacuum fall more slowly, slowest while the liner flattens, and capture again"

STARTS_OPEN = Question(
    "starts_open",
    "begins with the open liner",
    "give both chambers the same vacuum before the capture starts, and then let the pulsation chamber's fall",
    "kPa",
)
SLOW = Question("slow_enough", "pressure difference rises slowly", _SLOWER, "kPa/s")
CALM = Question("wall_slow_enough", "wall follows without a jump", _SLOWER, "mm/s")
BUCKLED = Question(
    "buckled",
    "liner buckles (CCPD)",
    "begin with the open liner, go slowest at 5 to 15 kPa, and capture again",
)
TOUCHED = Question(
    "reached_touch",
    "opposite walls touch (TPPD)",
    "go on until they have touched; take out teat or plug; turn the liner so that it flattens to the camera",
)
LEVELS = Question("levels_between", "fields between buckling and touch", _SLOWER)
GAUGE = Question(
    "gauge",
    "zero of the gauge is known",
    "calibrate the gauge (docs/howto/loggers.md), and state its σ",
    "kPa",
)
MISFIT = Question(
    "misfit",
    "points agree with the empty wall",
    "check the label of the liner, its ends and radius, the gauge, and that no teat or plug is in it",
    "1",
)
STIFFNESS = Question(
    "stiffness_sigma", "E·t³ is known well enough", "go slower between buckling and touch, with 8 bits", "%"
)


def ramp_test(one: Evidence) -> Outcome:
    """Judges a capture of a ramp."""
    checks = [*_course(one), *_collapse(one), *_values(one)]
    return Outcome(
        tuple(checks), findings_of(one, _NAMES), tuple(_curves(one)), _offer(one) if one.material else None
    )


def _course(one: Evidence) -> Iterator[Check]:
    course = _difference(one)
    if course is None:
        yield from (ask.not_checked("the vacuum is not known") for ask in (STARTS_OPEN, SLOW, CALM, GAUGE))
        return
    time_s, kpa, sigma_kpa = course
    yield STARTS_OPEN.at_most(Estimate.of(kpa[0], sigma_kpa[0]), _OPEN_KPA)
    low, high = _between(one, kpa)
    within = (kpa >= low) & (kpa <= high)
    speed = _speed(time_s, kpa, within)
    yield SLOW.at_most(exact(speed), _FASTEST_KPA_PER_S, f"it rises by {speed:.3g} kPa/s")
    moved = one.analysis.movement if one.analysis else None
    if moved is None:
        yield CALM.not_checked("the wall does not move as a whole")
    else:
        speed = float(np.percentile(moved.speed_mm_per_s(time_s[within]), 90)) if within.any() else math.nan
        yield CALM.at_most(exact(speed), _FASTEST_MM_PER_S)
    yield GAUGE.at_most(exact(float(np.median(sigma_kpa))), _GAUGE_KPA)


def _difference(one: Evidence) -> tuple[Array, Array, Array] | None:
    """Times of the fields, and the pressure difference at each with its σ."""
    if one.analysis is None or one.analysis.empty is None:
        return None
    return one.analysis.time_s, *one.analysis.empty.course.difference_kpa


def _between(one: Evidence, kpa: Array) -> tuple[float, float]:
    """Pressure differences between which the liner flattens, or all that there are."""
    ends = one.quantity("buckling_kpa"), one.quantity("touch_kpa")
    if ends[0] is None or ends[1] is None:
        return float(kpa.min()), float(kpa.max())
    return float(ends[0].value), float(ends[1].value)


def _speed(time_s: Array, kpa: Array, within: Mask) -> float:
    """Speed of the pressure difference, by a line through it: single readings are noisy."""
    if within.sum() < 2 or np.ptp(time_s[within]) == 0:
        return math.nan
    runs = np.split(np.flatnonzero(within), np.flatnonzero(np.diff(np.flatnonzero(within)) > 1) + 1)
    longest = max(runs, key=len)
    if len(longest) < 2:
        return math.inf
    return abs(float(np.polyfit(time_s[longest], kpa[longest], 1)[0]))


def _collapse(one: Evidence) -> Iterator[Check]:
    for ask, name in ((BUCKLED, "buckling_kpa"), (TOUCHED, "touch_kpa")):
        if one.analysis is None:
            yield ask.not_checked("the capture was not analysed")
        else:
            yield ask.answered(one.quantity(name) is not None, one.said(name, "reason"))
    course = _difference(one)
    if course is None or one.quantity("touch_kpa") is None or one.quantity("buckling_kpa") is None:
        yield LEVELS.not_checked("buckling and touch were not found")
        return
    low, high = _between(one, course[1])
    between = int(((course[1] > low) & (course[1] < high)).sum())
    yield LEVELS.at_least(exact(between), _LEAST_LEVELS, f"only {between} fields lie between them")


def _values(one: Evidence) -> Iterator[Check]:
    stiffness = one.quantity("stiffness_n_mm")
    priors = [_agreement(name) for name in _PRIORS]
    if stiffness is None:
        reason = one.said("stiffness_n_mm", "reason") or "the ramp gives no values of the liner"
        if one.analysis is None:
            yield MISFIT.not_checked(reason)
        else:
            yield MISFIT.answered(False, reason)
        yield from (ask.not_checked(reason) for ask in (STIFFNESS, *priors))
        return
    yield MISFIT.at_most(one.value("ramp", "load_misfit"), MISFIT_ALARM)
    share = 100 * float(stiffness.sigma) / float(stiffness.value)
    yield STIFFNESS.at_most(exact(share), 100 * _STIFFNESS_SHARE)
    for name, ask in zip(_PRIORS, priors, strict=True):
        yield _against_prior(one, name, ask)


def _agreement(name: str) -> Question:
    title, unit = {
        "E_mpa": ("modulus", "MPa"),
        "wall_mm": ("thickness", "mm"),
        "F0_n": ("mounting force", "N"),
    }[name]
    return Question(
        f"prior_{name}",
        f"{title} agrees with the profile",
        "check the liner's label, and how the profile's value was obtained; if it is old, accept the offer",
        unit,
    )


def _against_prior(one: Evidence, name: str, ask: Question) -> Check:
    found, material = one.quantity(name), one.material
    if found is None or material is None:
        return ask.not_checked("the ramp gives no values of the liner")
    before, sigma = getattr(material, name), getattr(material, _PRIORS[name])
    if not sigma:
        return ask.not_checked(f"the inputs take {name} for exact")
    # The prior is part of what was found: the two differ by what the ramp adds to it, and by the model's own
    # error, which is in σ and knows nothing of the prior.
    law = LAW_SIGMA[name] * float(found.value)
    of_fit_2 = float(found.sigma) ** 2 - law**2
    learnt = math.sqrt(max(sigma**2 - of_fit_2, (_LEAST_PRIOR * sigma) ** 2) + law**2)
    return ask.agrees(found, before, learnt)


def _offer(one: Evidence) -> Offer | None:
    """The liner's profile with the material that was found."""
    rows = one.tables["ramp"].column("material").tolist() if "ramp" in one.tables else []
    if one.liner is None or not rows or not rows[0]:
        return None
    return Offer(offered(one.liner, json.loads(rows[0]), one), one.liner.version)


def offered(liner: Profile, material: Mapping[str, Any], one: Evidence) -> dict[str, Any]:
    """The profile's content with another material, and how that was obtained."""
    said = f"ramp of {one.captured_utc[:10]}, capture {one.id}"
    obtained = {**(liner.content.get("obtained") or {}), **dict.fromkeys(_PRIORS, said)}
    obtained.setdefault("radius_mm", said)
    return {**liner.content, "material": dict(material), "obtained": obtained}


def _curves(one: Evidence) -> Iterator[Curve]:
    course = _difference(one)
    if course is None:
        return
    axes = (("pressure difference", "kPa"), ("distance of the wall's inner face from the middle", "mm"))
    assert one.analysis is not None
    assert one.analysis.empty is not None
    value, sigma = one.analysis.empty.course.height_mm
    order = np.argsort(course[1])
    order = order[np.isfinite(value[order])]
    if len(order):
        yield Curve("distance", "wall", axes, LINE, course[1][order], value[order], sigma[order])
    for name, title in (("buckling_kpa", "CCPD"), ("touch_kpa", "TPPD")):
        if (found := one.quantity(name)) is not None:
            x, sigma = (np.array([float(part)]) for part in found)
            yield Curve(name, title, axes, MARK, x, np.full(1, np.nan), sigma)
