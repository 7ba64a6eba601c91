"""The table `meta` of a capture file: a JSON value for each key, validated when read."""

import json
import sqlite3
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from datetime import UTC, datetime
from typing import Annotated, Any, Literal, cast

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from grabberd.core.field import BIT_DEPTHS
from grabberd.files.json_value import read_json

CONVERSION = "conversion"
"""Key of the record of a capture's conversion."""
RECORDING = "recording"
SEALED = "sealed"
LONGEST_TEXT = 10_000
"""Longest note or label in characters."""
LONGEST_REASON = 1 << 20
"""Longest reason in characters; those of drivers are stored unabridged."""
LARGEST_TIME_NS = 1 << 62
"""Upper bound of a monotonic time, 146 years after the computer's start."""
LARGEST_N = 1 << 31
"""Upper bound of a field's number; at 50 Hz it is reached after 497 days."""


@dataclass(frozen=True, slots=True)
class CaptureMeta:
    """Metadata of a capture as a whole.

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
        boot_id: The kernel's id of the boot from which `start_ns` and the fields' times are counted; empty if
            unknown.
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
    boot_id: str = ""
    state: str = RECORDING
    complete: bool | None = None
    ended_because: str | None = None
    extra: Mapping[str, Any] = field(default_factory=dict)

    @property
    def is_interlaced(self) -> bool:
        """True unless its fields are progressive pictures, which have no parity."""
        stream = self.device.get("stream")
        return not (isinstance(stream, Mapping) and stream.get("field_order") == _PROGRESSIVE)


def _id(text: str) -> str:
    # It becomes part of file names, URLs and log lines.
    if "/" in text or not text.isprintable() or text.startswith("."):
        raise ValueError("not an id: it has a slash, a leading dot or control characters")
    return text


def _printable(text: str) -> str:
    if not text.isprintable():
        raise ValueError("it has characters that cannot be shown")
    return text


def _utc(text: str) -> str:
    moment = datetime.fromisoformat(text)
    if moment.tzinfo is None or not _EARLIEST <= moment <= _LATEST:
        raise ValueError(f"not a time between {_EARLIEST:%Y} and {_LATEST:%Y} with its time zone")
    return text


def _bits(bits: int) -> int:
    if bits not in BIT_DEPTHS:
        raise ValueError(f"not one of {', '.join(map(str, BIT_DEPTHS))}")
    return bits


_PROGRESSIVE = "progressive"
_EARLIEST, _LATEST = datetime(1970, 1, 1, tzinfo=UTC), datetime(2200, 1, 1, tzinfo=UTC)
_Name = Annotated[str, Field(max_length=200)]
_Text = Annotated[str, Field(max_length=LONGEST_TEXT)]
_Reason = Annotated[str, Field(max_length=LONGEST_REASON)]
_Texts = Annotated[dict[_Name, _Text], Field(max_length=200)]
TimeNs = Annotated[int, Field(ge=0, lt=LARGEST_TIME_NS)]
_Count = Annotated[int, Field(ge=0, lt=LARGEST_N)]
_Utc = Annotated[str, Field(max_length=40), AfterValidator(_utc)]


class StoredPart(BaseModel):
    """Values of known keys; files of later versions may have more."""

    model_config = ConfigDict(extra="ignore", strict=True)


class _Stream(StoredPart):
    live: bool = True
    waits_for_reader: bool = False


class _Device(StoredPart):
    name: Annotated[str, Field(min_length=1, max_length=200), AfterValidator(_printable)]
    driver: _Name | None = None
    options: dict[str, Any] = {}
    stream: _Stream | None = None


class _Trigger(StoredPart):
    n: _Count = 0
    utc: _Utc | None = None


class _Order(StoredPart):
    fields: _Count | None = None


class _Group(StoredPart):
    id: Annotated[str, Field(min_length=1, max_length=200), AfterValidator(_id)]
    devices: Annotated[list[_Name], Field(max_length=100)]
    start_utc: _Utc | None = None
    start_ns: TimeNs | None = None


class _Event(StoredPart):
    n: _Count
    kind: _Name
    reason: _Reason


class _Extra(StoredPart):
    trigger: _Trigger | None = None
    order: _Order | None = None
    group: _Group | None = None
    rig: dict[str, Any] | None = None
    field_order: dict[str, Any] | None = None
    rebases: list[_Event] = []


class StoredMeta(StoredPart):
    """Ranges of the values of `CaptureMeta`."""

    id: Annotated[str, Field(min_length=1, max_length=200), AfterValidator(_id)]
    created_utc: _Utc
    start_ns: TimeNs
    device: _Device
    config: dict[str, Any]
    site: _Texts
    labels: _Texts
    note: _Text
    bits: Annotated[int, AfterValidator(_bits)]
    lines: Literal["doubled", "field"]
    rate_hz: Annotated[float, Field(gt=0.0, le=10_000.0)]
    version: _Name
    boot_id: _Name = ""
    state: Literal["recording", "sealed"] = "recording"
    complete: bool | None = None
    ended_because: _Reason | None = None
    extra: _Extra = _Extra()


def write_meta(connection: sqlite3.Connection, values: Mapping[str, Any]) -> None:
    """Writes keys within the caller's transaction."""
    rows = [(key, json.dumps(value, ensure_ascii=False)) for key, value in values.items()]
    connection.executemany("INSERT OR REPLACE INTO meta VALUES (?, ?)", rows)


def read_meta(connection: sqlite3.Connection) -> CaptureMeta:
    """Reads the metadata of a file; keys newer than the file get their defaults.

    Raises:
        ValueError: A required key is missing, or a value is invalid.
    """
    known = [one.name for one in fields(CaptureMeta)]
    query = f"SELECT key, value FROM meta WHERE key IN ({', '.join('?' * len(known))})"  # noqa: S608 - marks
    stored = {key: read_json(value) for key, value in connection.execute(query, known)}
    _check(stored)
    return CaptureMeta(**stored)


def check_meta(meta: CaptureMeta) -> None:
    """Checks that metadata can be read back once they are written.

    Raises:
        ValueError: A value is invalid.
    """
    _check(read_json(json.dumps(asdict(meta))))


def _check(stored: Any) -> None:
    try:
        StoredMeta.model_validate(stored)
    except ValidationError as error:
        raise ValueError("; ".join(map(_problem, cast("list[Any]", error.errors())))) from None


def _problem(error: Mapping[str, Any]) -> str:
    return f"{'.'.join(map(str, error['loc']))} is {_shortened(error['input'])}: {error['msg']}"


def _shortened(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 100 else f"{text[:100]}…"


def coverage_key(run: int) -> str:
    """Key of a run's coverage in the table `meta`, where earlier versions ignore unknown keys."""
    return f"coverage.{run}"


def read_coverage(connection: sqlite3.Connection) -> dict[str, str]:
    """The coverage of runs as JSON, by their keys."""
    rows = connection.execute("SELECT key, value FROM meta WHERE key GLOB 'coverage.*'")
    return dict(rows.fetchall())


class Conversion(StoredPart):
    """Record of a capture's conversion from an earlier format.

    Attributes:
        version: The earlier format.
        content_sha256: Digest of what its points are measured from.
        converted_utc: When it was converted.
    """

    version: int
    content_sha256: Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
    converted_utc: _Utc


def read_conversion(connection: sqlite3.Connection) -> Conversion | None:
    """The conversion of a capture; None if it was never converted.

    Raises:
        ValueError: The record is damaged.
    """
    row = connection.execute("SELECT value FROM meta WHERE key = ?", (CONVERSION,)).fetchone()
    return None if row is None else Conversion.model_validate(read_json(row[0]))
