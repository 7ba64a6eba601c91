"""The documents that reports are drawn from: their checks, their JSON, and the Jinja2 environment that writes
them as pages.
"""

import json
import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cache
from statistics import median
from types import ModuleType
from typing import Any, NamedTuple

from jinja2 import Environment, PackageLoader, StrictUndefined, pass_environment

from grabberd.errors import InputError
from grabberd.reports import figures, notation


class ReportForm(NamedTuple):
    """The form of the documents that a kind of report is drawn from.

    Attributes:
        schema: Name of their schema.
        needed: Parts that every report of this kind needs.
        command: The command that makes them.
    """

    schema: str
    needed: Sequence[str]
    command: str


CALIBRATION = ReportForm(
    "grabberd/calibration-report/1", ("id", "created_utc", "result", "views"), "calibrate … --report FILE"
)


def document_json(document: Mapping[str, Any]) -> str:
    """Write a document as JSON: one line for each part, keys sorted, so that equal documents are equal text.

    Raises:
        InputError: a number is not finite; the message names its key.
    """
    _check_finite(document)
    parts = (f"{_dumped(key)}: {_dumped(document[key])}" for key in sorted(document))
    return "{\n" + ",\n".join(parts) + "\n}\n"


def check_document(document: Mapping[str, Any], form: ReportForm) -> None:
    """Check that a report can be drawn from a document.

    Raises:
        InputError: it has another schema, lacks a part that every report of its kind needs, or has a number
            that is not finite.
    """
    hint = f"make the report again: grabberd {form.command}"
    if document.get("schema") != form.schema:
        raise InputError(f"the report's schema must be {form.schema!r}, not {document.get('schema')!r}", hint)
    if missing := [key for key in form.needed if not document.get(key)]:
        kind = form.schema.split("/")[1].replace("-", " ")
        raise InputError(f"the {kind} has no {', '.join(missing)}", hint)
    _check_finite(document)


def _check_finite(document: Mapping[str, Any]) -> None:
    if (where := next(_not_finite(document, ""), None)) is not None:
        raise InputError(
            f"the report's {where} is not a finite number", "write null for a value that is not known"
        )


def _not_finite(value: object, where: str) -> Iterator[str]:
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from _not_finite(inner, f"{where}.{key}".lstrip("."))
    elif isinstance(value, Sequence) and not isinstance(value, str):
        for index, inner in enumerate(value):
            yield from _not_finite(inner, f"{where}[{index}]")
    elif isinstance(value, float) and not math.isfinite(value):
        yield where


def _dumped(value: object) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False, sort_keys=True, separators=(", ", ": "))


_NUMBER = re.compile(r"(< |[+−])?\d+(\.\d+)?( × 10\S+)?( \(\S+\))?")
"""All that the filters make of numbers: "< 0.001", "+1", "1.2 × 10⁻⁵", "9.123 (0.020)"."""
_LONG = 24
"""Rows of a table that fit on half a page; longer ones may break across pages when printed."""


class Cell(NamedTuple):
    """A cell of a table with its class for the style sheet: "number" is set flush right."""

    text: str
    class_: str


class Layout(NamedTuple):
    """A table ready to be written row by row."""

    heads: Sequence[Cell]
    rows: Sequence[Sequence[Cell]]

    @property
    def is_long(self) -> bool:
        """True if the table has to be allowed to break across pages."""
        return len(self.rows) > _LONG


class DocumentEnvironment(Environment):
    """An environment in which a key that is missing from a document is the same as one that is null.

    Every part of a document may be null, so its templates ask `document.validation.rmse_mm` and get None
    where either is absent. Variables stay strict: a misspelt one is an error.
    """

    def render(self, template: str, document: Mapping[str, Any], **values: Any) -> str:
        """Write a report or one of its chapters: the same text for the same document and values."""
        written = self.get_template(template).render(document=document, **values)
        return written.strip() + "\n"  # the comment that opens a template leaves an empty line before it

    def getattr(self, obj: Any, attribute: str) -> Any:
        """Return `obj.attribute`; of a mapping its key, so that a key called "values" is not the method."""
        return _known(obj, attribute) if _is_part(obj) else super().getattr(obj, attribute)

    def getitem(self, obj: Any, argument: Any) -> Any:
        """Return `obj[argument]`."""
        return _known(obj, argument) if _is_part(obj) else super().getitem(obj, argument)


@cache
def environment() -> DocumentEnvironment:
    """Return the one environment, which keeps the templates it has compiled."""
    made = DocumentEnvironment(
        loader=PackageLoader("grabberd.reports"),
        autoescape=True,
        undefined=StrictUndefined,
        lstrip_blocks=True,
        # trim_blocks would join the words before and after a line that ends with {% endif %}.
        trim_blocks=False,
    )
    made.filters.update({written.__name__: written for written in _FILTERS})
    made.globals.update(figures_in(figures), has_samples=figures.has_samples)
    return made


def figures_in(package: ModuleType) -> dict[str, Any]:
    """The functions of a package that draw, by name."""
    return {name: one for name, one in vars(package).items() if name.endswith("_svg")}


@pass_environment
def column(
    environment: Environment, rows: Iterable[Any], path: str, written: str = "", *digits: int
) -> list[Any]:
    """Take one key ("tau_x", "center_mm.0") of every row, and write it with a filter if one is named."""
    found = []
    for row in rows:
        value = row
        for key in path.split("."):
            value = environment.getitem(value, int(key) if key.isdigit() else key)
        found.append(environment.call_filter(written, value, digits) if written else value)
    return found


def each(rows: Iterable[Any], macro: Callable[[Any], str]) -> list[str]:
    """Write a cell for every row with a macro."""
    return [macro(row).strip() for row in rows]


def lookup(keys: Iterable[str], known: Mapping[str, Any] | None) -> list[Any]:
    """Take the values of these keys; None for those that are not known."""
    return [(known or {}).get(key) for key in keys]


def layout(columns: Sequence[tuple[str, Iterable[Any]]]) -> Layout:
    """Turn columns, each with its head, into rows; the first column names the rows.

    A column is set flush right if all that is known in it is numbers.
    """
    heads = [head for head, _ in columns]
    cells = [[_text(cell) for cell in values] for _, values in columns]
    classes = ["", *("number" if _is_numeric(values) else "" for values in cells[1:])]
    rows = [[*map(Cell, row, classes)] for row in zip(*cells, strict=True)]
    return Layout([*map(Cell, heads, classes)], rows)


def _is_part(value: object) -> bool:
    return value is None or isinstance(value, Mapping)


def _known(part: Mapping[str, Any] | None, key: str) -> Any:
    return None if part is None else part.get(key)


def _text(cell: object) -> str:
    return cell if isinstance(cell, str) else str(cell)


def _is_numeric(cells: Sequence[str]) -> bool:
    known = [cell for cell in cells if cell != notation.DASH]
    return bool(known) and all(map(_NUMBER.fullmatch, known))


_FILTERS: tuple[Callable[..., Any], ...] = (
    *(column, each, lookup, layout, median),
    *(notation.fixed, notation.significant, notation.count, notation.probability, notation.p_value),
    *(notation.symbol, notation.unknown_name, notation.label, notation.utc_time, notation.as_text),
)
