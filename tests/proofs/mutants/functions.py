"""Functions of the program, named without their modules and recognised by a digest of their source.

The digest ignores what a move changes or what says nothing of behaviour: line numbers, comments, docstrings,
annotations, and from which module a late import takes its names.
"""

import ast
import copy
import hashlib
from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

Node = ast.FunctionDef | ast.AsyncFunctionDef
DIGITS = 12


class Function(NamedTuple):
    """A function or method at the top of a module or of its classes; inner functions are part of it."""

    module: str
    name: str
    node: Node


class Catalogue:
    """All functions of a source, found by name and digest."""

    def __init__(self, trees: Mapping[str, ast.Module]) -> None:
        """Takes the syntax trees of all modules by their dotted names."""
        self._by_name: dict[str, list[Function]] = {}
        for module, tree in trees.items():
            for one in functions(module, tree):
                self._by_name.setdefault(one.name, []).append(one)

    def found(self, name: str, known: str) -> list[Function]:
        """Functions of this name and digest; several if one was copied, none if it has changed or is gone."""
        return [one for one in self._by_name.get(name, ()) if digest(one.node) == known]

    def single(self) -> Iterator[Function]:
        """Functions of which there is no copy."""
        for alike in self._by_name.values():
            known = [digest(one.node) for one in alike] if len(alike) > 1 else [""]
            yield from (one for one, own in zip(alike, known, strict=True) if known.count(own) == 1)


def functions(module: str, tree: ast.Module) -> Iterator[Function]:
    """Functions of a module; protocols declare behaviour, and have none."""
    yield from _functions(module, "", tree.body)


def _functions(module: str, prefix: str, body: Iterable[ast.stmt]) -> Iterator[Function]:
    for node in body:
        if isinstance(node, Node):
            yield Function(module, prefix + node.name, node)
        elif isinstance(node, ast.ClassDef) and not _is_protocol(node):
            yield from _functions(module, f"{prefix}{node.name}.", node.body)


def _is_protocol(node: ast.ClassDef) -> bool:
    return any(ast.unparse(base).rpartition(".")[2].startswith("Protocol") for base in node.bases)


def named(tree: ast.Module, name: str) -> Node:
    """The function of this name in a module's tree.

    Raises:
        StopIteration: There is none.
    """
    return next(one.node for one in functions("", tree) if one.name == name)


def digest(node: Node) -> str:
    """Digest of the source, in hexadecimal digits."""
    bare = _Bare().visit(copy.deepcopy(node))
    return hashlib.sha256(ast.unparse(bare).encode()).hexdigest()[:DIGITS]


class _Bare(ast.NodeTransformer):
    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        return self._without_types(node)

    def visit_AsyncFunctionDef(self, node: ast.AsyncFunctionDef) -> ast.AST:
        return self._without_types(node)

    def visit_arg(self, node: ast.arg) -> ast.AST:
        node.annotation = None
        return node

    def visit_AnnAssign(self, node: ast.AnnAssign) -> ast.AST:
        self.generic_visit(node)
        assigned = ast.Assign([node.target], node.value) if node.value else ast.Pass()
        return ast.fix_missing_locations(ast.copy_location(assigned, node))

    def visit_ImportFrom(self, node: ast.ImportFrom) -> ast.AST:
        node.module, node.level = "anywhere", 0
        return node

    def _without_types(self, node: Node) -> ast.AST:
        node.returns = None
        if ast.get_docstring(node, clean=False) is not None:
            node.body = node.body[1:] or [ast.copy_location(ast.Pass(), node.body[0])]
        return self.generic_visit(node)
