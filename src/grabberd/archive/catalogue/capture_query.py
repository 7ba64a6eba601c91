"""Questions for a list of captures: which of them, in which order, from where on; their conditions in SQL."""

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple, Self

from grabberd.errors import InputError

KEY = 64
"""Characters of a label that it is sorted by; captures with the same sort by their ids."""
LABEL = "label."
"""Before the name of a label, in the name of its order and of its facet."""
_NUMBER = re.compile(r"\d+")
SORTS = ("time", "length", "losses", "size")


class Position(NamedTuple):
    """Position of a capture in a sorted list: what it is sorted by, and its id."""

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
        """An order in the words of a client: "time", "-length", "label.cow".

        Raises:
            InputError: There is no such order.
        """
        by = text.removeprefix("-")
        if by.startswith(LABEL) and by != LABEL:
            return cls("label", text != by, by.removeprefix(LABEL))
        if by not in SORTS:
            hint = f"sort by {', '.join(SORTS)} or label.NAME; with a minus before it from the greatest down"
            raise InputError(f"captures cannot be sorted by {text!r}", hint)
        return cls(by, text != by)

    def position(self, key: str, own_id: str) -> Position:
        """A position in this order from the texts of a cursor.

        Raises:
            InputError: It is a position in another order.
        """
        if self.by in ("time", "label"):
            return Position(key, own_id)
        if not re.fullmatch(r"-?\d{1,18}", key):
            raise InputError(
                f"the cursor {key!r} is of a list in another order", "ask for the first page again"
            )
        return Position(int(key), own_id)


NEWEST_FIRST = Order()


@dataclass(frozen=True, slots=True)
class CaptureQuery:
    """Filter and order of a list of captures; None and nothing filter nothing.

    Attributes:
        limit: Maximum number of results.
        after: Position of the last capture on the page before; None for the first page.
        device: Name of the device.
        since_utc: Earliest start; ISO 8601 with milliseconds and Z.
        until_utc: Time before which the captures started.
        search: Words that each have to be in note or labels, or begin the id, ignoring case.
        pinned: True for pinned captures alone, False for the others alone.
        analysed: The same for those that have an analysis.
        measured: The same for those that have points.
        verdicts: One of these verdicts: complete, incomplete, damaged.
        calibrations: One of these ids of calibrations, with which the newest run was made.
        labels: For each name one of these values.
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
    """The key that a label is sorted by: ignoring case, and with cow 9 before cow 10."""
    return _NUMBER.sub(lambda found: found.group().zfill(8), value[:KEY].casefold())[:KEY]


class Condition(NamedTuple):
    """A condition on a row of the catalogue.

    Attributes:
        facet: The facet that it filters; empty for one that counts as none.
        sql: The condition, with marks for its values.
        values: These.
    """

    facet: str
    sql: str
    values: tuple[str | int, ...]


def plain_conditions(query: CaptureQuery) -> list[Condition]:
    """Conditions that every count obeys: the words that are searched for, and whether there are points."""
    # Not anywhere in an id: the number of a cow is part of many times.
    found = "instr(words, ?) > 0 OR instr(lower(id), ?) = 1"
    words = (Condition("", found, (word, word)) for word in (query.search or "").casefold().split())
    return [*words, *_flag("measured", query.measured)]


def conditions_of(query: CaptureQuery) -> list[Condition]:
    """Conditions of the facets, each of which the counts of its own facet leave aside."""
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
    """A mark for each value of a statement."""
    return ", ".join("?" for _ in values)
