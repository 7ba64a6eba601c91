"""Tables as CSV (RFC 4180), part by part.

Spreadsheet programs take a text that begins with one of a few characters for a formula, and run it. Labels,
notes and reasons come from outside, so such a text gets an apostrophe in front; numbers stay as they are.
"""

import csv
import io
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from grabberd.core.chain.columns import Column, Rows

FORMULA = ("=", "+", "-", "@", "\t", "\r")
"""Beginnings of texts that a spreadsheet program would run."""


def cell(text: str) -> str:
    """A text as a cell that is text in every program."""
    return f"'{text}" if text.startswith(FORMULA) else text


def cells(row: Iterable[object]) -> list[object]:
    """A row of texts and numbers, its texts as such cells."""
    return [cell(one) if isinstance(one, str) else one for one in row]


def csv_text(columns: Sequence[Column], parts: Iterable[Rows]) -> Iterator[str]:
    """Text of a CSV file: the head, then the rows of each part; unknown values are empty."""
    yield _lines([[column.name for column in columns]])
    for rows in parts:
        yield _lines(zip(*(_texts(column, rows[column.name].tolist()) for column in columns), strict=True))


def _lines(rows: Iterable[Sequence[str]]) -> str:
    text = io.StringIO()
    csv.writer(text).writerows(rows)
    return text.getvalue()


def _texts(column: Column, values: list[Any]) -> list[str]:
    kind = column.dtype[0]
    if kind == "M":
        return ["" if one is None else f"{one.isoformat(timespec='milliseconds')}Z" for one in values]
    if kind == "f":
        return [format(one, column.csv_format) if one == one else "" for one in values]  # noqa: PLR0124 - NaN
    if kind == "U":
        return [cell(str(one)) for one in values]
    return [str(one) for one in values]
