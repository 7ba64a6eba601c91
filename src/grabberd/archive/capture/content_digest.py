"""Digest of everything that a capture's points are measured from; adding a run does not change it."""

import hashlib
import json
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

from grabberd.archive.capture.content import picture_groups
from grabberd.archive.capture.digests import END, FIELDS_AT_ONCE, some_rows
from grabberd.archive.capture.meta import CaptureMeta, read_conversion
from grabberd.archive.capture.rows import FIELD_COLUMNS
from grabberd.archive.capture.schema import FORMAT_1, connect, format_of, reading_errors

_MARKS = "SELECT key, value FROM meta WHERE key GLOB 'marks.*' ORDER BY key"
_OF_META = ("id", "created_utc", "start_ns", "device", "config", "site", "labels", "note")


def document_sha256(document: Any) -> str:
    """SHA-256 of a JSON document, independent of its layout in a file."""
    return hashlib.sha256(document_bytes(document)).hexdigest()


def document_bytes(document: Any) -> bytes:
    """The canonical form of a JSON document for hashing: sorted keys, no whitespace, UTF-8."""
    text = json.dumps(document, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return text.encode()


def content_sha256(path: Path, meta: CaptureMeta) -> str:
    """SHA-256 of a capture's fields as stored, of the places of its marks, and of its metadata.

    The verdict and everything else written by sealing or a new run is excluded. A converted capture keeps the
    digest of its original format, with which it was compared field by field.

    Raises:
        CaptureFileError: The file is damaged.
        StorageError: The file cannot be read now.
    """
    with reading_errors(path), closing(connect(path)) as connection:
        if (before := read_conversion(connection)) is not None:
            return before.content_sha256
        digest = hashlib.sha256(document_bytes({key: getattr(meta, key) for key in _OF_META}))
        stored = _single_fields if format_of(connection) == FORMAT_1 else _groups
        for head, data in stored(connection):
            # With the length, so that the digest also covers where the data end.
            digest.update(document_bytes({**head, "data": len(data)}))
            digest.update(data)
        for key, value in connection.execute(_MARKS):
            digest.update(document_bytes({key: value}))
    return digest.hexdigest()


def _single_fields(connection: sqlite3.Connection) -> Iterator[tuple[dict[str, Any], bytes]]:
    query = f"SELECT {FIELD_COLUMNS} FROM fields WHERE n > ? ORDER BY n LIMIT ?"  # noqa: S608 - constants
    last_n = -1
    while rows := some_rows(connection.execute(query, (last_n, FIELDS_AT_ONCE))):
        for row in rows:
            *cells, data = row
            yield dict(zip(FIELD_COLUMNS.split(", ")[:-1], cells, strict=True)), data
        last_n = rows[-1][0]


def _groups(connection: sqlite3.Connection) -> Iterator[tuple[dict[str, Any], bytes]]:
    first_n = 0
    while groups := picture_groups(connection, {"first": first_n, "end": END}):
        for group in groups:
            head = group._asdict()
            yield head, head.pop("data")
        first_n = groups[-1].first_n + 1
