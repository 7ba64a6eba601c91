"""A study: the captures that it takes, its question, that is what is compared with what and over what, and
each quantity by itself over the captures that have it.
"""

import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from datetime import datetime
from typing import NamedTuple

import numpy as np

from grabberd.core.arrays import Array
from grabberd.errors import InputError
from grabberd_liner.analysis.comparison import Comparison, Trend, compare, trend
from grabberd_liner.analysis.mixed_model import Levels, Observations, levels_of, observations

DEVICE, DATE, ID, VERDICT = "device", "date", "id", "verdict"
"""Names of what a capture has beside its labels."""
ALL = "all"
"""The only group of a study without groups."""


class Found(NamedTuple):
    """A quantity in an analysis.

    Attributes:
        unit: "1" for a ratio.
        value: in that unit; NaN if nothing was found.
        sigma: one standard deviation; NaN if it is not known.
        common: part of it that captures of the same liner share; None if the analysis does not tell.
        reason: why nothing was found.
    """

    unit: str
    value: float
    sigma: float
    common: float | None
    reason: str


class Meaning(NamedTuple):
    """Title and definition of a quantity; empty if the analysis does not tell."""

    title: str
    definition: str


class Studied(NamedTuple):
    """A capture with its newest analysis.

    Attributes:
        id: of the capture.
        captured_utc: its start.
        device: name of its device; empty if that is not known.
        verdict: complete or incomplete; empty if that is not known.
        labels: those it has today, or those of its analysis.
        liner: the liner it was analysed for: a version of its profile, its label, or its material; captures
            of the same liner share the common part of σ. Empty if nothing tells.
        analysis: number of the analysis, or the folder that it is in.
        analysed_utc: when it was made.
        found: the quantities by name, in their order.
        meanings: of them, where they are known.
    """

    id: str
    captured_utc: str
    device: str
    verdict: str
    labels: Mapping[str, str]
    liner: str
    analysis: str
    analysed_utc: str
    found: Mapping[str, Found]
    meanings: Mapping[str, Meaning]

    def value_of(self, key: str) -> str:
        """Value of a capture under a name: its device, day, id, verdict or a label; empty if it has none."""
        known = {
            DEVICE: self.device,
            DATE: self.captured_utc[:10],
            ID: self.id,
            VERDICT: self.verdict,
        }
        return known[key] if key in known else self.labels.get(key, "")


def unanalysed(
    capture_id: str, captured_utc: str, device: str, verdict: str = "", *, labels: Mapping[str, str]
) -> Studied:
    """A capture before anything is known of its analysis."""
    return Studied(capture_id, captured_utc, device, verdict, labels, "", "", "", {}, {})


class LeftOut(NamedTuple):
    """A capture that a study does without, or one of its quantities, and why."""

    capture: str
    quantity: str
    reason: str


def natural(names: Iterable[str]) -> list[str]:
    """Names in the order in which people count: 2 before 10."""
    return sorted(set(names), key=_parts)


def _parts(name: str) -> list[tuple[int, int, str]]:
    parts = re.split(r"(\d+)", name)
    return [(0, int(part), part) if part.isdecimal() else (1, 0, part.casefold()) for part in parts if part]


_DAY_S = 86_400.0
_FARTHEST = 1e9
"""Numbers of labels beyond are no milkings, days, or anything else that was counted or measured."""


class StudyQuestion(NamedTuple):
    """The question.

    Attributes:
        by: what makes groups: a label, device or date; None: all captures are one group.
        within: what has several groups, so that they are compared within it.
        unit: what counts as one independent replicate; None: a capture, or with `within` that in its group.
        over: what the trend runs over: a label with numbers, or date; None: no trend.
        quantities: names of the wanted ones; empty: all.
    """

    by: str | None = None
    within: str | None = None
    unit: str | None = None
    over: str | None = None
    quantities: Sequence[str] = ()

    @property
    def over_unit(self) -> str:
        """Unit that a slope is per; empty without a trend."""
        if self.over == DATE:
            return "d"
        return "milking" if self.over == "milkings" else self.over or ""

    @property
    def needed(self) -> tuple[str, ...]:
        """Names of what every capture needs to take part."""
        return tuple(one for one in (self.by, self.within, self.unit) if one is not None and one != ID)

    def place(self, capture: Studied) -> float:
        """Place of a capture on the axis of the trend, days from 1970 on; NaN if nothing tells."""
        if self.over is None:
            return math.nan
        if self.over == DATE:
            return datetime.fromisoformat(capture.captured_utc).timestamp() / _DAY_S
        try:
            place = float(capture.value_of(self.over).replace(",", "."))
        except ValueError:
            return math.nan
        return place if abs(place) < _FARTHEST else math.nan


def placed(question: StudyQuestion, captures: Sequence[Studied]) -> tuple[list[Studied], list[LeftOut]]:
    """The captures that take part, and those that lack what the question asks for."""
    taken, left_out = [], []
    for capture in captures:
        lacking = [name for name in question.needed if not capture.value_of(name)]
        if lacking:
            reason = f"it has no {' and no '.join(lacking)}"
            left_out.append(LeftOut(capture.id, "", reason))
        else:
            taken.append(capture)
    return taken, left_out


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
