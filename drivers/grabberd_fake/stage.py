"""The stage: a small file that says which liner is mounted and which vacuum is on, while the driver runs.

In a barn an operator takes the teat out, switches the vacuum off, mounts another liner. This file is how the
simulated barn is rearranged; grabber and logger follow it, each by its own `Stage`.
"""

import logging
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

import yaml

from grabberd.bounded_documents import parse_yaml, read_text, yaml_text
from grabberd.errors import DeviceRefused, GrabberdError
from grabberd_fake.liner_options import LinerOptions
from grabberd_fake.reading import read

log = logging.getLogger(__name__)

KEYS = ("wall", "period_s", "start_s", "vacuum")
"""Options of the liner that a stage may replace: all others belong to the targets and to the rig."""
MILKING: Mapping[str, Any] = {"period_s": None, "start_s": None, "vacuum": None}
"""Changes that leave the vacuum as configured."""
NO_VACUUM: Mapping[str, Any] = {**MILKING, "vacuum": {"system_kpa": 0.0, "liner_kpa": 0.0}}
_RAMP_S = 80.0
_RAMP = {"system_kpa": 20.0, "liner_kpa": 20.0, "rising": 0.0125, "open": 0.125, "falling": 0.625}


def ramp(now_s: float) -> dict[str, Any]:
    """Changes that let the pressure difference go from 0 to 20 kPa, beyond every liner's touch, in 50 s.

    It stays 0 for ten seconds before, in which the capture has to be started.

    Args:
        now_s: time of the machine's monotonic clock.
    """
    return {"period_s": _RAMP_S, "start_s": round(now_s % _RAMP_S, 3), "vacuum": dict(_RAMP)}


_HINT = "correct the file, or delete it; python -m grabberd_fake stage writes one"
REARRANGED = "the simulated barn has been rearranged"
"""Reason in the ledger of the fields that this costs."""


class Stage:
    """The liner before the camera, by the driver's options and the file that replaces some of them.

    Attributes:
        liner: the liner on stage.
        content: what the file replaces of it.
    """

    def __init__(self, path: str | None, liner: LinerOptions) -> None:
        """Begins with the liner as configured; the file need not be there."""
        self.liner, self.content = liner, dict[str, Any]()
        self._configured = liner
        self._path = None if path is None else Path(path)
        self._seen: object = None
        self._followed = False

    def follow(self) -> bool:
        """Reads the file if it has changed; true if something else is on stage since then.

        A file that cannot be used is complained of once, and the stage stays as it was.

        Raises:
            DeviceRefused: there is no stage yet, and the file cannot be used; a line for each problem.
        """
        before = self.liner
        # First: a file that is replaced while it is read is read once more.
        seen = None if self._path is None else _identity(self._path)
        if self._path is not None and seen != self._seen:
            try:
                content = {} if seen is None else read_stage(self._path)
                self.liner, self.content = on_stage(self._configured, content, self._path), content
            except ValueError as error:
                if not self._followed:
                    raise DeviceRefused(f"there is no stage: {error}", _HINT) from error
                log.warning("the stage stays as it was: %s", error)
            self._seen = seen
        self._followed = True
        return self.liner != before


def read_stage(path: Path) -> dict[str, Any]:
    """Content of a stage file.

    Raises:
        ValueError: it cannot be read, or is no mapping.
    """
    try:
        content = parse_yaml(read_text(path))
    except (OSError, GrabberdError, ValueError, yaml.YAMLError) as error:
        raise ValueError(f"{path}: cannot be read: {error}") from error
    if content is not None and not isinstance(content, dict):
        raise ValueError(f"{path}: {content!r} is not a mapping of keys to values")
    return content or {}


def on_stage(configured: LinerOptions, content: Mapping[str, Any], path: Path) -> LinerOptions:
    """The liner with what a stage replaces of it.

    Raises:
        ValueError: the content is not allowed; a line for each problem, with the file's name.
    """
    foreign = [f"{key}: not on a stage; {', '.join(KEYS)} are" for key in content if key not in KEYS]
    kept = {item.name: getattr(configured, item.name) for item in fields(LinerOptions)}
    try:
        liner = read(LinerOptions, kept | {key: content[key] for key in KEYS if key in content})
        problems = foreign
    except ValueError as error:
        problems = [*foreign, *str(error).splitlines()]
    if problems:
        raise ValueError("\n".join(f"{path}: {problem}" for problem in problems))
    return liner


def write_stage(path: Path, changes: Mapping[str, Any]) -> dict[str, Any]:
    """Changes what stands on stage, whole or not at all; returns the file's content.

    Args:
        path: the file; it need not be there yet.
        changes: values by key; None takes a key off the stage, so that it is as configured.

    Raises:
        ValueError: the stage would not be allowed, or cannot be read or written; nothing is changed.
    """
    content = read_stage(path) if path.exists() else {}
    content = {key: value for key, value in {**content, **changes}.items() if value is not None}
    on_stage(LinerOptions(), content, path)
    new = path.with_name(f".{path.name}.new")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        new.write_text(yaml_text(content), encoding="utf-8")
        new.replace(path)
    except OSError as error:
        raise ValueError(f"{path}: cannot be written: {error}") from error
    return content


def _identity(path: Path) -> object:
    """Something that differs once the file is replaced or written to; None where there is no file."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_ino, status.st_size, status.st_mtime_ns
