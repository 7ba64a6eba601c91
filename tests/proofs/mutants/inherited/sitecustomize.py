"""Mutated modules for a process and for the Python processes that it starts.

The folder of this file is in their PYTHONPATH. The environment variable names a folder with one compiled
module per file, named like the module; those of the source are not touched.
"""

import marshal
import os
import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from pathlib import Path
from types import CodeType, ModuleType

VARIABLE = "GRABBERD_MUTANT"


class _Loader(SourceFileLoader):
    def get_code(self, fullname: str) -> CodeType:
        code: CodeType = marshal.loads(Path(os.environ[VARIABLE], fullname).read_bytes())
        return code


class _Finder:
    def __init__(self, folder: Path) -> None:
        self._mutated = frozenset(path.name for path in folder.iterdir())

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        spec = PathFinder.find_spec(name, path, target) if name in self._mutated else None
        if spec is not None and spec.origin is not None:
            spec.loader = _Loader(name, spec.origin)
        return spec


if VARIABLE in os.environ and Path(os.environ[VARIABLE]).is_dir():
    sys.meta_path.insert(0, _Finder(Path(os.environ[VARIABLE])))
