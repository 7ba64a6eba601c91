"""The same liner over months: what its quantities do over its milkings."""

import math
from collections.abc import Iterator, Sequence
from datetime import datetime
from typing import NamedTuple

import numpy as np

from grabberd.core.arrays import Array
from grabberd_liner.analysis.comparison import Line, straight_line
from grabberd_liner.analysis.estimate import Estimate, Finding, Quantity
from grabberd_liner.analysis.mixed_model import observations
from grabberd_liner.chain.guided_tests.outcome import (
    FAILED,
    LINE,
    PASSED,
    POINTS,
    Check,
    Curve,
    Evidence,
    Outcome,
    Question,
)
from grabberd_liner.chain.guided_tests.recipes import MILKINGS

_LEAST = 3
_MOST_CHANGE = 0.10
"""Of a quantity over the span: twice what a ramp tells of a stiffness."""
_NAMES = (
    "touch_kpa",
    "buckling_kpa",
    "stiffness_n_mm",
    "liner_compression_mean_kpa",
    "teat_load_n",
    "stroke_mm",
    "liner_closing_s",
)
_PER_MILKINGS, _PER_DAYS = 1000.0, 100.0
_CHANGED = {PASSED: "not changed", FAILED: "changed"}

CAPTURES = Question(
    "captures", "captures of one liner", "choose three captures of the same liner at the least"
)
ONE_LINER = Question("one_liner", "all of the same liner", "leave out the captures of other liners")


class _Ages(NamedTuple):
    """Ages of the liner at the captures: `age` in units of `step`, such as 1000 milkings."""

    age: Array
    title: str
    unit: str
    step: float
    per: str


class _Series(NamedTuple):
    """A quantity of the captures that have it."""

    quantity: Quantity
    age: Array
    value: Array
    sigma: Array
    line: Line


def wear_test(captures: Sequence[Evidence]) -> Outcome:
    """Judges captures of a liner, the oldest first."""
    liners = {one.labels.get("liner") for one in captures}
    named = ", ".join(sorted(str(one) for one in liners))
    checks = [
        CAPTURES.answered(len(captures) >= _LEAST, f"there are {len(captures)}", f"at least {_LEAST}"),
        ONE_LINER.answered(len(liners) == 1 and None not in liners, f"they are labelled {named}"),
    ]
    ages = _ages(captures)
    findings: list[Finding] = []
    curves: list[Curve] = []
    for name in _NAMES:
        ask = _unchanged(name, captures)
        series = _series(captures, name, ages)
        if series is None:
            checks.append(ask.not_checked(f"fewer than {_LEAST} captures of different age have it"))
            continue
        check = _judged(ask, series)
        checks.append(check)
        findings.append(_finding(series, ages, check))
        curves += _curves(series, ages)
    return Outcome(tuple(checks), tuple(findings), tuple(curves))


def _ages(captures: Sequence[Evidence]) -> _Ages:
    """Ages by milkings if every capture says them: its label, or its liner's profile; else by days."""
    known = np.array([_milkings(one) for one in captures])
    if np.isfinite(known).all() and len(np.unique(known)) > 1:
        return _Ages(known, "milkings", "1", _PER_MILKINGS, "1000 milkings")
    dates = [datetime.fromisoformat(one.captured_utc).timestamp() / 86400 for one in captures]
    return _Ages(np.array(dates) - min(dates, default=0.0), "days", "d", _PER_DAYS, "100 days")


def _milkings(one: Evidence) -> float:
    if MILKINGS in one.labels or one.liner is None:
        return one.labelled(MILKINGS)
    age = one.liner.content.get("age_milkings")
    return math.nan if age is None else float(age)


def _unchanged(name: str, captures: Sequence[Evidence]) -> Question:
    title = next((text for one in captures if (text := one.said(name, "title"))), name)
    remedy = "compare with a new liner of the same type, and replace it if the difference matters"
    return Question(f"{name}_unchanged", f"{title}: unchanged", remedy, "%")


def _series(captures: Sequence[Evidence], name: str, ages: _Ages) -> _Series | None:
    rows = [
        (at, one, found) for at, one in zip(ages.age, captures, strict=True) if (found := one.quantity(name))
    ]
    if len(rows) < _LEAST or len({at for at, _, _ in rows}) < 2:
        return None
    _, first, _ = rows[0]
    texts = [first.said(name, column) for column in ("title", "unit", "definition", "source")]
    age = np.array([at for at, _, _ in rows]) / ages.step
    value, sigma = (np.array([float(found[part]) for _, _, found in rows]) for part in (0, 1))
    common = np.array([one.common(name) for _, one, _ in rows])
    # What a version of the profile errs by is common to the captures that were analysed with it.
    shares = [None if one.liner is None else one.liner.version for _, one, _ in rows]
    line = straight_line(observations(value, sigma, common, shares), age)
    return _Series(Quantity(name, *texts), age, value, sigma, line)


def _judged(ask: Question, series: _Series) -> Check:
    line, span = series.line, float(np.ptp(series.age))
    start = line.offset.value + line.slope.value * float(series.age.min())
    change = 100 * line.slope.value * span / abs(start) if start else math.nan
    sigma = 100 * line.slope.sigma * span / abs(start) if start else math.nan
    return ask.within(Estimate.of(change, sigma), 0.0, 100 * _MOST_CHANGE)


def _finding(series: _Series, ages: _Ages, check: Check) -> Finding:
    of, slope = series.quantity, series.line.slope
    name = f"{of.name}_per_{ages.per.replace(' ', '_')}"
    definition = f"Change of {of.title} per {ages.per}, by a straight line."
    quantity = Quantity(name, f"{of.title} per {ages.per}", of.unit, definition, of.source)
    verdict = _CHANGED.get(check.verdict, "not certain")
    return Finding(quantity, slope.value, slope.sigma, verdict=verdict, common=slope.common)


def _curves(series: _Series, ages: _Ages) -> Iterator[Curve]:
    of = series.quantity
    axes = ((ages.title, ages.unit), (of.title, of.unit))
    age = series.age * ages.step
    yield Curve(of.name, "captures", axes, POINTS, age, series.value, series.sigma)
    ends = np.array([series.age.min(), series.age.max()])
    y = series.line.offset.value + series.line.slope.value * ends
    yield Curve(f"{of.name}_line", "trend", axes, LINE, ends * ages.step, y, np.full(2, np.nan))
