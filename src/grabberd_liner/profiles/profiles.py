"""The profiles of a state directory, as commands, HTTP and jobs use them."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from grabberd.clock import SystemClock, UtcClock, iso_utc
from grabberd.documents.named_types import JsonObject
from grabberd.errors import InputError, StorageError
from grabberd_liner.profiles.documents import ProfileDocument, ProfileRow, ProfileVersions
from grabberd_liner.profiles.profile_text import QuantityCheck, checked_profile, plain_name, write_profile
from grabberd_liner.profiles.store import ProfileStore, StoredProfile

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
