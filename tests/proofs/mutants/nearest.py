"""The tests nearest to a function, computed anew from whatever the source and the tests are now.

First come the test file that noticed the mutant last time and the one that mirrors the function's file, then
those that name the function, its class, or the public functions through which a private one is reached, and
those whose folder is that of the file, or of a room around it.
"""

import ast
import re
from collections.abc import Iterator
from functools import cached_property
from itertools import islice, takewhile
from pathlib import Path

from tests.affected.durations import recorded
from tests.affected.imports import Imports
from tests.affected.selection import COLLECTION_S, UNKNOWN_S, select
from tests.house.source import ROOT, tree

from .functions import Function, Node

FILES = 3
SECONDS = 25.0
LEFT_OUT = ("browser", "months", "wheel", "container", "systemd", "fuzz", "bench", "proofs")
"""Rooms of tests that need more than this process, or that are about the tests themselves."""


class Nearest:
    """Tests by function."""

    def __init__(self) -> None:
        """Reads the imports of all sources and tests."""
        self._imports = Imports(ROOT)
        self._took_s = recorded(ROOT)
        self._reached: dict[Path, tuple[Path, ...]] = {}

    @cached_property
    def _words(self) -> dict[Path, frozenset[str]]:
        tests = (path for path in self._imports.paths if path.name.startswith("test_"))
        return {path: frozenset(re.findall(r"\w+", (ROOT / path).read_text("utf-8"))) for path in tests}

    def tests(self, path: Path, function: Function, killer: str = "") -> list[Path]:
        """At most three test files, relative to the root.

        Args:
            path: The function's file, relative to the root.
            function: The mutated function.
            killer: The test that killed this mutant before, by the name that it had then.
        """
        names = doors(tree(ROOT / path), function.name)
        method = function.name.rpartition(".")[2]
        weights = {
            test: 8 * _killed(killer, test, self._words[test])
            + 2 * min(len(names & self._words[test]), 2)
            + (method in self._words[test])
            + 3 * (test.stem == f"test_{path.stem}")
            + _shared(test, path)
            for test in self._reach(path)
        }
        ordered = sorted(weights, key=lambda test: -weights[test])  # stable: of equals, the nearest first
        return list(islice(self._fitting(ordered), FILES))

    def _reach(self, path: Path) -> tuple[Path, ...]:
        if path not in self._reached:
            near = select([path], self._imports, self._took_s, float("inf")).near
            self._reached[path] = tuple(one for one in near if one.parts[1] not in LEFT_OUT)
        return self._reached[path]

    def _fitting(self, ordered: list[Path]) -> Iterator[Path]:
        left_s = SECONDS
        for path in ordered:
            took_s = COLLECTION_S + self._took_s.get(path.as_posix(), UNKNOWN_S)
            if took_s <= left_s:
                left_s -= took_s
                yield path


def _killed(killer: str, test: Path, words: frozenset[str]) -> int:
    """2 for the file that the killing test was in and still is, 1 for another that it may have moved to."""
    file, _, name = killer.partition("::")
    function = name.rpartition("::")[2].partition("[")[0]
    same = Path(file).name == test.name
    return same + (function in words) if same or function in words else 0


def _shared(test: Path, path: Path) -> int:
    """Number of rooms, from the outermost, that the test's folder shares with the file's."""
    top = 2 if path.parts[0] == "src" else 0
    rooms = [part.removeprefix("grabberd_") for part in path.parent.parts[top:]]
    pairs = zip(test.parent.parts[1:], rooms, strict=False)
    return sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], pairs))


def doors(module: ast.Module, name: str) -> set[str]:
    """Names by which tests reach a function: its own or its class's; of a private one, its public users'."""
    defined = {node.name: node for node in module.body if isinstance(node, ast.ClassDef | Node)}
    uses = {one: {*re.findall(r"\w+", ast.unparse(node))} for one, node in defined.items()}
    found, todo = set(), [name.partition(".")[0]]
    while todo:
        used = todo.pop()
        found.add(used)
        if used.startswith("_"):
            todo.extend(one for one, words in uses.items() if used in words and one not in found)
    return {one for one in found if not one.startswith("_")}
