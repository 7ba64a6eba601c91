"""Annotations of captures made after recording, stored apart from the files: pins, notes, labels, marks."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from grabberd.archive.state.state_database import StateDatabase


@dataclass(frozen=True, slots=True)
class Annotation:
    """Annotation of one capture.

    Attributes:
        pinned: True if retention must not remove the capture.
        note: Note in place of the one in the file; None to leave that one.
        labels: Labels in place of those in the file; None to leave those.
        marks: Names of marked fields by their numbers.
    """

    pinned: bool = False
    note: str | None = None
    labels: Mapping[str, str] | None = None
    marks: Mapping[int, str] = field(default_factory=dict)


_QUERY = "SELECT capture, pinned, note, labels, marks FROM annotations"


class AnnotationStore(StateDatabase):
    """The annotations in `state.sqlite`."""

    def get(self, capture_id: str) -> Annotation:
        """The annotation of a capture, an empty one if there is none."""
        with self.errors():
            rows = self.execute(f"{_QUERY} WHERE capture = ?", capture_id)
            return _annotation(rows[0]) if rows else Annotation()

    def all(self) -> dict[str, Annotation]:
        """All annotations by capture id."""
        with self.errors():
            return {row[0]: _annotation(row) for row in self.execute(_QUERY)}

    def put(self, capture_id: str, annotation: Annotation) -> None:
        """Replaces the annotation of a capture."""
        labels = None if annotation.labels is None else json.dumps(dict(annotation.labels))
        marks = json.dumps(dict(annotation.marks)) if annotation.marks else None
        row = (capture_id, annotation.pinned, annotation.note, labels, marks)
        self.execute("INSERT OR REPLACE INTO annotations VALUES (?, ?, ?, ?, ?)", *row)

    def remove(self, capture_id: str) -> None:
        """Removes the annotation of a capture, if there is one."""
        self.execute("DELETE FROM annotations WHERE capture = ?", capture_id)


def _annotation(row: tuple[Any, ...]) -> Annotation:
    _, pinned, note, labels, marks = row
    named = {int(n): name for n, name in json.loads(marks or "{}").items()}
    return Annotation(bool(pinned), note, None if labels is None else json.loads(labels), named)
