"""What people say of captures after they were made: pins, notes and labels, kept apart from the files."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from grabberd.storage.state.state_database import StateDatabase


@dataclass(frozen=True, slots=True)
class Annotation:
    """Of one capture; `note` and `labels` are None where those in its file stand.

    Attributes:
        pinned: it is kept until somebody unpins it.
    """

    pinned: bool = False
    note: str | None = None
    labels: Mapping[str, str] | None = None


_QUERY = "SELECT capture, pinned, note, labels FROM annotations"


class AnnotationStore:
    """The annotations in `state.sqlite`."""

    def __init__(self, path: Path) -> None:
        self._database = StateDatabase(path)

    def get(self, capture_id: str) -> Annotation:
        """What is said of a capture.

        Raises:
            StorageError: the file cannot be read.
        """
        with self._database.transaction() as connection:
            row = connection.execute(f"{_QUERY} WHERE capture = ?", (capture_id,)).fetchone()
            return Annotation() if row is None else _annotation(row)

    def all(self) -> dict[str, Annotation]:
        """What is said of captures, by their ids.

        Raises:
            StorageError: the file cannot be read.
        """
        with self._database.transaction() as connection:
            return {row[0]: _annotation(row) for row in connection.execute(_QUERY)}

    def put(self, capture_id: str, annotation: Annotation) -> None:
        """Replaces what is said of a capture.

        Raises:
            StorageError: the file cannot be written.
        """
        labels = None if annotation.labels is None else json.dumps(dict(annotation.labels))
        with self._database.transaction() as connection:
            connection.execute(
                "INSERT OR REPLACE INTO annotations VALUES (?, ?, ?, ?)",
                (capture_id, annotation.pinned, annotation.note, labels),
            )

    def remove(self, capture_id: str) -> None:
        """Forgets what is said of a capture; safe where nothing is.

        Raises:
            StorageError: the file cannot be written.
        """
        with self._database.transaction() as connection:
            connection.execute("DELETE FROM annotations WHERE capture = ?", (capture_id,))


def _annotation(row: tuple[Any, ...]) -> Annotation:
    _, pinned, note, labels = row
    return Annotation(bool(pinned), note, None if labels is None else json.loads(labels))
