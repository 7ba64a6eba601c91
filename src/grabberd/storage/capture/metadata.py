"""What a capture file says of itself."""

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
    """Stored in the table `meta`, a JSON value for each key.

    Attributes:
        id: of the capture.
        created_utc: ISO 8601; `start_ns` is the same moment by CLOCK_MONOTONIC.
        device: its name, driver, options and, as `stream`, what the driver granted.
        config: the device's part of the configuration.
        site: of the configuration, e.g. the barn; `labels` and `note`: the operator's.
        bits: bits a pixel; `lines`: "doubled" or "field".
        rate_hz: nominal fields a second.
        version: of the program that wrote it.
        state: "recording", then "sealed".
        complete: None while recording, then whether nothing is lost or damaged.
        ended_because: why it ended.
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
    """Writes some keys, within the caller's transaction."""
    rows = [(key, json.dumps(value, ensure_ascii=False)) for key, value in values.items()]
    connection.executemany("INSERT OR REPLACE INTO meta VALUES (?, ?)", rows)


def write_all_meta(connection: sqlite3.Connection, meta: CaptureMeta) -> None:
    """Writes every key."""
    write_meta(connection, asdict(meta))


def read_meta(connection: sqlite3.Connection) -> CaptureMeta:
    """The meta data of a file; a key that came later than the file has its default.

    Raises:
        KeyError: a key is missing that has none.
        ValueError: a value is not of its kind.
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
