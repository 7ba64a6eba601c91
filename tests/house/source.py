"""The program's own source: its files, the names that they define, and which of them import which."""

import ast
import re
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = (*sorted((ROOT / "src").glob("grabberd*")), *sorted((ROOT / "drivers").glob("grabberd_*")))
LINER = "grabberd_liner"


@cache
def modules() -> Mapping[str, Path]:
    """Every module of the program and its drivers, by its dotted name."""
    found = {}
    for package in PACKAGES:
        for path in sorted(package.rglob("*.py")):
            parts = path.relative_to(package.parent).with_suffix("").parts
            found[".".join(parts).removesuffix(".__init__")] = path
    return found


@cache
def tree(path: Path) -> ast.Module:
    """A file's syntax tree."""
    return ast.parse(path.read_text(encoding="utf-8"))


def relative(path: Path) -> str:
    """A file as the docs name it."""
    return (
        path.relative_to(ROOT)
        .as_posix()
        .removeprefix("src/grabberd/")
        .removeprefix("src/")
        .removeprefix("drivers/")
    )


def names(path: Path) -> Iterator[tuple[int, str]]:
    """Line and name of all that a file defines: the module, classes, functions, arguments and variables."""
    yield 1, path.stem
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            yield node.lineno, node.name
        elif isinstance(node, ast.arg):
            yield node.lineno, node.arg
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            yield node.lineno, node.id
        elif isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            yield node.lineno, node.attr


def words(name: str) -> list[str]:
    """The words of a name, in small letters: `snake_case` and `CamelCase` alike."""
    return [word.lower() for word in re.findall(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])", name)]


def imports(module: str, path: Path) -> set[str]:
    """The program's modules that a file imports anywhere in it, also for types alone."""
    known, found = modules(), set()
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.Import):
            found.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            for alias in node.names:
                submodule = f"{node.module}.{alias.name}"
                found.add(submodule if submodule in known else node.module)
    return {one for one in found if one in known and one != module}
