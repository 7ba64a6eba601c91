"""A page as a reader finds it: its elements, tables by caption, figures and text."""

import re
from collections import deque
from collections.abc import Mapping
from html.parser import HTMLParser
from itertools import islice
from typing import Any

from jinja2 import Environment
from jinja2.runtime import Context

VOID = {"meta", "br", "hr"}


def folded(text: str) -> str:
    """As a browser shows it: line ends and indents are spaces, those that do not break stay."""
    return re.sub(r"[ \n]+", " ", text)


def chapters_left_out(environment: Environment, report: str) -> list[str]:
    """Chapters that a report has, or the template it extends, and that its list of chapters does not name."""
    assert environment.loader is not None
    source, _, _ = environment.loader.get_source(environment, f"{report}.html.jinja")
    named = {"title", "content", "head", *re.findall(r'", "(\w+)"\)', source)}
    return sorted(_context(environment, report).blocks.keys() - named)


def chapter(environment: Environment, report: str, name: str, values: Mapping[str, Any]) -> "Page":
    """One chapter of a report alone."""
    context = _context(environment, report, **values)
    return Page("".join(context.blocks[name][0](context)))


def _context(environment: Environment, report: str, **values: Any) -> Context:
    """What the chapters of a report see once its template is open, which is where it imports macros."""
    template = environment.get_template(f"{report}.html.jinja")
    context = template.new_context(values)
    deque(
        islice(template.root_render_func(context), 2), maxlen=0
    )  # the line end before its imports, and one more
    return context


class Page(HTMLParser):
    """Parses a page and refuses one whose elements do not close in order."""

    def __init__(self, page: str) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.tables: dict[str, list[list[str]]] = {}
        self.captions: list[str] = []
        self.headings: list[str] = []
        self.text = ""
        self._rows: list[list[str]] = []
        self._caption = ""
        self.feed(page)
        self.close()
        assert not self.open, f"never closed: {self.open}"
        self.text = folded(self.text)
        self.captions = [folded(caption).strip() for caption in self.captions]

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag in VOID:
            return
        self.open.append(tag)
        if tag == "table":
            self._rows, self._caption = [], ""
        elif tag == "tr":
            self._rows.append([])
        elif tag in {"td", "th"}:
            self._rows[-1].append("")
        elif tag == "figcaption":
            self.captions.append("")
        elif tag in {"h1", "h2"}:
            self.headings.append("")

    def handle_startendtag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self.open[-1:] == [tag], f"</{tag}> inside {self.open[-3:]}"
        self.open.pop()
        if tag == "table":
            assert self._caption not in self.tables, f"two tables are called {self._caption}"
            self.tables[self._caption] = self._rows

    def handle_data(self, data):
        if "style" in self.open:
            return
        self.text += data
        if "caption" in self.open:
            self._caption += data
        elif {"td", "th"} & set(self.open):
            self._rows[-1][-1] += data
        elif "figcaption" in self.open:
            self.captions[-1] += data
        elif {"h1", "h2"} & set(self.open):
            self.headings[-1] += data

    def table(self, beginning: str) -> list[list[str]]:
        """The rows of the one table whose caption begins so, its head left out."""
        (found,) = (rows for caption, rows in self.tables.items() if caption.startswith(beginning))
        return found[1:]

    def all(self, tag: str) -> list[dict[str, str | None]]:
        """The attributes of every element of a kind."""
        return [attributes for name, attributes in self.elements if name == tag]
