"""The profiles of a state directory, as commands, HTTP and jobs use them: versions in `state.sqlite` are
added and read, and none is ever changed or removed.
"""

import hashlib
import json
import sqlite3
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from grabberd.archive.state.state_database import StateDatabase
from grabberd.clock import SystemClock, UtcClock, iso_utc
from grabberd.documents.document import JsonObject
from grabberd.errors import Conflict, InputError, NotFound, StorageError
from grabberd.files.json_value import read_json
from grabberd_liner.profiles.documents import ProfileDocument, ProfileRow, ProfileVersions
from grabberd_liner.profiles.profile_text import QuantityCheck, checked_profile, plain_name, write_profile

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
        return read_json(self.text)


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


KINDS = ("liner", "pulsator", "cup", "cow")


class Stored(NamedTuple):
    """Outcome of storing a profile: its newest version, and whether that is a new one."""

    document: ProfileDocument
    is_new: bool


class FoundProfiles(NamedTuple):
    """Labels of a capture, and the newest versions of the profiles in use that they name."""

    labels: Mapping[str, str]
    profiles: Sequence[ProfileDocument]


class Profiles:
    """Reads, stores and retires profiles; any thread may call, and other programs beside the daemon.

    Args:
        state: The state database.
        check: Finds problems of a profile's quantities.
        clock: Source of time.
        heal: Recovers a damaged state database; see `StateDatabase`.
    """

    def __init__(
        self,
        state: Path,
        check: QuantityCheck,
        clock: UtcClock | None = None,
        heal: Callable[[str], None] | None = None,
    ) -> None:
        self._store = ProfileStore(state, heal)
        self._check = check
        self._clock = clock or SystemClock()

    def open(self) -> None:
        """Creates the store if it does not exist; safe twice.

        Raises:
            StorageError: It cannot be used.
        """
        self._store.open()

    def rows(
        self, kind: str | None = None, *, name: str | None = None, retired: bool = False
    ) -> list[ProfileRow]:
        """The newest version of each profile, by kind and name; retired ones only if wanted."""
        named = None if name is None else plain_name(name)
        rows = [one for one in self._store.list(kind) if named is None or one.name == named]
        return [_row(one) for one in rows if retired or one.retired_utc is None]

    def get(self, kind: str, name: str, version: int | None = None) -> ProfileDocument:
        """A version of a profile, the newest by default.

        Raises:
            NotFound: There is none.
            StorageError: It is not what was stored.
        """
        return _document(self._store.get(kind, plain_name(name), version))

    def versions(self, kind: str, name: str) -> ProfileVersions:
        """All versions of a profile, the newest first.

        Raises:
            NotFound: There is no such profile.
        """
        return ProfileVersions(versions=[_row(one) for one in self._store.versions(kind, plain_name(name))])

    def put(self, document: JsonObject, *, after: int | None = None) -> Stored:
        """Stores a profile's next version, unless its content is that of the newest.

        Args:
            document: The profile.
            after: Version that has to be the newest, 0 for none; None: whatever version there is.

        Raises:
            InputError: The document is no profile, or has impossible values; all problems are listed.
            Conflict: Another version is the newest.
        """
        content = checked_profile(document, self._check)
        now_utc = iso_utc(self._clock.utc_now())
        kind, name = content["kind"], content["name"]
        before = self._store.find(kind, name)
        stored = self._store.put(kind, name, content, now_utc, after=after)
        return Stored(_document(stored), before is None or before.version != stored.version)

    def retire(self, kind: str, name: str) -> ProfileDocument:
        """Takes a profile out of use: no label finds it any longer, all its versions stay readable.

        Raises:
            NotFound: There is no such profile.
        """
        return _document(self._store.retire(kind, plain_name(name), iso_utc(self._clock.utc_now())))

    def of_labels(self, labels: Mapping[str, str]) -> FoundProfiles:
        """The profiles in use that a capture's labels name, each by its newest version.

        Raises:
            StorageError: One of them is not what was stored.
        """
        found = (self._store.find(kind, plain_name(labels[kind])) for kind in KINDS if kind in labels)
        in_use = [one for one in found if one is not None and one.retired_utc is None]
        return FoundProfiles(dict(labels), [_document(one) for one in in_use])


def check_name(document: JsonObject, kind: str, name: str) -> None:
    """Checks that a document is of the profile that an address names.

    Raises:
        InputError: It is of another one.
    """
    own_kind, own_name = document.get("kind"), document.get("name")
    if (own_kind, plain_name(str(own_name))) != (kind, plain_name(name)):
        raise InputError(
            f"the document is of the {own_kind} profile {own_name!r}, the address of the {kind} {name!r}",
            "a profile is never renamed: store it under its own name, and retire the other one",
        )


def _row(stored: StoredProfile) -> ProfileRow:
    note = "" if stored.problem else str(stored.content.get("note", ""))
    return ProfileRow(**_of_row(stored), note=note, problem=stored.problem)


def _document(stored: StoredProfile) -> ProfileDocument:
    if stored.problem:
        raise StorageError(stored.problem, "store it again, or restore a backup: grabberd restore")
    content = stored.content
    return ProfileDocument(
        **_of_row(stored),
        note=str(content.get("note", "")),
        problem=None,
        profile=content,
        yaml=write_profile(content),
    )


def _of_row(stored: StoredProfile) -> JsonObject:
    return {
        "kind": stored.kind,
        "name": stored.name,
        "version": stored.version,
        "newest": stored.newest,
        "created_utc": stored.created_utc,
        "retired_utc": stored.retired_utc,
        "sha256": stored.sha256,
    }
