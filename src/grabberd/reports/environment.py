"""The Jinja2 environment of the reports: templates, filters for numbers and names, figures."""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache
from statistics import median
from types import ModuleType
from typing import Any, NamedTuple

from jinja2 import Environment, PackageLoader, StrictUndefined, pass_environment

from grabberd.reports import figures, names, numbers

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
    return {name: getattr(package, name) for name in package.__all__ if name.endswith("_svg")}


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
    known = [cell for cell in cells if cell != numbers.DASH]
    return bool(known) and all(map(_NUMBER.fullmatch, known))


_FILTERS: tuple[Callable[..., Any], ...] = (
    *(column, each, lookup, layout, median),
    *(numbers.fixed, numbers.significant, numbers.count, numbers.probability, numbers.p_value),
    *(names.symbol, names.unknown_name, names.label, names.utc_time, names.as_text),
)
