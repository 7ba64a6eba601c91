"""Metadata of a capture file."""

import json
import sqlite3
import typing
from collections.abc import Mapping
from dataclasses import MISSING, asdict, dataclass, field, fields
from typing import Any

RECORDING = "recording"
SEALED = "sealed"


@dataclass(frozen=True, slots=True)
class CaptureMeta:
    """The table `meta`, which has a JSON value for each key.

    Attributes:
        id: Id of the capture.
        created_utc: Moment of the request, ISO 8601.
        start_ns: The same moment by CLOCK_MONOTONIC.
        device: Name, driver, options and, as `stream`, what the driver granted.
        config: The device's part of the configuration.
        site: Site of the configuration, e.g. the barn.
        labels: The operator's labels.
        note: The operator's note.
        bits: Bits per pixel.
        lines: "doubled" or "field".
        rate_hz: Nominal fields per second.
        version: Version of the program that wrote it.
        state: "recording", then "sealed".
        complete: None while recording, then True if nothing is lost or damaged.
        ended_because: Reason why it ended.
        extra: Further findings; see docs/reference/capture-file.md.
    """

    id: str
    created_utc: str
    start_ns: int
    device: Mapping[str, Any]
    config: Mapping[str, Any]
    site: Mapping[str, str]
    labels: Mapping[str, str]
    note: str
    bits: int
    lines: str
    rate_hz: float
    version: str
    state: str = RECORDING
    complete: bool | None = None
    ended_because: str | None = None
    extra: Mapping[str, Any] = field(default_factory=dict)


_KINDS = {
    name: typing.get_origin(kind) or kind for name, kind in typing.get_type_hints(CaptureMeta).items()
} | {"rate_hz": int | float, "complete": bool | None, "ended_because": str | None}


def write_meta(connection: sqlite3.Connection, values: Mapping[str, Any]) -> None:
    """Writes some keys within the caller's transaction."""
    rows = [(key, json.dumps(value, ensure_ascii=False)) for key, value in values.items()]
    connection.executemany("INSERT OR REPLACE INTO meta VALUES (?, ?)", rows)


def write_all_meta(connection: sqlite3.Connection, meta: CaptureMeta) -> None:
    """Writes every key."""
    write_meta(connection, asdict(meta))


def read_meta(connection: sqlite3.Connection) -> CaptureMeta:
    """Reads the metadata of a file; a key newer than the file has its default.

    Raises:
        KeyError: A key without a default is missing.
        ValueError: A value has the wrong type.
    """
    stored = {key: json.loads(value) for key, value in connection.execute("SELECT key, value FROM meta")}
    optional = {f.name for f in fields(CaptureMeta) if not (f.default is f.default_factory is MISSING)}
    names = [f.name for f in fields(CaptureMeta) if f.name in stored or f.name not in optional]
    for name in names:
        if not isinstance(stored[name], _KINDS[name]):
            raise ValueError(f"{name} is {stored[name]!r}")
    if not isinstance(stored["device"].get("name"), str):
        raise ValueError(f"device is {stored['device']!r}, without a name")
    return CaptureMeta(**{name: stored[name] for name in names})
