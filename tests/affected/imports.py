"""Who imports whom: the static import graph of sources, drivers and tests, read without running any of it.

A name that a package merely re-exports leads to the module that defines it: `from grabberd.core.geometry
import View` is an import of `core/geometry/view.py` alone. Otherwise whoever takes one name from a package
would seem to depend on all of it, and every test on every room.
"""

import ast
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOTS = ("src", "drivers", "tests", "tests/support", ".")
"""Directories that imports start from; those of tests are pytest's `pythonpath`."""
FOLDERS = ("src", "drivers", "tests")
ANY = "*"
"""Name of an import that is chosen at run time, among all modules whose names begin alike."""


class Taken(NamedTuple):
    """One import, bound to `as_name`: `name` of `module`, or the module itself if `name` is empty."""

    module: str
    name: str
    as_name: str


class Imports:
    """The graph; its nodes are paths relative to the root.

    Attributes:
        paths: All Python files.
        used: For each file, the files it takes something from, facades resolved.
        through: For each package's `__init__.py`, the files that take a name through it.
    """

    def __init__(self, root: Path) -> None:
        """Reads every file below `FOLDERS` of the repository at `root`."""
        files = (path for folder in FOLDERS for path in (root / folder).rglob("*.py"))
        self.paths = frozenset(path.relative_to(root) for path in files)
        self._modules = {name: path for path in self.paths for name in _module_names(path)}
        self._taken = {path: tuple(_taken(path, (root / path).read_text())) for path in self.paths}
        self.through: dict[Path, set[Path]] = defaultdict(set)
        self.used = {path: self._used_by(path) for path in self.paths}

    def _used_by(self, path: Path) -> frozenset[Path]:
        used = {found for taken in self._taken[path] for found in self._defining(taken, path)}
        return frozenset(used - {path})

    def _defining(self, taken: Taken, importer: Path) -> Iterator[Path]:
        """The file that defines what is taken; nothing for the standard library and for other packages."""
        if taken.name == ANY:
            yield from (path for name, path in self._modules.items() if name.startswith(taken.module))
            return
        submodule = self._modules.get(f"{taken.module}.{taken.name}") if taken.name else None
        file = self._modules.get(taken.module)
        if submodule is not None:
            yield submodule
        elif file is not None:
            self.through[file].add(importer)
            exports = {one.as_name: one for one in self._taken[file] if file.name == "__init__.py"}
            if taken.name in exports:
                yield from self._defining(exports[taken.name], importer)
            else:
                yield file


def _module_names(path: Path) -> Iterator[str]:
    for root in ROOTS:
        if path.is_relative_to(root):
            parts = path.relative_to(root).with_suffix("").parts
            yield ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _taken(path: Path, text: str) -> Iterator[Taken]:
    """All imports of a file, those inside functions included: they are dependencies, only later ones."""
    for node in ast.walk(ast.parse(text, path)):
        if isinstance(node, ast.Import):
            yield from (Taken(alias.name, "", alias.asname or alias.name) for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            module = _absolute(node, path)
            yield from (Taken(module, alias.name, alias.asname or alias.name) for alias in node.names)
        elif isinstance(node, ast.Call) and ast.unparse(node.func).endswith("import_module"):
            yield from (Taken(start, ANY, ANY) for start in _starts(node))


def _starts(call: ast.Call) -> Iterator[str]:
    """What the name begins with, of a module that is imported by an f-string."""
    for argument in call.args:
        first = argument.values[0] if isinstance(argument, ast.JoinedStr) else None
        if isinstance(first, ast.Constant):
            yield str(first.value)


def _absolute(node: ast.ImportFrom, path: Path) -> str:
    if not node.level:
        return node.module or ""
    package = ".".join(path.parts[: -node.level])
    return f"{package}.{node.module}" if node.module else package
