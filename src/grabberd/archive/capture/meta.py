"""The table `meta` of a capture file: a JSON value for each key, validated when read.

Among them are the marks on the cup: the raw places that those of each field were located at, before any
correction, a row for each group of fields. Earlier versions ignore keys that they do not know.
"""

import base64
import binascii
import json
import sqlite3
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any, Literal, cast

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from grabberd.archive.capture.schema import reading_errors
from grabberd.core.field import BIT_DEPTHS
from grabberd.core.measurement.marks import MOST_MARKS, Located
from grabberd.errors import said
from grabberd.files.reading import read_json

CONVERSION = "conversion"
"""Key of the record of a capture's conversion."""
RECORDING = "recording"
SEALED = "sealed"
LONGEST_TEXT = 10_000
"""Longest note or label in characters."""
LONGEST_REASON = 1 << 20
"""Longest reason in characters; those of drivers are stored unabridged."""
LARGEST_TEXTS = 20_000
"""Characters of all labels together, or of all names of the site; the API takes 12 800."""
LARGEST_FINDING = 20_000
"""Characters of what the points tell about the rig, or about the order of fields, as JSON."""
LARGEST_VALUE = 1 << 18
"""Characters of a value, as JSON; a device's configuration takes some thousands."""
LARGEST_EXTRA = 2 << 20
"""Those of further findings, which have the rebases."""
LONGEST_NAME = 200
LONGEST_SAID = 200
"""Characters of a message about something of any length."""
MOST_RUNS = 1000
"""Largest number of runs of a capture."""
MOST_EVENTS = 10_000
"""Largest number of rebases; further ones are counted by the last that is listed."""
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


def _few(texts: dict[str, str]) -> dict[str, str]:
    if sum(len(name) + len(text) for name, text in texts.items()) > LARGEST_TEXTS:
        raise ValueError(f"they have more than {LARGEST_TEXTS} characters")
    return texts


def _short(finding: dict[str, Any]) -> dict[str, Any]:
    if len(json.dumps(finding)) > LARGEST_FINDING:
        raise ValueError(f"it has more than {LARGEST_FINDING} characters")
    return finding


def _bits(bits: int) -> int:
    if bits not in BIT_DEPTHS:
        raise ValueError(f"not one of {', '.join(map(str, BIT_DEPTHS))}")
    return bits


_PROGRESSIVE = "progressive"
_EARLIEST, _LATEST = datetime(1970, 1, 1, tzinfo=UTC), datetime(2200, 1, 1, tzinfo=UTC)
_Name = Annotated[str, Field(max_length=LONGEST_NAME)]
_Text = Annotated[str, Field(max_length=LONGEST_TEXT)]
_Reason = Annotated[str, Field(max_length=LONGEST_REASON)]
_Texts = Annotated[dict[_Name, _Text], Field(max_length=200), AfterValidator(_few)]
_Finding = Annotated[dict[str, Any], AfterValidator(_short)]
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
    rig: _Finding | None = None
    field_order: _Finding | None = None
    rebases: Annotated[list[_Event], Field(max_length=MOST_EVENTS)] = []


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


_SMALL = {one.name for one in fields(CaptureMeta)} - {"extra", "ended_because"}


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
    stored = {key: read_json(value) for key, value in _values(connection, known)}
    _check(stored)
    return CaptureMeta(**stored)


def read_value(connection: sqlite3.Connection, key: str) -> Any:
    """The value of a key; None if the file does not have it.

    Raises:
        ValueError: It is damaged, or too large.
    """
    return next((read_json(value) for _, value in _values(connection, [key])), None)


def _values(connection: sqlite3.Connection, keys: Sequence[str]) -> list[tuple[str, str]]:
    """The values of keys as JSON, none of which is read if it is too large."""
    largest = max(map(_largest, keys))
    query = f"""SELECT key, CASE WHEN length(value) <= {largest} THEN value END FROM meta
        WHERE key IN ({", ".join("?" * len(keys))})"""  # noqa: S608 - marks and a number
    rows: list[tuple[str, str]] = connection.execute(query, keys).fetchall()
    for key, value in rows:
        _check_size(key, value)
    return rows


def _check_size(key: str, value: str | None) -> None:
    if value is None or len(value) > _largest(key):
        raise ValueError(f"{key} has more than {_largest(key)} characters")


def _largest(key: str) -> int:
    return LARGEST_VALUE if key in _SMALL else LARGEST_EXTRA


def check_meta(meta: CaptureMeta) -> None:
    """Checks that metadata can be read back once they are written.

    Raises:
        ValueError: A value is invalid, or too large.
    """
    stored = {key: json.dumps(value, ensure_ascii=False) for key, value in asdict(meta).items()}
    for key, value in stored.items():
        _check_size(key, value)
    _check({key: read_json(value) for key, value in stored.items()})


def _check(stored: Any) -> None:
    try:
        StoredMeta.model_validate(stored)
    except ValidationError as error:
        raise ValueError("; ".join(map(_problem, cast("list[Any]", error.errors())))) from None


