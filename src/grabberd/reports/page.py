"""What every report is: one HTML page that needs nothing beside it, chapter by chapter."""

from collections.abc import Callable, Mapping, Sequence
from importlib.resources import files
from typing import Any

from grabberd.reports.markup import Html, element, joined

Content = Callable[[Mapping[str, Any]], Html]


def page(
    title: str,
    document: Mapping[str, Any],
    top: Html,
    chapters: Sequence[tuple[str, Content]],
    *bottom: Html,
) -> str:
    """The page: its top, the numbered chapters, and what stands below them."""
    written = [_chapter(number, *one, document) for number, one in enumerate(chapters, start=1)]
    body = element("body", element("main", top, *written, *bottom))
    return f"<!DOCTYPE html>\n{element('html', _head(title), body, lang='en')}\n"


def _head(title: str) -> Html:
    style = files(__package__).joinpath("style.css").read_text(encoding="utf-8")
    return element(
        "head",
        element("meta", charset="utf-8"),
        element("meta", name="viewport", content="width=device-width, initial-scale=1"),
        element("title", title),
        element("style", Html(style)),
    )


def _chapter(number: int, title: str, content: Content, document: Mapping[str, Any]) -> Html:
    return joined("\n", element("section", element("h2", f"{number} {title}"), content(document)))
