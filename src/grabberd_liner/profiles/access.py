"""Profiles as the commands reach them: in a state directory, or through a daemon."""

from pathlib import Path
from urllib.parse import quote

from grabberd.cli.options import load
from grabberd.client.daemon import Daemon
from grabberd.documents.document import JsonObject
from grabberd_liner.profiles.profiles import KINDS, Profiles, plain_name, write_profile

PROFILES = "/api/v1/profiles"
_CHECKED_WITHIN_S = 120.0
"""Time for an answer: a busy daemon starts a process that checks a profile, and fields come first."""


class LocalProfiles:
    """The profiles in a state directory, which a daemon may be using."""

    def __init__(self, profiles: Profiles) -> None:
        self._profiles = profiles

    def rows(self, kind: str | None, retired: bool) -> list[JsonObject]:
        """The newest version of each profile."""
        heads = self._profiles.heads(kind, retired=retired)
        return [self._row(one.kind, one.name, one.version) for one in heads]

    def get(self, kind: str, name: str, version: int | None) -> JsonObject:
        """A version of a profile, the newest by default."""
        return self._profiles.get(kind, name, version).model_dump(mode="json")

    def versions(self, kind: str, name: str) -> list[JsonObject]:
        """All versions of a profile, the newest first."""
        return [self._row(kind, name, one) for one in self._profiles.versions(kind, name)]

    def put(self, document: JsonObject) -> tuple[JsonObject, bool]:
        """Stores a profile's next version; returns the newest one, and whether it is new."""
        stored = self._profiles.put(document)
        return stored.document.model_dump(mode="json"), stored.is_new

    def retire(self, kind: str, name: str) -> JsonObject:
        """Takes a profile out of use."""
        return self._profiles.retire(kind, name).model_dump(mode="json")

    def _row(self, kind: str, name: str, version: int) -> JsonObject:
        return self._profiles.row(kind, name, version).model_dump(mode="json")


class DaemonProfiles:
    """The profiles of a running daemon, which may be on another computer."""

    def __init__(self, daemon: Daemon) -> None:
        self._daemon = daemon

    def rows(self, kind: str | None, retired: bool) -> list[JsonObject]:
        """The newest version of each profile."""
        query = [("retired", str(retired).lower()), *([("kind", kind)] if kind else [])]
        rows = self._daemon.rows(PROFILES, "profiles", *query, timeout_s=_CHECKED_WITHIN_S)
        return sorted(rows, key=lambda row: (row["kind"], row["name"]))

    def get(self, kind: str, name: str, version: int | None) -> JsonObject:
        """A version of a profile, the newest by default."""
        return self._asked(_address(kind, name) + (f"/versions/{version}" if version else ""))

    def versions(self, kind: str, name: str) -> list[JsonObject]:
        """All versions of a profile, the newest first."""
        address = f"{_address(kind, name)}/versions"
        return list(self._daemon.rows(address, "versions", timeout_s=_CHECKED_WITHIN_S))

    def put(self, document: JsonObject) -> tuple[JsonObject, bool]:
        """Stores a profile's next version; returns the newest one, and whether it is new."""
        kind, name = document.get("kind"), document.get("name")
        # As text: YAML has values, such as dates, that JSON has not, and the daemon says what is wrong.
        body = {"yaml": write_profile(document)}
        if kind not in KINDS or not isinstance(name, str) or not name:
            return self._asked(PROFILES, "POST", body), True  # it has no address; the daemon says all of it
        before = [one for one in self.rows(str(kind), retired=True) if one["name"] == plain_name(name)]
        after = before[0]["version"] if before else 0
        stored = self._asked(_address(str(kind), name), "PUT", {**body, "after": after})
        return stored, stored["version"] != after

    def retire(self, kind: str, name: str) -> JsonObject:
        """Takes a profile out of use."""
        return self._asked(_address(kind, name), "DELETE")

    def _asked(self, path: str, method: str = "GET", body: object = None) -> JsonObject:
        return self._daemon.ask(path, method, body, _CHECKED_WITHIN_S)


ProfileAccess = LocalProfiles | DaemonProfiles
"""Access to profiles, whose documents are those of the API."""


def profile_access(config: Path | None, url: str | None, token_file: Path | None) -> ProfileAccess:
    """The profiles of the daemon at an address, or those of the configuration's state directory."""
    if url is not None:
        return DaemonProfiles(Daemon(url, token_file))
    return LocalProfiles(local_profiles(config))


def local_profiles(config: Path | None) -> Profiles:
    """The profiles of the configuration's state directory.

    Raises:
        StorageError: They cannot be used.
    """
    from grabberd.archive.state.state_keeper import STATE, StateBackups  # noqa: PLC0415
    from grabberd_liner.chain.analysis.profile_inputs import quantity_problems  # noqa: PLC0415 - heavy

    directory = load(config).state_directory
    StateBackups(directory).check()
    profiles = Profiles(directory / STATE, quantity_problems)
    profiles.open()
    return profiles


def labels_of_file(capture: Path, config: Path | None) -> dict[str, str]:
    """Labels of a capture: those it was given later in the configuration's daemon, else those in its file.

    Raises:
        CaptureFileError: The capture cannot be read.
        StorageError: The state cannot be read.
    """
    from grabberd.archive.capture.reader import CaptureReader  # noqa: PLC0415
    from grabberd.archive.state.state_database import AnnotationStore  # noqa: PLC0415
    from grabberd.archive.state.state_keeper import STATE  # noqa: PLC0415

    with CaptureReader(capture) as reader:
        meta = reader.meta
    annotated = AnnotationStore(load(config).state_directory / STATE).get(meta.id).labels
    return dict(meta.labels if annotated is None else annotated)


def _address(kind: str, name: str) -> str:
    return f"{PROFILES}/{quote(kind, safe='')}/{quote(name, safe='')}"
