"""First lines of docstrings: each is a verb or a noun phrase that could stand in an index."""

import ast
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from .source import modules, relative, tree

OPENINGS = frozenset(
    [
        "what",
        "whether",
        "so",
        "how",
        "that",
        "which",
        "who",
        "whose",
        "why",
        "when",
        "where",
        "of",
        "with",
        "by",
        "as",
        "for",
        "here",
        "beside",
        "everything",
    ]
)
"""First words that make a riddle of a docstring: "Whether it is" for "True if the ring is full"."""


class Opening(NamedTuple):
    """A docstring that opens with a word of `OPENINGS`."""

    file: str
    line: int
    text: str

    def __str__(self) -> str:
        return f"{self.file}:{self.line}: open with a verb or a noun phrase: {self.text}"


def riddles() -> Iterator[Opening]:
    """Every docstring in the source whose first word is in `OPENINGS`."""
    for path in modules().values():
        for line, text in _docstrings(path):
            first = text.split(maxsplit=1)[0].strip("`*,.:;").lower() if text.split() else ""
            if first in OPENINGS:
                yield Opening(relative(path), line, text.splitlines()[0])


def _docstrings(path: Path) -> Iterator[tuple[int, str]]:
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            text = ast.get_docstring(node)
            if text:
                yield node.body[0].lineno, text


def main() -> int:
    """Lists them; the exit status is 1 if there is any."""
    found = list(riddles())
    for one in found:
        print(one)
    print(f"{len(found)} docstrings open with a word that makes a riddle of them")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
