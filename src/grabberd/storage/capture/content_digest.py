"""Digest of what a capture's points are measured from; adding a run does not change it."""

import hashlib
import json
from collections.abc import Mapping
from contextlib import closing
from pathlib import Path
from typing import Any

from grabberd.storage.capture.checked_rows import FIELDS_AT_ONCE, some_rows
from grabberd.storage.capture.meta import CaptureMeta
from grabberd.storage.capture.rows import FIELD_COLUMNS
from grabberd.storage.capture.schema import connect, reading_errors

_OF_META = ("id", "created_utc", "start_ns", "device", "config", "site", "labels", "note")


def document_sha256(document: Any) -> str:
    """SHA-256 of a JSON document, independent of its layout in a file."""
    return hashlib.sha256(document_bytes(document)).hexdigest()


def document_bytes(document: Any) -> bytes:
    """The canonical form of a JSON document, which is hashed: sorted keys, no blanks, UTF-8."""
    text = json.dumps(document, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return text.encode()


def content_sha256(path: Path, meta: CaptureMeta) -> str:
    """SHA-256 of a capture's fields as they are stored, and of its metadata.

    The verdict and everything else that sealing or a new run writes is left out.

    Raises:
        CaptureFileError: It is damaged.
        StorageError: It cannot be read now.
    """
    digest = hashlib.sha256(document_bytes({key: getattr(meta, key) for key in _OF_META}))
    query = f"SELECT {FIELD_COLUMNS} FROM fields WHERE n > ? ORDER BY n LIMIT ?"  # noqa: S608 - constants
    last_n = -1
    with reading_errors(path), closing(connect(path)) as connection:
        while rows := some_rows(connection.execute(query, (last_n, FIELDS_AT_ONCE))):
            for row in rows:
                cells: Mapping[str, Any] = dict(zip(FIELD_COLUMNS.split(", "), row, strict=True))
                data = cells["data"]
                # The length first, so that the digest fixes where the data of a field end.
                digest.update(document_bytes({**cells, "data": len(data)}))
                digest.update(data)
            last_n = rows[-1][0]
    return digest.hexdigest()
