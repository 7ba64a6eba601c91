"""The profiles of a state directory, as commands, HTTP and jobs use them: versions in `state.sqlite` are
added and read, and none is ever changed or removed.

Profiles as people write and read them: YAML text into a checked document and back, changes in words.

A daemon has the quantities of a profile checked in a process of its own: what reads them would stay in it.
"""

import hashlib
import json
import sqlite3
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from textwrap import shorten
from typing import Any, NamedTuple
from unicodedata import normalize

from pydantic import TypeAdapter, ValidationError

from grabberd.archive.state.state_database import StateDatabase
from grabberd.bounded_documents import as_written, parse_yaml, yaml_text
from grabberd.documents.document import JsonObject
from grabberd.errors import Conflict, InputError, NotFound, StorageError
from grabberd.files.reading import read_json
from grabberd.runtime import SystemClock, UtcClock, iso_utc
from grabberd.work.process import Processes
from grabberd_liner.profiles.documents import ProfileContent, ProfileDocument, ProfileRow

QuantityCheck = Callable[[JsonObject], list[str]]
"""Finds the problems of a profile's quantities, each as a sentence with its key."""
_HINT = "docs/howto/profiles.md describes every key; configs/profiles has an example of each kind"
_NAMES = "a name has at most 64 letters, digits, blanks, '.', '_' and '-', and begins with a letter or digit"
_SHOWN = 100


def read_profile(text: str) -> JsonObject:
    """The document in a profile's YAML text, unchecked.

    Raises:
        InputError: It is no YAML, or has no keys.
    """
    try:
        document = parse_yaml(text)
    except ValueError as error:
        raise InputError(f"the profile cannot be read: {' '.join(str(error).split())}", _HINT) from error
    if not isinstance(document, dict):
        raise InputError(f"the profile has no keys: it is {str(document)[:_SHOWN]!r}", _HINT)
    return document


def write_profile(content: Mapping[str, Any]) -> str:
    """A profile's content as YAML text, which `read_profile` reads back."""
    return yaml_text(dict(content), width=100)


def checked_profile(document: Mapping[str, Any], check: QuantityCheck) -> JsonObject:
    """A profile's content: what the document says, without keys that say nothing.

    Args:
        document: The document.
        check: Finds what is wrong with the quantities in it.

    Raises:
        InputError: It is no profile, or has impossible values; the message lists every problem.
    """
    problems, content = _of_form(document)
    problems += check(content or dict(document))
    if problems or content is None:
        name = document.get("name")
        of = f" {name!r}"[:_SHOWN] if isinstance(name, str) else ""
        raise InputError(f"the profile{of} cannot be used: {'; '.join(problems)}", _HINT)
    return content


def plain_name(name: str) -> str:
    """A name or the value of a label as profiles are looked up by: letters with their marks in one character.

    Tablets differ in how they send the letters of other languages than English.
    """
    return normalize("NFC", name)


@cache
def _reader() -> TypeAdapter[Any]:
    return TypeAdapter(ProfileContent)


def _of_form(document: Mapping[str, Any]) -> tuple[list[str], JsonObject | None]:
    """Problems of keys, types and simple limits, and the content if there are none."""
    name = document.get("name")
    document = {**document, "name": plain_name(name)} if isinstance(name, str) else document
    try:
        profile = as_written(document, _reader().validate_python)
    except ValidationError as error:
        return [_in_words(one, document) for one in error.errors()], None
    except ValueError as error:
        return [str(error)], None
    content: JsonObject = profile.model_dump(mode="json", exclude_defaults=True)
    # In the sequence in which people read it; both have no default.
    return [], {"kind": content.pop("kind"), **content}