def _problem(error: Mapping[str, Any]) -> str:
    return f"{'.'.join(map(str, error['loc']))} is {_shortened(error['input'])}: {said(error['msg'])}"


def _shortened(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= 100 else f"{text[:100]}…"


def coverage_key(run: int) -> str:
    """Key of a run's coverage in the table `meta`, where earlier versions ignore unknown keys."""
    return f"coverage.{run}"


def read_coverage(connection: sqlite3.Connection, run: int) -> dict[str, Any] | None:
    """The coverage of a run; None if the file has none.

    Raises:
        ValueError: It is damaged, or too large.
    """
    covered = read_value(connection, coverage_key(run))
    if not isinstance(covered, dict | None):
        raise ValueError(f"the coverage of run {run} is {covered!r}"[:LONGEST_SAID])
    return covered


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
    stored = read_value(connection, CONVERSION)
    return None if stored is None else Conversion.model_validate(stored)


_PREFIX = "marks."
BEFORE = "marks.before"
"""Key of the marks of the fields before the first; in place of numbers they have parities."""
_MOST_FIELDS = 128
_FLOATS = np.dtype("<f4")
_VALUES = 3
"""Column, frame line and area of each mark."""
_LONGEST = 1 << 17
"""Longest value in characters: more than the largest valid group takes."""
_GROUP = f"""SELECT CASE WHEN length(value) <= {_LONGEST} THEN value END FROM meta
    WHERE key BETWEEN 'marks.' AND ? ORDER BY key DESC LIMIT 1"""  # noqa: S608 - constants


_BEFORE = f"SELECT CASE WHEN length(value) <= {_LONGEST} THEN value END FROM meta WHERE key = ?"  # noqa: S608 - constants


def write_marks(connection: sqlite3.Connection, fields: Sequence[tuple[int, Located]]) -> None:
    """Writes the marks of some fields, in order, within the caller's transaction."""
    if fields:
        numbers = [n for n, _ in fields]
        write_meta(connection, {_key(numbers[0]): _encoded(numbers, fields)})


def write_marks_before(connection: sqlite3.Connection, fields: Sequence[tuple[int, Located]]) -> None:
    """Writes parity and marks of the fields before the first, in order, within the caller's transaction."""
    if fields:
        write_meta(connection, {BEFORE: _encoded([parity for parity, _ in fields], fields)})


def _encoded(numbers: list[int], fields: Sequence[tuple[int, Located]]) -> dict[str, Any]:
    data = np.stack([marks for _, marks in fields]).astype(_FLOATS)
    text = base64.b64encode(data.tobytes()).decode()
    return {"n": numbers, "marks": int(data.shape[1]), "data": text}


class RecordedMarks:
    """Reads the marks of a capture file, a group at a time."""

    def __init__(self, path: Path, connection: sqlite3.Connection) -> None:
        self._path = path
        self._connection = connection
        self._group: dict[int, Located] = {}

    def of(self, n: int) -> Located | None:
        """(K, 3) float32 marks of a field; None if the file has none of it.

        Raises:
            CaptureFileError: They are damaged.
        """
        if n not in self._group:
            with reading_errors(self._path):
                row = self._connection.execute(_GROUP, (_key(n),)).fetchone()
                self._group = {} if row is None else dict(_decoded(row[0]))
        return self._group.get(n)

    @property
    def before(self) -> list[tuple[int, Located]]:
        """Parity and marks of the fields before the first, in order.

        Raises:
            CaptureFileError: They are damaged.
        """
        with reading_errors(self._path):
            row = self._connection.execute(_BEFORE, (BEFORE,)).fetchone()
            return [] if row is None else _decoded(row[0])


def _key(n: int) -> str:
    # Padded, so that keys sort like numbers.
    return f"{_PREFIX}{n:010d}"


def _decoded(text: str | None) -> list[tuple[int, Located]]:
    """The marks of a group with the numbers of their fields, or parities.

    Raises:
        ValueError: The group is damaged.
    """
    match read_json(text or ""):
        case {"n": [*numbers], "marks": int(marks), "data": str(data)}:
            return list(zip(numbers, _array(numbers, marks, data), strict=True))
    raise ValueError("a group of marks is none")


def _array(numbers: Sequence[Any], marks: int, data: str) -> NDArray[np.float32]:
    if len(numbers) > _MOST_FIELDS or not 0 < marks <= MOST_MARKS:
        raise ValueError(f"a group of {marks} marks in {len(numbers)} fields")
    if not all(type(n) is int and 0 <= n < LARGEST_N for n in numbers):
        raise ValueError(f"marks of the fields {numbers!r}")
    try:
        values = np.frombuffer(base64.b64decode(data, validate=True), _FLOATS)
        located = values.reshape(len(numbers), marks, _VALUES)
    except (binascii.Error, ValueError) as error:
        raise ValueError(f"a group of marks is damaged: {error}") from error
    if np.isinf(located).any():
        raise ValueError("a mark is infinitely far away")
    return located.astype(np.float32)
