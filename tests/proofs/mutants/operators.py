"""Operators that change the behaviour of a function at one place of its syntax tree."""

import ast
import copy
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any, NamedTuple

from .functions import Node

TYPES = ("annotation", "returns", "type_params")
"""Fields of nodes that hold types."""
LOGGED = ("debug", "info", "warning", "error", "exception", "critical")
TEXT = (ast.JoinedStr, ast.List, ast.Tuple, ast.Dict)
"""Operands for which + and / are no arithmetic."""
SHOWN = 60
"""Characters of each side of a change in its description."""


class Change(NamedTuple):
    """Effect of one operator at one place.

    Attributes:
        operator: A key of `OPERATORS`.
        place: Its ordinal among the places of this operator in the function.
        old: The node at the place.
        new: What replaces it.
        put: Puts a node at the place, in the tree that it was found in.
    """

    operator: str
    place: int
    old: ast.AST
    new: ast.AST
    put: Callable[[ast.AST], None]

    @property
    def text(self) -> str:
        """The source before and after."""
        return f"{_short(self.old)} -> {_short(self.new)}"

    def make(self) -> None:
        """Makes the change."""
        self.put(ast.fix_missing_locations(ast.copy_location(self.new, self.old)))


def changes(function: Node) -> Iterator[Change]:
    """All changes of a function's body, in the order of its source."""
    counts = dict.fromkeys(OPERATORS, 0)
    for node, put in _nodes(function):
        for name, operator in OPERATORS.items():
            for new in operator(node):
                yield Change(name, counts[name], node, new, put)
                counts[name] += 1


def _short(node: ast.AST) -> str:
    head = copy.copy(node)
    if isinstance(head, ast.If | ast.While | ast.For):
        head.body, head.orelse = [ast.Pass()], []
    text = " ".join(ast.unparse(ast.fix_missing_locations(head)).split())
    return text if len(text) <= SHOWN else text[: SHOWN - 1] + "…"


def _nodes(parent: ast.AST) -> Iterator[tuple[ast.AST, Callable[[ast.AST], None]]]:
    """Nodes below a parent that may be changed, each with what replaces it."""
    for name, value in ast.iter_fields(parent):
        if name in TYPES or (name in ("args", "decorator_list") and isinstance(parent, Node)):
            continue
        for child, put in _children(parent, name, value):
            if not _is_silent(child):
                yield child, put
                yield from _nodes(child)


def _children(parent: ast.AST, name: str, value: Any) -> Iterator[tuple[ast.AST, Callable[[ast.AST], None]]]:
    if isinstance(value, ast.AST):
        yield value, partial(setattr, parent, name)
    elif isinstance(value, list):
        yield from (
            (one, partial(value.__setitem__, i)) for i, one in enumerate(value) if isinstance(one, ast.AST)
        )


def _is_silent(node: ast.AST) -> bool:
    """True for messages, logging, imports and docstrings."""
    if isinstance(node, ast.Raise | ast.Import | ast.ImportFrom):
        return True
    if isinstance(node, ast.keyword):
        return node.arg == "hint"
    return isinstance(node, ast.Expr) and (isinstance(node.value, ast.Constant) or _is_logging(node.value))


def _is_logging(node: ast.expr) -> bool:
    match node:
        case ast.Call(func=ast.Attribute(value=ast.Name(id=whose), attr=name)):
            return name in LOGGED and whose.strip("_").lower() in ("log", "logger", "logging")
    return False


def _both_ways(*pairs: tuple[Any, Any]) -> dict[Any, Any]:
    return dict(pairs) | {second: first for first, second in pairs}


BORDERS = _both_ways(
    (ast.Lt, ast.LtE), (ast.Gt, ast.GtE), (ast.Eq, ast.NotEq), (ast.Is, ast.IsNot), (ast.In, ast.NotIn)
)
ARITHMETIC = _both_ways((ast.Add, ast.Sub), (ast.Mult, ast.Div))
EXTREMES = _both_ways(("min", "max"), ("minimum", "maximum"), ("nanmin", "nanmax"), ("argmin", "argmax"))


def _with(node: Any, **fields: Any) -> Any:
    new = copy.copy(node)
    for name, value in fields.items():
        setattr(new, name, value)
    return new


