"""HTML that is safe by construction: every string is escaped unless it is `Html` already."""

import re
from collections.abc import Iterable, Sequence
from html import escape

from grabberd.reports.numbers import UNKNOWN

_LONG = 24
_VOID = frozenset({"meta", "br", "hr"})
_NUMBER = re.compile(r"(< |[+−])?\d+(\.\d+)?( × 10\S+)?( \(\S+\))?")


class Html(str):
    """Text that is markup already."""

    __slots__ = ()


def text(value: object) -> Html:
    """A value as markup: escaped, or as it is if it is `Html`."""
    return value if isinstance(value, Html) else Html(escape(str(value), quote=True))


def joined(*parts: object) -> Html:
    """Parts one after the other."""
    return Html("".join(text(part) for part in parts))


def element(tag: str, *children: object, **attributes: object) -> Html:
    """An element; attributes in Python's spelling (`class_`, `aria_label`), those that are None left out."""
    given = "".join(
        f' {name.rstrip("_").replace("_", "-")}="{escape(str(value), quote=True)}"'
        for name, value in attributes.items()
        if value is not None
    )
    if tag in _VOID:
        return Html(f"<{tag}{given}>")
    return Html(f"<{tag}{given}>{joined(*children)}</{tag}>")


def paragraph(*children: object, class_: str | None = None) -> Html:
    """A paragraph."""
    return element("p", *children, class_=class_)


def absent(sentence: str) -> Html:
    """What is said where a part of the document is null."""
    return paragraph(sentence, class_="absent")


def items(values: Iterable[object]) -> Html:
    """A bulleted list."""
    return element("ul", *(element("li", value) for value in values))


def figure(svg: Html, *caption: object) -> Html:
    """A drawing with its caption."""
    return element("figure", svg, element("figcaption", *caption))


def table(
    caption: object, heads: Sequence[object], rows: Sequence[Sequence[object]], class_: str | None = None
) -> Html:
    """A table whose first column names its rows; columns of numbers are set flush right.

    Args:
        caption: what the table says.
        heads: one for each column.
        rows: as many cells each; the first is the row's head.
        class_: for the style sheet; tables of more than a page's half are "long" as well.
    """
    columns = [[str(row[index]) for row in rows] for index in range(len(heads))]
    aligned = [None, *("number" if _is_numeric(column) else None for column in columns[1:])]
    head = element(
        "tr", *(element("th", h, scope="col", class_=a) for h, a in zip(heads, aligned, strict=True))
    )
    body = [_row(row, aligned) for row in rows]
    names = " ".join(name for name in (class_, "long" if len(rows) > _LONG else None) if name)
    parts = element("caption", caption), element("thead", head), element("tbody", *body)
    return element("table", *parts, class_=names or None)


def facts(caption: object, rows: Sequence[tuple[object, object]]) -> Html:
    """A table of two columns, what and how much; without column heads."""
    body = [element("tr", element("th", name, scope="row"), element("td", value)) for name, value in rows]
    return element("table", element("caption", caption), element("tbody", *body), class_="facts")


def _is_numeric(column: Sequence[str]) -> bool:
    known = [cell for cell in column if cell != UNKNOWN]
    return bool(known) and all(map(_NUMBER.fullmatch, known))


def _row(cells: Sequence[object], aligned: Sequence[str | None]) -> Html:
    first, rest = cells[0], list(zip(cells[1:], aligned[1:], strict=True))
    return element(
        "tr", element("th", first, scope="row"), *(element("td", cell, class_=align) for cell, align in rest)
    )
