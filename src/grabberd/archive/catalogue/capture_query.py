"""Queries for lists of captures: filter, order and page, and their conditions in SQL."""

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple, Self

from grabberd.errors import InputError

KEY = 64
"""Length of the sort key of a label; captures with equal keys are sorted by id."""
LABEL = "label."
"""Prefix of a label's name in the name of its order and of its facet."""
_NUMBER = re.compile(r"\d+")
SORTS = ("time", "length", "losses", "size")


class Position(NamedTuple):
    """Position of a capture in a sorted list: its sort key and id."""

    key: str | int
    id: str


class Order(NamedTuple):
    """Order of a list.

    Attributes:
        by: One of `SORTS`, or "label".
        descending: True for the newest, longest or greatest first.
        label: Name of the label.
    """

    by: str = "time"
    descending: bool = True
    label: str = ""

    @classmethod
    def of(cls, text: str) -> Self:
        """Parses an order: "time", "-length", "label.cow".

        Raises:
            InputError: The order is unknown.
        """
        by = text.removeprefix("-")
        if by.startswith(LABEL) and by != LABEL:
            return cls("label", text != by, by.removeprefix(LABEL))
        if by not in SORTS:
            hint = f"sort by {', '.join(SORTS)} or label.NAME; with a minus before it from the greatest down"
            raise InputError(f"captures cannot be sorted by {text!r}", hint)
        return cls(by, text != by)

    def position(self, key: str, own_id: str) -> Position:
        """Parses a position in this order from the parts of a cursor.

        Raises:
            InputError: The cursor belongs to another order.
        """
        if self.by in ("time", "label"):
            return Position(key, own_id)
        if not re.fullmatch(r"-?\d{1,18}", key):
            raise InputError(
                f"the cursor {key!r} belongs to a list in another order", "ask for the first page again"
            )
        return Position(int(key), own_id)


NEWEST_FIRST = Order()


@dataclass(frozen=True, slots=True)
class CaptureQuery:
    """Filter and order of a list of captures; None and empty values do not filter.

    Attributes:
        limit: Maximum number of results.
        after: Position of the last capture on the page before; None for the first page.
        device: Name of the device.
        since_utc: Earliest start; ISO 8601 with milliseconds and Z.
        until_utc: Time before which the captures started.
        search: Words, each contained in note or labels or a prefix of the id, ignoring case.
        pinned: True for pinned captures only, False for the others only.
        analysed: Likewise for captures with an analysis.
        measured: Likewise for captures with points.
        verdicts: Any of these verdicts: complete, incomplete, damaged.
        calibrations: Any of these ids for the calibration of the newest run.
        labels: For each name, any of these values.
        order: Order of the list.
    """

    limit: int = 100
    after: Position | None = None
    device: str | None = None
    since_utc: str | None = None
    until_utc: str | None = None
    search: str | None = None
    pinned: bool | None = None
    analysed: bool | None = None
    measured: bool | None = None
    verdicts: tuple[str, ...] = ()
    calibrations: tuple[str, ...] = ()
    labels: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    order: Order = NEWEST_FIRST


def sort_key(value: str) -> str:
    """The sort key of a label: ignores case, and puts cow 9 before cow 10."""
    return _NUMBER.sub(lambda found: found.group().zfill(8), value[:KEY].casefold())[:KEY]


class Condition(NamedTuple):
    """A condition on a row of the catalogue.

    Attributes:
        facet: The facet that it filters; empty for a condition that belongs to none.
        sql: The condition, with placeholders for its values.
        values: The values.
    """

    facet: str
    sql: str
    values: tuple[str | int, ...]


def plain_conditions(query: CaptureQuery) -> list[Condition]:
    """Conditions that apply to all counts: the search words, and whether there are points."""
    # Only as a prefix of the id: the number of a cow may occur anywhere in the time.
    found = "instr(words, ?) > 0 OR instr(lower(id), ?) = 1"
    words = (Condition("", found, (word, word)) for word in (query.search or "").casefold().split())
    return [*words, *_flag("measured", query.measured)]


def conditions_of(query: CaptureQuery) -> list[Condition]:
    """Conditions on facets, each of which is ignored when counting the values of its own facet."""
    return [
        *_among("device", () if query.device is None else (query.device,)),
        *_among("verdict", query.verdicts),
        *_flag("pinned", query.pinned),
        *_flag("analysed", query.analysed),
        *_among("calibration", query.calibrations),
        *_day(query),
        *(_label(name, values) for name, values in query.labels.items()),
    ]


def _among(column: str, values: tuple[str, ...]) -> Iterator[Condition]:
    if values:
        yield Condition(column, f"{column} IN ({marks(values)})", values)


def _flag(column: str, value: bool | None) -> Iterator[Condition]:
    if value is not None:
        yield Condition(column, f"{column} = ?", (int(value),))


def _day(query: CaptureQuery) -> Iterator[Condition]:
    bounds = (("created_utc >= ?", query.since_utc), ("created_utc < ?", query.until_utc))
    given = [(sql, value) for sql, value in bounds if value is not None]
    if given:
        yield Condition("day", " AND ".join(sql for sql, _ in given), tuple(value for _, value in given))


def _label(name: str, values: tuple[str, ...]) -> Condition:
    sql = f"""row IN (SELECT row FROM labels JOIN pairs USING (pair)
        WHERE name = ? AND value IN ({marks(values)}))"""  # noqa: S608 - marks
    return Condition(f"{LABEL}{name}", sql, (name, *values))


def marks(values: Iterable[object]) -> str:
    """Placeholders for the values of a statement."""
    return ", ".join("?" for _ in values)
