"""Names that programs know: errors, metrics, entry points, and the modules that documents import."""

import inspect
import re
import tempfile
import tomllib
from enum import Enum
from importlib import import_module
from importlib.metadata import EntryPoint
from pathlib import Path
from types import ModuleType
from typing import Any

from fastapi.testclient import TestClient

from .doors import STATUS, create_app, opened

ROOT = Path(__file__).parents[3]
NOW = "2026-11-28T12:00:00+00:00"
DOCUMENTED = (
    *("grabberd", "grabberd.acquisition", "grabberd.acquisition.device", "grabberd.acquisition.channels"),
    *("grabberd.acquisition.channels.logger", "grabberd.calibration"),
    *("grabberd.calibration.exchange.openptv", "grabberd.client.daemon", "grabberd.client.points_stream"),
    *("grabberd.documents.points_frame", "grabberd.errors", "grabberd.field", "grabberd.geometry"),
    *("grabberd.measurement.locators", "grabberd.testing", "grabberd_fake", "grabberd_replay"),
    *("grabberd_v4l2", "grabberd_loggers"),
)
"""Modules that docs/, the templates of `grabberd new` and the wheel's entry points name."""
_SAMPLE = re.compile(r"(\w+?)(?:\{(.*)\})? \S+$")
_LABEL = re.compile(r'(\w+)="([^"]*)"')
_OF_COMPUTER = ("process_",)
"""Beginnings of metrics that the computer decides on."""
_OPEN_LABELS = ("le", "path", "version")


def errors() -> dict[str, Any]:
    """Error classes with those they stand under and their causes; all causes."""
    module = import_module("grabberd.errors")
    found = {n: one for n, one in vars(module).items() if inspect.isclass(one) and issubclass(one, Exception)}
    return {
        "causes": {one.name: one.value for one in module.Cause},
        "classes": {
            name: {
                "under": [one.__name__ for one in found_one.__mro__[1:] if one.__module__ != "builtins"],
                "cause": str(getattr(found_one, "cause", "")),
                "http": next((int(STATUS[base]) for base in found_one.__mro__ if base in STATUS), None),
            }
            for name, found_one in found.items()
        },
    }


def metrics() -> dict[str, Any]:
    """Metrics of a daemon that has not begun: help, type, and their labels with the values that they know."""
    with tempfile.TemporaryDirectory() as folder, opened(Path(folder), NOW) as service:
        text = TestClient(create_app(service), "http://localhost").get("/metrics").text
    found: dict[str, Any] = {}
    for line in text.splitlines():
        if line.startswith(("# HELP", "# TYPE")):
            _, what, name, words = line.split(" ", 3)
            found.setdefault(name, {})[what.lower()] = words
        elif sample := _SAMPLE.match(line):
            _add_sample(found.setdefault(sample[1], {}), sample[2] or "")
    return {name: one for name, one in found.items() if not name.startswith(_OF_COMPUTER)}


def entry_points() -> dict[str, list[str]]:
    """Names in each entry point group of the wheel; each can be loaded."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    groups = {**project["entry-points"], "console_scripts": project["scripts"]}
    groups.pop("grabberd.extensions", None)  # newer than the lock; what is in it is no function
    for group, found in groups.items():
        for name, value in found.items():
            assert callable(EntryPoint(name, value, group).load()), f"{group}: {name} is no class or function"
    return {group: sorted(found) for group, found in groups.items()}


def extras() -> dict[str, Any]:
    """Names of the wheel's optional parts."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return {"name": project["name"], "extras": sorted(project["optional-dependencies"])}


def imports() -> dict[str, Any]:
    """Public names of the documented modules, with their parameters and members."""
    return {name: _public(import_module(name)) for name in DOCUMENTED}


def importable() -> dict[str, Any]:
    """All that can be imported from the documented modules, described as `imports` does."""
    return {name: _described_all(import_module(name), None) for name in DOCUMENTED}


def _public(module: ModuleType) -> dict[str, Any]:
    own = [name for name, one in vars(module).items() if getattr(one, "__module__", "") == module.__name__]
    constants = [name for name in vars(module) if name.isupper()]
    return _described_all(module, getattr(module, "__all__", [*own, *constants]))


def _described_all(module: ModuleType, names: list[str] | None) -> dict[str, Any]:
    chosen = dir(module) if names is None else names
    public = [name for name in chosen if not name.startswith("_")]
    found = {name: getattr(module, name) for name in public}
    return {name: _described(one) for name, one in found.items() if not inspect.ismodule(one)}


def _described(value: Any) -> Any:
    if inspect.isclass(value):
        members = {name: one for base in reversed(_own_bases(value)) for name, one in vars(base).items()}
        shown = {name: _member(one) for name, one in members.items() if not name.startswith("_")}
        return {"call": _parameters(value), "members": shown}
    if callable(value):
        return {"call": _parameters(value)}
    return repr(value) if isinstance(value, str | int | float | bool | None) else type(value).__name__


def _own_bases(value: type) -> list[type]:
    return [base for base in value.__mro__ if base.__module__.startswith("grabberd")]


def _member(value: Any) -> Any:
    if isinstance(value, classmethod | staticmethod):
        return _parameters(value.__func__)
    if inspect.isfunction(value):
        return _parameters(value)
    return repr(value.value) if isinstance(value, Enum) else "attribute"


def _parameters(value: Any) -> list[str]:
    """Parameters without their types: those may be imported from elsewhere."""
    try:
        signature = inspect.signature(value)
    except (TypeError, ValueError):
        return []
    return [_parameter(one) for one in signature.parameters.values()]


def _parameter(one: inspect.Parameter) -> str:
    stars = {one.VAR_POSITIONAL: "*", one.VAR_KEYWORD: "**"}.get(one.kind, "")
    only = " (by name)" if one.kind is one.KEYWORD_ONLY else ""
    if one.default is one.empty:
        return f"{stars}{one.name}{only}"
    told = isinstance(one.default, str | int | float | bool | None | tuple)
    return f"{one.name}={one.default if told else type(one.default).__name__!r}{only}"


def _add_sample(family: dict[str, Any], labels: str) -> None:
    known = family.setdefault("labels", {})
    for name, value in _LABEL.findall(labels):
        values = known.setdefault(name, [])
        shown = "…" if name in _OPEN_LABELS else value
        if shown not in values:
            values.append(shown)
