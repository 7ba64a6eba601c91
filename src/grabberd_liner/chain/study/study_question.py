"""The question of a study: what is compared with what, and over what."""

import math
from collections.abc import Sequence
from datetime import datetime
from typing import NamedTuple

from grabberd_liner.chain.study.studied import DATE, ID, LeftOut, Studied

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
