"""Parts that schemas of documents are put together from, for what readers take value by value."""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

Schema = dict[str, Any]

LARGEST_INTEGER = (1 << 31) - 1
"""Whole numbers that a reader takes where nothing else limits them."""


class Form(NamedTuple):
    """The form of a file.

    Attributes:
        title: What the file is.
        made: Makes its schema.
    """

    title: str
    made: Callable[[], Schema]


def text(description: str = "") -> Schema:
    """A text that is not empty."""
    return _described({"type": "string", "minLength": 1}, description)


def number(description: str = "", **limits: float) -> Schema:
    """A number, within `minimum`, `exclusiveMinimum` and the like."""
    return _described({"type": "number", **limits}, description)


def positive(description: str = "") -> Schema:
    """A number above 0."""
    return number(description, exclusiveMinimum=0)


def integer(description: str = "", *, least: int = -LARGEST_INTEGER, most: int = LARGEST_INTEGER) -> Schema:
    """A whole number."""
    return _described({"type": "integer", "minimum": least, "maximum": most}, description)


def one_of(*values: object, description: str = "") -> Schema:
    """One of some values."""
    return _described({"enum": list(values)}, description)


def numbers(*shape: int, description: str = "") -> Schema:
    """Nested lists of numbers of this shape."""
    inner: Schema = {"type": "number"}
    for length in reversed(shape):
        inner = {"type": "array", "items": inner, "minItems": length, "maxItems": length}
    return _described(inner, description)


def mapping(keys: Mapping[str, Schema], required: tuple[str, ...] = (), description: str = "") -> Schema:
    """A mapping that has no other keys than these."""
    form: Schema = {"type": "object", "properties": dict(keys), "additionalProperties": False}
    if required:
        form["required"] = list(required)
    return _described(form, description)


def either(*forms: Schema, description: str = "") -> Schema:
    """One form or another."""
    return _described({"anyOf": list(forms)}, description)


def or_nothing(form: Schema, description: str = "") -> Schema:
    """The form, or null, which stands for a key that is left out."""
    return either(form, {"type": "null"}, description=description)


def _described(form: Schema, description: str) -> Schema:
    return form | ({"description": description} if description else {})
