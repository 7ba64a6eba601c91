"""Tables as CSV (RFC 4180), part by part."""

import csv
import io
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

from grabberd.processes.columns import Column, Rows


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
    return [str(one) for one in values]
