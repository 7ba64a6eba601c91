"""Backup of `state.sqlite` and the stored calibrations, which cannot be rebuilt, in one file with checksums.

A backup is a ZIP file. Its `manifest.json` has the version of the format, the time, the program's version,
and the SHA-256 of every other member: `state.sqlite` and `calibrations/ID/NAME`.
"""

import hashlib
import json
import os
import re
import sqlite3
import tempfile
import zipfile
import zlib
from collections.abc import Collection, Iterator, Mapping
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple

from grabberd import runtime
from grabberd.archive.guarded_database import open_tables, read_header
from grabberd.archive.state.state_database import MIGRATIONS, copy_of, tables_of
from grabberd.archive.state.state_keeper import CAPTURES_FOLDER, ORIGIN
from grabberd.bounded_documents import LARGEST_DOCUMENT
from grabberd.errors import InputError, StorageError
from grabberd.files import disk
from grabberd.files.reading import read_json

SCHEMA, VERSION = "grabberd/backup", 1
MANIFEST, STATE, CALIBRATIONS = "manifest.json", "state.sqlite", "calibrations"
# A crash may have left a journal; SQLite would apply it to the restored database.
JOURNAL = f"{STATE}-journal"
REPLACED = "replaced-"
LARGEST_MEMBER = 64 << 20
LARGEST_BACKUP = 512 << 20
"""Limit in bytes for all members together, and for the file."""
MOST_MEMBERS = 10_000
_MEMBER = re.compile(rf"{STATE}|{CALIBRATIONS}/[0-9A-Za-z_-]{{1,80}}/[0-9A-Za-z][0-9A-Za-z_.-]{{0,80}}")

_NO_BACKUP = (
    *(OSError, EOFError, RuntimeError, zlib.error, zipfile.BadZipFile),  # raised by zipfile for damaged files
    *(ValueError, KeyError, TypeError, AttributeError),
)


class BackupInfo(NamedTuple):
    """Contents of a backup: its time, the version that made it, and the number of calibrations."""

    created_utc: str
    version: str
    calibrations: int


def back_up(directory: Path, out: Path, created_utc: str, version: str) -> BackupInfo:
    """Writes a backup of a state directory, which a daemon may be using.

    Args:
        directory: State directory.
        out: File to create, readable by its owner alone.
        created_utc: Present time in ISO 8601.
        version: Version of this program.

    Raises:
        StorageError: `out` exists or cannot be written, or the state cannot be read.
    """
    members = dict(_members(directory))
    _check_limits(out, members)
    manifest = {
        "schema": f"{SCHEMA}/{VERSION}",
        "created_utc": created_utc,
        "version": version,
        "sha256": {name: _sha256(content) for name, content in members.items()},
    }
    document = json.dumps(manifest, indent=1).encode()
    part = out.with_name(f".{out.name}.part")
    with disk.storage_errors(out):
        if out.exists():
            raise StorageError(f"{out} exists already", "name another file; nothing is overwritten")
        try:
            _write_zip(part, {MANIFEST: document, **members})
            runtime.rename(part, out)
        finally:
            part.unlink(missing_ok=True)
    return _info(manifest)


def restore(directory: Path, backup: Path, now: str) -> tuple[BackupInfo, Path | None]:
    """Replaces the state and the calibrations of a state directory with those of a backup.

    The previous state is kept in a folder `replaced-TIME` of the state directory. Captures are not affected.

    Args:
        directory: State directory that no daemon is using.
        backup: Backup file, which is checked completely before anything is changed.
        now: Present time in a form suitable for a file name.

    Returns:
        Contents of the backup, and the folder with the previous state; None if there was none.

    Raises:
        InputError: The file is damaged, not a backup, or of a later version.
        StorageError: A daemon is using the directory, or it cannot be written.
    """
    manifest, members = _read(backup)
    _check_state(members[STATE], backup)
    lock = disk.DirectoryLock(directory)
    lock.acquire()
    try:
        disk.clear_scratch(directory)
        with disk.storage_errors(directory), disk.scratch_folder(directory) as scratch:
            _write_members(scratch, members)
            _forget_surroundings(scratch / STATE)
            replaced = _keep(directory, directory / f"{REPLACED}{now}")
            runtime.rename(scratch / CALIBRATIONS, directory / CALIBRATIONS)
            runtime.replace(scratch / STATE, directory / STATE)
            disk.sync_directory(directory)
    finally:
        lock.release()
    return _info(manifest), replaced


def _check_limits(out: Path, members: Mapping[str, bytes]) -> None:
    """Refuses a backup that could not be restored."""
    sizes = [len(content) for content in members.values()]
    if len(sizes) > MOST_MEMBERS or max(sizes) > LARGEST_MEMBER or sum(sizes) > LARGEST_BACKUP:
        raise StorageError(
            f"{out} would have {len(sizes)} members of {sum(sizes)} bytes, the largest {max(sizes)}; "
            f"at most {MOST_MEMBERS} of {LARGEST_BACKUP} bytes, each {LARGEST_MEMBER}, can be restored",
            "move old calibrations out of the state directory",
        )


def _members(directory: Path) -> Iterator[tuple[str, bytes]]:
    with disk.storage_errors(directory):
        yield STATE, _database(directory / STATE)
        for file in sorted((directory / CALIBRATIONS).glob("*/*")):
            name = file.relative_to(directory).as_posix()
            if file.is_file() and _MEMBER.fullmatch(name):  # skips files left incomplete by a crash
                yield name, file.read_bytes()


