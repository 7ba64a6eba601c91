"""Extensions: products of their own beside the instrument, each found by its entry point.

An extension is an object of strings and light data in the group `grabberd.extensions`. The modules that it
names are imported when something asks for them, so that a command does not wait for what it has no use for;
without the extension nothing of it is missing or empty.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib import import_module
from typing import Any, NamedTuple

GROUP = "grabberd.extensions"


@dataclass(frozen=True, slots=True)
class Place:
    """A module or object, and its place in an order that people see: help, OpenAPI.

    Attributes:
        name: Its public name, or that by which others find their place after it.
        target: `MODULE`, or `MODULE:NAME` of an object in it.
        after: Name of the one that it follows; empty: it comes first.
    """

    name: str
    target: str
    after: str = ""


class Advice(NamedTuple):
    """A table of `grabberd plan` that an extension brings.

    Attributes:
        title: Its title; `heads`: of its columns.
        rows: Cells, as shown.
        note: What the figures are.
        figures: The same for programs, a mapping for each row.
    """

    title: str
    heads: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str
    figures: Sequence[Mapping[str, Any]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Extension:
    """All that one extension brings; objects are named as `MODULE:NAME`.

    Attributes:
        name: Name of the extension.
        commands: Commands, by modules that have a function of that name.
        groups: Groups of commands, by modules that have `commands`.
        routes: Routers of the API under /api/v1.
        jobs: Kinds of jobs: subclasses of `JobSpec`.
        results: Documents of what its jobs have done.
        part: What makes its part of the running daemon, of a `Service`; see `ServicePart`.
        fields: Fields of documents, by the name of the document: annotations with their descriptions.
        columns: Function that gives the columns that it adds to the table of captures; see `capture_table`.
        schemas: Forms of its files, `schemas.Form`, by the name of the schema.
        library: Names of `import grabberd`, which win over those of the program.
        config_check: Function that checks its part of a `Config`, by that and its file, and raises a
            `ConfigError`; empty: none.
        messages: Its `DeviceTopic`s, on which a broker is told of each device; empty: none.
        advice: Function that gives `grabberd plan` an `Advice`, by the object model or None; empty: none.
    """

    name: str
    commands: tuple[Place, ...] = ()
    groups: tuple[Place, ...] = ()
    routes: tuple[Place, ...] = ()
    jobs: tuple[str, ...] = ()
    results: tuple[Place, ...] = ()
    part: str = ""
    fields: Mapping[str, tuple[Place, ...]] = field(default_factory=dict)
    columns: str = ""
    schemas: tuple[Place, ...] = ()
    library: Mapping[str, str] = field(default_factory=dict)
    config_check: str = ""
    messages: str = ""
    advice: str = ""


@cache
def extensions() -> tuple[Extension, ...]:
    """The installed extensions, by name."""
    from importlib.metadata import entry_points  # noqa: PLC0415 - takes a while, and is often not needed

    return tuple(entry.load() for entry in sorted(entry_points(group=GROUP), key=lambda entry: entry.name))


def load(target: str) -> Any:
    """The module, or the object in it, that an extension names."""
    module, _, name = target.partition(":")
    found = import_module(module)
    return getattr(found, name) if name else found


def in_order(own: Iterable[tuple[str, Any]], added: Iterable[Place]) -> dict[str, Any]:
    """Merge what extensions add with what the program has, by name, each at its place; nothing is loaded.

    Raises:
        ValueError: A name is there twice, or the place of one is unknown.
    """
    found = list(own)
    for one in added:
        names = [name for name, _ in found]
        if one.name in names:
            raise ValueError(f"{one.name!r} is there already")
        found.insert(names.index(one.after) + 1 if one.after else 0, (one.name, one.target))
    return dict(found)
