"""Checks of written text, HTML and JSON, by readers that share nothing with the writers."""

import json
import re
from html.parser import HTMLParser
from pathlib import Path

from grabberd.files.checked_file import Check

_VOID = frozenset(
    {"area", "base", "br", "col", "embed", "hr", "img", "input", "link", "meta", "source", "wbr"}
)


def text_check(text: str) -> Check:
    """The text itself; of HTML, that its elements close in order; of JSON, that it can be read."""

    def check(path: Path) -> str | None:
        if (found := path.read_bytes()) != text.encode():
            return f"its {len(found)} bytes are others than the {len(text.encode())} expected"
        if re.match(r"\s*<!doctype html", text, re.IGNORECASE):
            return _Elements.problem(text)
        if text.lstrip().startswith("{"):
            json.loads(text)
        return None

    return check


class _Elements(HTMLParser):
    """Parses a page, noting the first element that does not close in order."""

    def __init__(self) -> None:
        super().__init__()
        self._open: list[str] = []
        self._wrong: str | None = None

    @classmethod
    def problem(cls, page: str) -> str | None:
        """The first element that does not close; None if all do."""
        parser = cls()
        parser.feed(page)
        parser.close()
        left = f"<{parser._open[-1]}> is not closed" if parser._open else None
        return parser._wrong or left

    def handle_starttag(self, tag: str, _: list[tuple[str, str | None]]) -> None:
        if tag not in _VOID:
            self._open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Nothing opens: elements of SVG close themselves."""

    def handle_endtag(self, tag: str) -> None:
        if self._open and self._open[-1] == tag:
            self._open.pop()
        else:
            self._wrong = self._wrong or f"</{tag}> closes nothing at {self.getpos()}"