def _database(path: Path) -> bytes:
    try:
        return copy_of(path, "ro")
    except sqlite3.DatabaseError as error:
        raise StorageError(
            f"{path} cannot be backed up: {error}",
            "name the configuration of a daemon that has run before, and run it as its user",
        ) from error


def _write_zip(path: Path, members: Mapping[str, bytes]) -> None:
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_TRUNC, disk.OWNER_ONLY)
    with os.fdopen(descriptor, "w+b") as file:
        with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, content in members.items():
                archive.writestr(name, content)
        file.flush()
        runtime.fsync(file.fileno())


def _read(path: Path) -> tuple[dict[str, Any], dict[str, bytes]]:
    """The manifest and the members, with verified checksums."""
    try:
        if path.stat().st_size > LARGEST_BACKUP:
            raise ValueError(f"it has more than {LARGEST_BACKUP} bytes")
        with zipfile.ZipFile(path) as archive:
            manifest = read_json(_member(archive, MANIFEST, LARGEST_DOCUMENT).decode())
            _check_version(manifest, path)
            members = _members_of(archive, manifest["sha256"])
        wrong = [name for name, content in members.items() if _sha256(content) != manifest["sha256"][name]]
        strange = [name for name in members if not _MEMBER.fullmatch(name)]
        if wrong or strange or STATE not in members:
            raise ValueError(f"wrong members: {', '.join(wrong or strange) or STATE}")
        _info(manifest)
    except FileNotFoundError as error:
        raise InputError(f"there is no backup {path}", "check the file's name") from error
    except _NO_BACKUP as error:
        raise InputError(
            f"{path} cannot be restored: it is damaged, or not a backup ({error})",
            "nothing has been changed; take another backup, or copy this one again",
        ) from error
    return manifest, members


def _members_of(archive: zipfile.ZipFile, names: Collection[str]) -> dict[str, bytes]:
    members: dict[str, bytes] = {}
    if len(names) > MOST_MEMBERS:
        raise ValueError(f"it has {len(names)} members, more than {MOST_MEMBERS}")
    left = LARGEST_BACKUP
    for name in names:
        members[name] = _member(archive, name, min(left, LARGEST_MEMBER))
        left -= len(members[name])
    return members


def _member(archive: zipfile.ZipFile, name: str, most: int) -> bytes:
    """Reads a member up to a limit, regardless of its stated length."""
    if archive.getinfo(name).compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        raise ValueError(f"{name} is compressed by another method")  # LZMA allocates as much memory as stated
    with archive.open(name) as file:
        content = file.read(most + 1)
    if len(content) > most:
        raise ValueError(f"{name} has more than {most} bytes")
    return content


def _check_version(manifest: Mapping[str, Any], path: Path) -> None:
    name, _, version = manifest["schema"].rpartition("/")
    if name != SCHEMA:
        raise ValueError(f"its schema is {manifest['schema']!r}")
    if int(version) > VERSION:
        raise InputError(
            f"{path} is a backup of version {version}, this program reads up to {VERSION}",
            "use a newer grabberd",
        )


def _check_state(content: bytes, backup: Path) -> None:
    """Checks that the database is intact, has the known tables and values, and is not of a later version."""
    # In a temporary file, because guarded databases are opened by path.
    with disk.storage_errors(backup), tempfile.TemporaryDirectory(prefix="grabberd-restore-") as folder:
        state = Path(folder, STATE)
        state.write_bytes(content)
        _check_database(state, backup)


def _check_database(state: Path, backup: Path) -> None:
    try:
        version = read_header(state).user_version
        if version <= len(MIGRATIONS):
            with closing(open_tables(state, tables_of(version))) as connection:
                _check_content(connection)
            return
    except (sqlite3.Error, ValueError) as error:
        raise InputError(f"{backup}: its {STATE} is damaged: {error}", "take another backup") from error
    known = f"this program knows up to {len(MIGRATIONS)}"
    raise InputError(f"{backup}: its {STATE} is of version {version}, {known}", "use a newer grabberd")


def _check_content(connection: sqlite3.Connection) -> None:
    """Checks every page, and the JSON values that the daemon reads at its start."""
    whole = connection.execute("PRAGMA integrity_check").fetchone()[0]
    if whole != "ok":
        raise ValueError(whole)
    for (value,) in connection.execute("SELECT value FROM settings"):
        read_json(value)


def _write_members(folder: Path, members: Mapping[str, bytes]) -> None:
    (folder / CALIBRATIONS).mkdir()
    for name, content in members.items():
        path = folder / name
        path.parent.mkdir(exist_ok=True)
        disk.write_synced(path, content, disk.OWNER_ONLY if name == STATE else disk.READ_ONLY)


def _forget_surroundings(state: Path) -> None:
    """Removes the id of the captures folder and the origin, which do not apply to the restored state."""
    with closing(runtime.connect(state)) as connection, connection:
        connection.execute("DELETE FROM settings WHERE key IN (?, ?)", (CAPTURES_FOLDER, ORIGIN))


def _keep(directory: Path, folder: Path) -> Path | None:
    """Moves the present state aside; `state.sqlite` is only linked, so that it exists at any time."""
    present = [name for name in (JOURNAL, STATE, CALIBRATIONS) if (directory / name).exists()]
    if not present:
        return None
    folder.mkdir()
    for name in present:
        (runtime.link if name == STATE else runtime.rename)(directory / name, folder / name)
    return folder


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def _info(manifest: Mapping[str, Any]) -> BackupInfo:
    folders = {name.split("/")[1] for name in manifest["sha256"] if name.startswith(CALIBRATIONS)}
    return BackupInfo(str(manifest["created_utc"]), str(manifest["version"]), len(folders))
