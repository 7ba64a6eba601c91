"""The houses: which module belongs to which, how much code each is, and who names whom."""

import ast
import tomllib
from collections import Counter
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import NamedTuple

from .source import imports, modules, tree

KEPT = Path(__file__).with_name("houses.toml")


class Reference(NamedTuple):
    """A module that names another house: by an import, or by a string that names its package."""

    module: str
    named: str


@cache
def _prefixes() -> Mapping[str, str]:
    kept = tomllib.loads(KEPT.read_text(encoding="utf-8"))
    return {prefix: house for house, some in kept.items() for prefix in some}


def house_of(module: str) -> str:
    """The house of a module by its dotted name."""
    fitting = [one for one in _prefixes() if module == one or module.startswith(one + ".")]
    return _prefixes()[max(fitting, key=len)]


@cache
def houses() -> Mapping[str, str]:
    """The house of every module."""
    return {module: house_of(module) for module in modules()}


def references(source: str, target: str) -> list[Reference]:
    """What modules of one house name of another one: imports anywhere, and strings that name its modules."""
    home = houses()
    found = []
    for module, path in modules().items():
        if home[module] == source:
            named = {*imports(module, path), *_named_in_strings(path)}
            found += [Reference(module, one) for one in sorted(named) if home.get(one) == target]
    return found


def code() -> Mapping[str, tuple[int, int]]:
    """Files and code lines of every house: without blanks, docstrings and comments."""
    files, lines = Counter[str](), Counter[str]()
    for module, house in houses().items():
        files[house] += 1
        lines[house] += code_lines(modules()[module])
    return {house: (files[house], lines[house]) for house in sorted(files)}


def code_lines(path: Path) -> int:
    """Lines of a file that are neither blank nor docstring nor comment."""
    documented = {line for node in ast.walk(tree(path)) for line in _docstring_lines(node)}
    lines = enumerate(path.read_text(encoding="utf-8").splitlines(), 1)
    return sum(
        1 for n, line in lines if line.strip() and not line.strip().startswith("#") and n not in documented
    )


def table() -> str:
    """Markdown: the houses, and the sums."""
    counted = code()
    rows = [f"| {house} | {files} | {lines} |" for house, (files, lines) in counted.items()]
    files, lines = (sum(one) for one in zip(*counted.values(), strict=True))
    return "\n".join(
        ["| house | files | code lines |", "|---|---|---|", *rows, f"| in all | {files} | {lines} |"]
    )


def _docstring_lines(node: ast.AST) -> Iterator[int]:
    """Lines of the strings that stand alone in a body: docstrings, also those of constants."""
    body = getattr(node, "body", None)
    for one in body if isinstance(body, list) else ():
        if isinstance(one, ast.Expr) and isinstance(one.value, ast.Constant):
            yield from range(one.lineno, (one.end_lineno or one.lineno) + 1)


def _named_in_strings(path: Path) -> Iterator[str]:
    """Modules that a file's strings name, in whole or as `MODULE:NAME`; docstrings are for people."""
    known = modules()
    documented = {line for node in ast.walk(tree(path)) for line in _docstring_lines(node)}
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and node.lineno not in documented:
            name = node.value.partition(":")[0]
            if name in known:
                yield name
