"""Profiles in `state.sqlite`: versions are added and read, and none is ever changed or removed."""

import hashlib
import json
import sqlite3
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from grabberd.archive.state.state_database import StateDatabase
from grabberd.errors import Conflict, InputError, NotFound
from grabberd.files.json_value import read_json

LARGEST_BYTES = 64 << 10
"""Bytes of a profile; a liner with a zone for each of 60 rows has half of it."""
_COLUMNS = (
    "profiles.kind, profiles.name, version, created_utc, sha256, content, "
    "(SELECT max(version) FROM profiles AS others WHERE others.kind = profiles.kind "
    "AND others.name = profiles.name), "
    "(SELECT retired_utc FROM retired_profiles AS retired WHERE retired.kind = profiles.kind "
    "AND retired.name = profiles.name)"
)
_OF_ONE = f"SELECT {_COLUMNS} FROM profiles WHERE kind = ? AND name = ?"  # noqa: S608 - no value from outside


class StoredProfile(NamedTuple):
    """A version of a profile.

    Attributes:
        kind: Its kind; `name`: its name among those of the kind.
        version: Number from 1.
        created_utc: Time when it was stored, ISO 8601.
        sha256: SHA-256 of its text, in hexadecimal.
        text: Its content as JSON.
        newest: Number of the newest version.
        retired_utc: Time when the profile was retired; None if it is in use.
    """

    kind: str
    name: str
    version: int
    created_utc: str
    sha256: str
    text: str
    newest: int
    retired_utc: str | None

    @property
    def problem(self) -> str | None:
        """Reason why it cannot be used: its content is not what was stored; None if it is."""
        if _sha256(self.text) == self.sha256:
            return None
        return f"version {self.version} of the {self.kind} profile {self.name} is not what was stored"

    @property
    def content(self) -> dict[str, Any]:
        """Its content.

        Raises:
            ValueError: It is damaged.
        """
        if self.problem:
            raise ValueError(self.problem)
        content: dict[str, Any] = read_json(self.text)
        return content


class ProfileStore(StateDatabase):
    """The profiles in `state.sqlite`. Times are ISO 8601 UTC in one format: they sort as text."""

    def put(
        self, kind: str, name: str, content: Mapping[str, Any], now_utc: str, *, after: int | None = None
    ) -> StoredProfile:
        """Stores a profile's next version, unless the newest one has the same content; brings it back in use.

        Args:
            kind: Its kind.
            name: Its name.
            content: Its content.
            now_utc: Present time.
            after: Version that has to be the newest, 0 for none; None: whatever version there is.

        Raises:
            InputError: The content is too large, or cannot be written as JSON.
            Conflict: Another version is the newest.
        """
        text = _text(content)
        with self.transaction() as connection:
            # The write lock comes before the newest version is read: another program may be adding one.
            connection.execute("BEGIN IMMEDIATE")
            versions = _rows(connection, f"{_OF_ONE} ORDER BY version DESC LIMIT 1", kind, name)
            newest = versions[0].version if versions else 0
            if after is not None and after != newest:
                raise _conflict(kind, name, newest, after)
            connection.execute("DELETE FROM retired_profiles WHERE kind = ? AND name = ?", (kind, name))
            if not versions or not _is_same(versions[0], content):
                row = (kind, name, newest + 1, now_utc, _sha256(text), text)
                connection.execute("INSERT INTO profiles VALUES (?, ?, ?, ?, ?, ?)", row)
            return _rows(connection, f"{_OF_ONE} ORDER BY version DESC LIMIT 1", kind, name)[0]

    def find(self, kind: str, name: str, version: int | None = None) -> StoredProfile | None:
        """A version of a profile, the newest by default; None if there is none."""
        if version is None:
            rows = self.execute(f"{_OF_ONE} ORDER BY version DESC LIMIT 1", kind, name)
        else:
            rows = self.execute(f"{_OF_ONE} AND version = ?", kind, name, version)
        return StoredProfile(*rows[0]) if rows else None

    def get(self, kind: str, name: str, version: int | None = None) -> StoredProfile:
        """A version of a profile, the newest by default.

        Raises:
            NotFound: There is no such profile, or no such version of it.
        """
        found = self.find(kind, name, version)
        if found is None:
            known = [one.version for one in self.versions(kind, name)]
            raise NotFound(
                f"the {kind} profile {name} has no version {version}",
                f"it has the versions 1 to {known[0]}",
            )
        return found

    def versions(self, kind: str, name: str) -> Sequence[StoredProfile]:
        """All versions of a profile, the newest first.

        Raises:
            NotFound: There is no such profile.
        """
        rows = self.execute(f"{_OF_ONE} ORDER BY version DESC", kind, name)
        if not rows:
            raise NotFound(
                f"there is no {kind} profile {name!r}", "grabberd profile list shows those there are"
            )
        return [StoredProfile(*row) for row in rows]

    def list(self, kind: str | None = None) -> Sequence[StoredProfile]:
        """The newest version of each profile, retired ones included, by kind and name."""
        query = (
            f"SELECT {_COLUMNS} FROM profiles WHERE (?1 IS NULL OR kind = ?1) AND version = "  # noqa: S608
            "(SELECT max(version) FROM profiles AS others WHERE others.kind = profiles.kind "
            "AND others.name = profiles.name) ORDER BY kind, name"
        )
        return [StoredProfile(*row) for row in self.execute(query, kind)]

    def retire(self, kind: str, name: str, now_utc: str) -> StoredProfile:
        """Takes a profile out of use; safe twice. Its versions stay.

        Raises:
            NotFound: There is no such profile.
        """
        self.get(kind, name)
        self.execute("INSERT OR IGNORE INTO retired_profiles VALUES (?, ?, ?)", kind, name, now_utc)
        return self.get(kind, name)


def _rows(connection: sqlite3.Connection, query: str, *values: object) -> Sequence[StoredProfile]:
    return [StoredProfile(*row) for row in connection.execute(query, values).fetchall()]


def _is_same(stored: StoredProfile, content: Mapping[str, Any]) -> bool:
    return stored.problem is None and stored.content == content


def _conflict(kind: str, name: str, newest: int, after: int) -> Conflict:
    if after == 0:
        return Conflict(
            f"there is a {kind} profile {name} already, in version {newest}",
            "choose another name, or store the next version of that one: PUT, or grabberd profile add",
        )
    return Conflict(
        f"version {newest} of the {kind} profile {name} is the newest, not {after}: it was changed meanwhile",
        "look at the newest version and make your change again",
    )


def _text(content: Mapping[str, Any]) -> str:
    try:
        text = json.dumps(content, ensure_ascii=False, allow_nan=False)
        size = len(text.encode())
    except ValueError as error:
        raise InputError(
            f"the profile cannot be written as JSON: {error}", "fix the value that the message names"
        ) from error
    if size > LARGEST_BYTES:
        raise InputError(
            f"the profile has {size} bytes, at most {LARGEST_BYTES} are possible", "shorten its notes"
        )
    return text


def _sha256(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