def _in_words(error: Any, document: Mapping[str, Any]) -> str:
    place = [one for at, one in enumerate(error["loc"]) if at or one != document.get("kind")]
    where = ".".join(str(one) for one in place)
    if error["type"].startswith("union_tag"):
        return f"kind: is {document.get('kind')!r}, expected liner, pulsator, cup or cow"
    if error["type"] == "missing":
        return f"{where}: is missing"
    if error["type"] == "extra_forbidden":
        return f"{where}: unknown key"
    if error["type"] == "value_error":
        return f"{where}: {error['ctx']['error']}"
    shown = shorten(repr(error["input"]), _SHOWN, placeholder=" …")
    said = _NAMES if error["type"] == "string_pattern_mismatch" else error["msg"]
    return f"{where}: {said[0].lower()}{said[1:]}; it is {shown}"


PROBLEMS = "grabberd_liner.chain.analysis.profile_inputs:quantity_problems"
_CHECKED = frozenset({"material", "obtained", "analysis", "pulsation", "liner"})
"""Keys under which there are such quantities."""


def problems_in_process(processes: Processes, content: JsonObject) -> list[str]:
    """Problems of the quantities in a profile's document.

    Raises:
        StorageError: The process cannot be started, or does not answer in time.
    """
    if not _CHECKED & content.keys():
        return []
    # Dates and the like, which YAML knows and JSON does not, are refused as texts as well.
    return processes.ask(PROBLEMS, content, "checks profiles")


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


class ProfileHead(NamedTuple):
    """The newest version of a profile without its content, as in `StoredProfile`."""

    kind: str
    name: str
    version: int
    created_utc: str
    sha256: str
    retired_utc: str | None

    @property
    def place(self) -> tuple[str, str]:
        """Its place in a list; a name may have letters that no cursor has."""
        return self.created_utc, self.sha256


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
            raise NotFound(
                f"the {kind} profile {name} has no version {version}",
                f"it has the versions 1 to {self.newest(kind, name)}",
            )
        return found

    def newest(self, kind: str, name: str) -> int:
        """Number of a profile's newest version; there is every one from 1 on.

        Raises:
            NotFound: There is no such profile.
        """
        query = "SELECT max(version) FROM profiles WHERE kind = ? AND name = ?"
        newest: int | None = self.execute(query, kind, name)[0][0]
        if newest is None:
            raise NotFound(
                f"there is no {kind} profile {name!r}", "grabberd profile list shows those there are"
            )
        return newest

    def heads(self, kind: str | None = None) -> Sequence[ProfileHead]:
        """The newest version of each profile, retired ones included, by kind and name."""
        query = (
            "SELECT kind, name, version, created_utc, sha256, "
            "(SELECT retired_utc FROM retired_profiles AS retired WHERE retired.kind = profiles.kind "
            "AND retired.name = profiles.name) FROM profiles WHERE (?1 IS NULL OR kind = ?1) AND version = "
            "(SELECT max(version) FROM profiles AS others WHERE others.kind = profiles.kind "
            "AND others.name = profiles.name) ORDER BY kind, name"
        )
        return [ProfileHead(*row) for row in self.execute(query, kind)]

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

    def heads(
        self, kind: str | None = None, *, name: str | None = None, retired: bool = False
    ) -> list[ProfileHead]:
        """The newest version of each profile, by kind and name; retired ones only if wanted."""
        named = None if name is None else plain_name(name)
        heads = [one for one in self._store.heads(kind) if named is None or one.name == named]
        return [one for one in heads if retired or one.retired_utc is None]

    def row(self, kind: str, name: str, version: int) -> ProfileRow:
        """A version of a profile as it is listed.

        Raises:
            NotFound: There is none.
        """
        return _row(self._store.get(kind, plain_name(name), version))

    def get(self, kind: str, name: str, version: int | None = None) -> ProfileDocument:
        """A version of a profile, the newest by default.

        Raises:
            NotFound: There is none.
            StorageError: It is not what was stored.
        """
        return _document(self._store.get(kind, plain_name(name), version))

    def versions(self, kind: str, name: str) -> range:
        """Numbers of a profile's versions, the newest first.

        Raises:
            NotFound: There is no such profile.
        """
        return range(self._store.newest(kind, plain_name(name)), 0, -1)

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
