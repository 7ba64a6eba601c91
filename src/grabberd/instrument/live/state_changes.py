"""Changes of a JSON document since the version that a client has seen."""

from collections import deque
from typing import Any, NamedTuple

from grabberd.documents.named_types import JsonObject

KEPT = 150
"""At five versions a second, a client that reconnects within half a minute gets the changes alone."""


def changes(before: JsonObject, after: JsonObject) -> JsonObject:
    """The keys whose values differ, with their new values, recursively.

    The result is a JSON merge patch (RFC 7396): a key that is gone, or has become null, is null.
    """
    gone = {key: None for key in before if key not in after}
    return gone | {
        key: _change(before.get(key), value) for key, value in after.items() if _differs(key, before, value)
    }


def merged(document: JsonObject, change: JsonObject) -> JsonObject:
    """Applies a change to a document; null values stay, to distinguish them from keys that never existed."""
    result = dict(document)
    for key, value in change.items():
        known = result.get(key)
        inner = known if isinstance(known, dict) else {}
        result[key] = merged(inner, value) if isinstance(value, dict) else value
    return result


class Version(NamedTuple):
    """A document and its version number, from 1."""

    number: int
    document: JsonObject


class History:
    """The latest versions of a document."""

    def __init__(self, kept: int = KEPT) -> None:
        self._versions: deque[Version] = deque(maxlen=kept)

    def enter(self, document: JsonObject) -> Version | None:
        """Adds the present document as a new version; returns None if it has not changed."""
        newest = self._versions[-1] if self._versions else Version(0, {})
        if document == newest.document:
            return None
        self._versions.append(Version(newest.number + 1, document))
        return self._versions[-1]

    def find(self, number: int) -> Version | None:
        """A version by its number; None if it has been dropped."""
        return next((version for version in list(self._versions) if version.number == number), None)


def _differs(key: str, before: JsonObject, value: Any) -> bool:
    return key not in before or before[key] != value


def _change(before: Any, after: Any) -> Any:
    both = isinstance(before, dict) and isinstance(after, dict)
    return changes(before, after) if both else after
