"""The conditions of a question about captures in SQL: one for each facet, and those that are none."""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from grabberd.archive.state.capture_query import CaptureQuery

LABEL = "label."
"""Before the name of a label, in the name of its facet."""


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
        yield Condition(column, f"{column} IN ({_marks(values)})", values)


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
        WHERE name = ? AND value IN ({_marks(values)}))"""  # noqa: S608 - marks
    return Condition(f"{LABEL}{name}", sql, (name, *values))


def _marks(values: Iterable[str]) -> str:
    return ", ".join("?" for _ in values)
