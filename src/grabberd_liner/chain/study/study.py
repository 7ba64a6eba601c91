"""The study: each quantity by itself, over the captures that have it."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.errors import InputError
from grabberd_liner.analysis.study.comparison import Comparison, compare
from grabberd_liner.analysis.study.observations import Levels, Observations, levels_of, observations
from grabberd_liner.analysis.study.trend import Trend, trend
from grabberd_liner.chain.study.studied import ALL, DATE, LeftOut, Meaning, Studied, natural
from grabberd_liner.chain.study.study_question import StudyQuestion, placed

Array = NDArray[np.float64]
_MILKING = "milking"


class QuantityStudy(NamedTuple):
    """A quantity over the captures.

    Attributes:
        name: as in the analyses.
        meaning: title and definition.
        unit: "1" for a ratio.
        groups: names of the groups that have values, in order; those of `comparison` and `trend`.
        captures: indices of the captures that have a value, and `group` of each.
        group: see there.
        place: where each is on the axis of the trend; NaN without one.
        observed: their values.
        comparison: of the groups.
        trend: over the places; None without one, or if no group has two places.
        remarks: remarks.
    """

    name: str
    meaning: Meaning
    unit: str
    groups: tuple[str, ...]
    captures: tuple[int, ...]
    group: tuple[int, ...]
    place: tuple[float, ...]
    observed: Observations
    comparison: Comparison
    trend: Trend | None
    remarks: tuple[str, ...]


class Study(NamedTuple):
    """A study: its question, the captures that take part, the groups, the quantities, and what is missing."""

    question: StudyQuestion
    captures: tuple[Studied, ...]
    groups: tuple[str, ...]
    quantities: tuple[QuantityStudy, ...]
    left_out: tuple[LeftOut, ...]
    remarks: tuple[str, ...]

    @property
    def origin(self) -> float:
        """Place at which the axis of the trend is shown to begin: for days, that of the first capture."""
        if self.question.over != DATE or not self.captures:
            return 0.0
        return math.floor(min(map(self.question.place, self.captures)))


def make_study(
    question: StudyQuestion,
    captures: Sequence[Studied],
    left_out: Sequence[LeftOut] = (),
    progress: Callable[[float], None] = lambda _: None,
) -> Study:
    """Study captures.

    Args:
        question: the question.
        captures: those that were found, each once.
        left_out: what could not be taken, and why.
        progress: called with the share that is done.

    Raises:
        InputError: no capture has one of the wanted quantities.
    """
    taken, lacking = placed(question, captures)
    taken.sort(key=lambda one: (one.captured_utc, one.id))
    missing = [*left_out, *lacking]
    names = _names(taken, question.quantities)
    quantities: list[QuantityStudy] = []
    for number, name in enumerate(names):
        studied, without = _studied(question, taken, name)
        missing += without
        if studied is not None:
            quantities.append(studied)
        progress((number + 1) / len(names))
    groups = natural(_group(question, one) for one in taken)
    remarks = _remarks(question, taken)
    return Study(question, tuple(taken), tuple(groups), tuple(quantities), tuple(missing), tuple(remarks))


def _names(captures: Sequence[Studied], wanted: Sequence[str]) -> list[str]:
    """Quantities in the order of the analyses: the wanted ones, or those that any capture has a value of."""
    known = dict.fromkeys(name for one in captures for name in one.found)
    if unknown := [name for name in wanted if name not in known]:
        raise InputError(
            f"no capture has the quantity {', '.join(unknown)}", f"choose from: {', '.join(known) or 'none'}"
        )
    if wanted:
        return [name for name in known if name in wanted]
    return [
        name
        for name in known
        if any(name in one.found and math.isfinite(one.found[name].value) for one in captures)
    ]


def _group(question: StudyQuestion, capture: Studied) -> str:
    return ALL if question.by is None else capture.value_of(question.by)


def _studied(
    question: StudyQuestion, captures: Sequence[Studied], name: str
) -> tuple[QuantityStudy | None, list[LeftOut]]:
    """A quantity, or None if no capture has it; and the captures that lack it."""
    known = [one.found[name] for one in captures if name in one.found]
    unit = next((one.unit for one in known if math.isfinite(one.value)), "")
    left_out, rows = [], []
    for row, capture in enumerate(captures):
        if reason := _lack(capture, name, unit):
            left_out.append(LeftOut(capture.id, name, reason))
        else:
            rows.append(row)
    if not rows:
        return None, left_out
    of_rows = [captures[row] for row in rows]
    groups = natural(_group(question, one) for one in of_rows)
    group = np.array([groups.index(_group(question, one)) for one in of_rows])
    observed = _observed(of_rows, name, group)
    place = np.array([question.place(one) for one in of_rows])
    unit_levels, blocks = _levels(question.unit, of_rows), _levels(question.within, of_rows)
    at = np.isfinite(place)
    if question.over is not None:
        reason = f"it has no number as {question.over}; it takes part in the comparison, not in the trend"
        left_out += [LeftOut(one.id, name, reason) for one, has in zip(of_rows, at, strict=True) if not has]
    meaning = next((one.meanings[name] for one in of_rows if name in one.meanings), Meaning(name, ""))
    studied = QuantityStudy(
        name,
        meaning,
        unit,
        tuple(groups),
        tuple(rows),
        tuple(group.tolist()),
        tuple(place.tolist()),
        observed,
        compare(observed, group, unit_levels, blocks),
        _trend(observed, place, group, (unit_levels, blocks)),
        tuple(_quantity_remarks(of_rows, name)),
    )
    return studied, left_out


def _lack(capture: Studied, name: str, unit: str) -> str:
    """Reason why a capture has no value of a quantity; empty if it has."""
    found = capture.found.get(name)
    if found is None:
        return "its analysis, of another version, has no such quantity: analyse it again"
    if not math.isfinite(found.value):
        return found.reason or "nothing was found"
    return "" if found.unit == unit else f"its unit is {found.unit!r}, not {unit!r}: analyse it again"


def _observed(captures: Sequence[Studied], name: str, group: Levels) -> Observations:
    found = [one.found[name] for one in captures]
    sigma = np.array([one.sigma for one in found])
    common = np.array([np.nan if one.common is None else one.common for one in found])
    # Captures of which nothing tells the liner share with their group: averaging must not lessen it.
    shares = [one.liner or ("", int(level)) for one, level in zip(captures, group, strict=True)]
    return observations(np.array([one.value for one in found]), sigma, common, shares)


def _levels(key: str | None, captures: Sequence[Studied]) -> Levels | None:
    return None if key is None else levels_of([one.value_of(key) for one in captures])


def _trend(
    observed: Observations, place: Array, group: Levels, levels: tuple[Levels | None, Levels | None]
) -> Trend | None:
    """The trend of those that have a place; None if no group has two different ones."""
    at = np.isfinite(place)
    has_line = [np.ptp(place[at & (group == one)]) > 0 for one in np.unique(group[at])]
    if not any(has_line):
        return None
    unit, block = (None if one is None else one[at] for one in levels)
    # Groups without a place have no trend, but keep their number.
    present = np.unique(group[at])
    found = trend(observed.taken(at), place[at], np.searchsorted(present, group[at]), unit, block)
    slopes = [
        found.slopes[int(np.searchsorted(present, one))] if one in present else None
        for one in range(int(group.max()) + 1)
    ]
    return found._replace(slopes=tuple(slopes))


def _quantity_remarks(captures: Sequence[Studied], name: str) -> list[str]:
    found = [one.found[name] for one in captures]
    untold = sum(one.common is None for one in found)
    unknown = sum(not math.isfinite(one.sigma) for one in found)
    remarks = []
    if untold:
        remarks.append(
            f"{untold} of {len(found)} analyses do not tell which part of σ captures share: what is worse "
            "counts, that they share all of it or none; analyse these captures again"
        )
    if unknown:
        remarks.append(f"{unknown} of {len(found)} values have no σ; only their scatter counts")
    return remarks


def _remarks(question: StudyQuestion, captures: Sequence[Studied]) -> list[str]:
    remarks = []
    tests = natural(one.labels["test"] for one in captures if one.labels.get("test"))
    if len(tests) > 1:
        remarks.append(
            f"the captures are of different tests, {', '.join(tests)}: to study one kind alone, add a "
            f"condition such as test={_MILKING}"
        )
    unknown = sum(not one.liner for one in captures)
    if unknown:
        remarks.append(
            f"nothing tells the liner of {unknown} of {len(captures)} captures: within a group they are "
            "taken to share the common part of σ, between groups they are not"
        )
    return remarks
