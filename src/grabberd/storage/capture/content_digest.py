"""What a capture's points are measured from, as one number: runs that are added do not change it."""

import hashlib
import json
from collections.abc import Mapping
from contextlib import closing
from pathlib import Path
from typing import Any

from grabberd.storage.capture.metadata import CaptureMeta
from grabberd.storage.capture.rows import FIELD_COLUMNS
from grabberd.storage.capture.schema import connect, reading_errors

FIELDS_AT_ONCE = 50
_OF_META = ("id", "created_utc", "start_ns", "device", "config", "site", "labels", "note")


def document_sha256(document: Any) -> str:
    """Of a JSON document, however it was laid out in its file."""
    return hashlib.sha256(document_bytes(document)).hexdigest()


def document_bytes(document: Any) -> bytes:
    """A JSON document in the one way that is hashed: keys in order, no blanks, UTF-8."""
    text = json.dumps(document, sort_keys=True, separators=(",", ":"), ensure_ascii=False)
    return text.encode()


def content_sha256(path: Path, meta: CaptureMeta) -> str:
    """Of a capture's fields as they are stored, and of what it says of itself.

    Raises:
        CaptureFileError: it is damaged.
        StorageError: it cannot be read now.
    """
    digest = hashlib.sha256(document_bytes({key: getattr(meta, key) for key in _OF_META}))
    query = f"SELECT {FIELD_COLUMNS} FROM fields WHERE n > ? ORDER BY n LIMIT ?"  # noqa: S608 - constants
    last_n = -1
    with reading_errors(path), closing(connect(path)) as connection:
        while rows := connection.execute(query, (last_n, FIELDS_AT_ONCE)).fetchall():
            for row in rows:
                cells: Mapping[str, Any] = dict(zip(FIELD_COLUMNS.split(", "), row, strict=True))
                data = cells["data"]
                digest.update(document_bytes({**cells, "data": len(data)}))
                digest.update(data)
            last_n = rows[-1][0]
    return digest.hexdigest()
