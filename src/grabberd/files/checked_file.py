"""New files that are read back before they get their names: what is reported as written can be read.

Text, HTML and JSON are checked here, by readers that share nothing with the writers.
"""

import json
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from errno import EEXIST
from html.parser import HTMLParser
from os import strerror
from pathlib import Path
from typing import IO

from grabberd import runtime
from grabberd.errors import StorageError
from grabberd.files.disk import storage_errors

Check = Callable[[Path], str | None]
"""Reads a file by an independent reader; returns what is wrong with it in words, or None."""
_HINT = "try again; if it comes again, check the disk, and look for a hint in the system's log"


@contextmanager
def checked_path(path: Path, check: Check) -> Iterator[Path]:
    """A path to write a new file at, which gets its own name once it has been read back.

    Nothing is left under either name if writing fails, or reading back finds something else.

    Raises:
        StorageError: The file exists, cannot be written, or is not what was to be written.
    """
    # The ending stays: writers of videos choose the format by it.
    part = path.with_name(f".part-{path.name}")
    try:
        with storage_errors(path):
            if path.exists():
                raise FileExistsError(EEXIST, strerror(EEXIST), str(path))
            yield part
        check_file(part, check, path.name)
        with storage_errors(path):
            runtime.rename(part, path)
    finally:
        part.unlink(missing_ok=True)


@contextmanager
def checked_file(path: Path, check: Check) -> Iterator[IO[bytes]]:
    """The same as an open file.

    Raises:
        StorageError: See `checked_path`.
    """
    with checked_path(path, check) as part, part.open("xb") as file:
        yield file


def write_checked(path: Path, parts: Iterable[bytes], check: Check) -> Path:
    """Writes a new file part by part, reads it back, and returns its path.

    Raises:
        StorageError: See `checked_path`.
    """
    with checked_path(path, check) as part, part.open("xb") as file:
        file.writelines(parts)
    return path


def write_text(path: Path, text: str) -> Path:
    """Writes a new file of text, HTML or JSON, reads it back, and returns its path.

    Raises:
        StorageError: See `checked_path`.
    """
    return write_checked(path, [text.encode()], text_check(text))


def check_file(path: Path, check: Check, name: str) -> None:
    """Reads a file back; a message calls it by `name`.

    Raises:
        StorageError: It is not what was to be written.
    """
    try:
        wrong = check(path)
    except Exception as error:  # every reader has errors of its own
        wrong = f"it cannot be read ({error})"
    if wrong:
        raise StorageError(f"{name} reads back other than it was written: {wrong}", _HINT)


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