def _border(node: ast.AST) -> Iterator[ast.AST]:
    if isinstance(node, ast.Compare):
        for i, one in enumerate(node.ops):
            yield _with(node, ops=[*node.ops[:i], BORDERS[type(one)](), *node.ops[i + 1 :]])


def _negated(node: ast.AST) -> Iterator[ast.AST]:
    """A condition of `while` is left alone: its opposite rarely ends."""
    match node:
        case ast.If(test=test) | ast.IfExp(test=test):
            yield _with(node, test=ast.UnaryOp(ast.Not(), test))
        case ast.UnaryOp(op=ast.Not(), operand=operand):
            yield operand
        case ast.comprehension(ifs=[first, *others]):
            yield _with(node, ifs=[ast.UnaryOp(ast.Not(), first), *others])
        case ast.Constant(value=bool(value)):
            yield ast.Constant(not value)


def _exchanged(node: ast.AST) -> Iterator[ast.AST]:
    if isinstance(node, ast.BoolOp):
        yield _with(node, op=ast.Or() if isinstance(node.op, ast.And) else ast.And())


def _arithmetic(node: ast.AST) -> Iterator[ast.AST]:
    match node:
        case ast.BinOp(left=left, right=right) if _is_text(left) or _is_text(right):
            return
        case ast.AugAssign(value=value) if _is_text(value):
            return
        case ast.BinOp(op=op) | ast.AugAssign(op=op) if type(op) in ARITHMETIC:
            yield _with(node, op=ARITHMETIC[type(op)]())


def _is_text(node: ast.expr) -> bool:
    return isinstance(node, TEXT) or (isinstance(node, ast.Constant) and isinstance(node.value, str))


def _constant(node: ast.AST) -> Iterator[ast.AST]:
    if isinstance(node, ast.Constant) and type(node.value) in (int, float):
        if type(node.value) is int:
            yield ast.Constant(node.value + 1)
        if node.value:
            yield ast.UnaryOp(ast.USub(), ast.Constant(node.value))


def _index(node: ast.AST) -> Iterator[ast.AST]:
    match node:
        case ast.Subscript(slice=ast.Constant(value=int(value))):
            yield _with(node, slice=ast.Constant(value + 1))
        case ast.Subscript(slice=ast.UnaryOp(op=ast.USub(), operand=ast.Constant(value=int(value)))):
            yield _with(node, slice=ast.UnaryOp(ast.USub(), ast.Constant(value + 1)))
        case ast.Slice(lower=ast.Constant(value=int(value))):
            yield _with(node, lower=ast.Constant(value + 1))
        case ast.Slice(upper=ast.Constant(value=int(value))):
            yield _with(node, upper=ast.Constant(value + 1))


def _returns_nothing(node: ast.AST) -> Iterator[ast.AST]:
    if isinstance(node, ast.Return) and node.value and ast.unparse(node.value) != "None":
        yield ast.Return(ast.Constant(None))


def _deleted(node: ast.AST) -> Iterator[ast.AST]:
    match node:
        case ast.AugAssign() | ast.Expr(value=ast.Call() | ast.Await(value=ast.Call())):
            yield ast.Pass()


def _extremes(node: ast.AST) -> Iterator[ast.AST]:
    match node:
        case ast.Call(func=ast.Name(id=name)) if name in ("min", "max"):
            yield _with(node, func=ast.Name(EXTREMES[name], ast.Load()))
        case ast.Call(func=ast.Attribute(attr=name)) if name in EXTREMES:
            yield _with(node, func=_with(node.func, attr=EXTREMES[name]))


def _jumps(node: ast.AST) -> Iterator[ast.AST]:
    if isinstance(node, ast.Break | ast.Continue):
        yield ast.Continue() if isinstance(node, ast.Break) else ast.Break()


RETURNS_NOTHING = "return None"
OPERATORS: Mapping[str, Callable[[ast.AST], Iterator[ast.AST]]] = {
    "border": _border,
    "negated": _negated,
    "and/or": _exchanged,
    "arithmetic": _arithmetic,
    "constant": _constant,
    "index": _index,
    RETURNS_NOTHING: _returns_nothing,
    "deleted": _deleted,
    "min/max": _extremes,
    "continue/break": _jumps,
}
