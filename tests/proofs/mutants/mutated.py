"""A module with one of its functions mutated."""

import ast
from pathlib import Path
from types import CodeType

from .functions import named
from .mutant import Mutant
from .operators import changes


def mutated(path: Path, mutant: Mutant) -> CodeType:
    """The compiled module; tracebacks show the source as it is."""
    return compile(mutated_tree(path.read_text(encoding="utf-8"), mutant), path, "exec", dont_inherit=True)


def mutated_tree(text: str, mutant: Mutant) -> ast.Module:
    """The module's syntax tree with the mutant's change in it.

    Raises:
        StopIteration: The function or the place is not there.
    """
    module = ast.parse(text)
    places = changes(named(module, mutant.function))
    next(one for one in places if (one.operator, one.place) == (mutant.operator, mutant.place)).make()
    return module
