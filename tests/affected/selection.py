"""The tests that a change reaches, nearest first, as many as fit into the time there is.

Nearly everything imports geometry in the end, so a change in a core room reaches most of the suite. Nearest
are the tests of the changed file's own room, then those whose imports lead to the change in the fewest steps.
The limit is one of time and not of steps, for half a minute is what a developer waits for.
"""

from collections.abc import Collection, Iterable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import NamedTuple

from tests.affected.imports import Imports

WHOLE = (
    "pyproject.toml",
    "constraints.txt",
    "hatch_build.py",
    "Makefile",
    "tests/conftest.py",
    "tests/recorded_world.py",
)
"""What every test depends on."""
ROOMS = {
    "configs": ("tests/test_config.py",),
    "docs": ("tests/test_docs.py",),
    "README.md": ("tests/test_docs.py",),
    "CONTRIBUTING.md": ("tests/test_docs.py",),
    "src/grabberd/server/web": ("tests/server/web",),
    "src/grabberd/core/kernel": ("tests/core/kernel",),
    "systemd": ("tests/systemd",),
}
"""Where the tests of files live that nobody imports."""
VM = Path("tests/proofs/vm")
DRIVERS = ("tests/contract",)
"""The suite that every driver has to pass; it finds them by their entry points."""
UNKNOWN_S = 1.0
"""Assumed for a test file that has not been timed yet."""
COLLECTION_S = 0.1
"""What importing a test file takes, which its tests' durations do not contain."""


class Selection(NamedTuple):
    """Test files, relative to the root.

    Attributes:
        changed: Test files that have changed themselves; their slow tests run, too.
        near: Test files to run, nearest first.
        left_out: Test files that the change reaches but for which there is no time.
        unknown: Changed files for which no test is known.
        whole: True if the change concerns every test.
    """

    changed: tuple[Path, ...]
    near: tuple[Path, ...]
    left_out: tuple[Path, ...]
    unknown: tuple[Path, ...]
    whole: bool


def select(
    changes: Collection[Path], imports: Imports, took_s: Mapping[str, float], limit_s: float
) -> Selection:
    """Sorts the tests that the changed files reach.

    Args:
        changes: Changed files, relative to the root; they may be deleted ones.
        imports: The import graph.
        took_s: How long the tests of each test file took, slow ones left out.
        limit_s: Time for all of the tests together, on one processor.
    """
    tests = {path for path in imports.paths if is_test(path)}
    rooms = {change: frozenset(_room(change, tests)) for change in changes}
    changed = tests.intersection(changes)
    steps = {path: step for path, step in distances(changes, imports).items() if path in tests}
    steps |= dict.fromkeys(frozenset().union(*rooms.values()), 0)
    cost_s = {path: COLLECTION_S + took_s.get(path.as_posix(), UNKNOWN_S) for path in steps}
    ordered = sorted(steps.keys() - changed, key=lambda path: (steps[path], cost_s[path], path))
    near = tuple(_fitting(ordered, cost_s, limit_s))
    return Selection(
        changed=tuple(sorted(changed)),
        near=near,
        left_out=tuple(path for path in ordered if path not in near),
        unknown=tuple(sorted(c for c in changes if not rooms[c] and c not in imports.paths)),
        whole=any(change.as_posix() in WHOLE for change in changes),
    )


def _fitting(ordered: Iterable[Path], cost_s: Mapping[Path, float], limit_s: float) -> Iterator[Path]:
    left_s = limit_s
    for path in ordered:
        if cost_s[path] <= left_s:
            left_s -= cost_s[path]
            yield path


def distances(changes: Iterable[Path], imports: Imports) -> Mapping[Path, int]:
    """Import steps from each file that reaches a change to the nearest change.

    A step inside of tests counts nothing: a helper is part of the tests that use it.
    """
    users = _users(imports)
    steps = {path: 0 for path in changes if path in imports.paths}
    todo = sorted(steps)
    while todo:  # the shortest way is found though steps differ: whoever is reached sooner is looked at again
        path = todo.pop(0)
        for user in users.get(path, ()):
            step = steps[path] + (path.parts[0] != "tests")
            if step < steps.get(user, len(imports.paths)):
                steps[user] = step
                todo.append(user)
    return steps


def is_test(path: Path) -> bool:
    """True for a file that pytest collects; those of the virtual machine have a command of their own."""
    return path.parts[0] == "tests" and path.name.startswith("test_") and not path.is_relative_to(VM)


@cache
def _users(imports: Imports) -> Mapping[Path, set[Path]]:
    users: dict[Path, set[Path]] = {}
    for user, used in imports.used.items():
        for path in used:
            users.setdefault(path, set()).add(user)
    for package, importers in imports.through.items():
        users.setdefault(package, set()).update(importers)
    for path in imports.paths:
        if path.name == "conftest.py":
            users.setdefault(path, set()).update(p for p in imports.paths if path.parent in p.parents)
    return users


def _room(change: Path, tests: Iterable[Path]) -> set[Path]:
    """The tests that mirror the changed file's directory, without those of the floors below it."""
    mirror = _mirror(change)
    own = {path for path in tests if mirror is not None and path.parent == mirror}
    named = [folder for start, folders in ROOMS.items() if change.is_relative_to(start) for folder in folders]
    if change.parts[0] == "drivers":
        named.extend(DRIVERS)
    return own | {path for path in tests for folder in named if path.is_relative_to(folder)}


def _mirror(change: Path) -> Path | None:
    parts = change.parent.parts
    if parts[:2] == ("src", "grabberd") and len(parts) > 2:
        return Path("tests", *parts[2:])
    if parts[:2] == ("src", "grabberd_liner"):
        return Path("tests", "liner", *parts[2:])
    if parts[:1] == ("drivers",) and len(parts) > 1:
        return Path("tests", "drivers", parts[1].removeprefix("grabberd_"), *parts[2:])
    return None
