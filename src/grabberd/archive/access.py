"""Access: tokens with roles, the browser sessions they are traded for, and the machine key.

Only digests of secrets are stored. Who holds a token is remembered, because the event loop asks and must not
wait for a disk.
"""

import errno
import hashlib
import hmac
import logging
import os
import re
import secrets
import weakref
from collections import OrderedDict
from collections.abc import Callable, Hashable
from contextlib import suppress
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from typing import Generic, Literal, TypeVar

from grabberd import runtime
from grabberd.archive.state.state_database import GUARDED, Holder, TokenRow, TokenStore
from grabberd.documents.enums import Role
from grabberd.errors import AccessExpired, Conflict, InputError, StorageError
from grabberd.files.disk import OWNER_ONLY
from grabberd.runtime import SystemClock, UtcClock, iso_utc

T = TypeVar("T")
K = TypeVar("K")
V = TypeVar("V")
_HEAD, _FORMATS, _CHANGES = 40, slice(18, 20), slice(24, 40)
"""Bytes of the header that are read; write and read format; and what every transaction changes: the counter
and the bytes after it, by which SQLite itself detects that its cache is stale."""
_ROLLBACK_JOURNAL = b"\x01\x01"
"""Formats of a file without a write-ahead log, which would not update the counter."""


Version = tuple[int | bytes, ...]
"""Version of a file's content; equal versions mean equal content. Device, inode, size and times, which reveal
a replaced file, and the bytes of the header that every transaction changes."""


class FileVersion:
    """Reads the present version of a database file without ever waiting for the disk.

    The file is held open: SQLite's locks belong to the process, and closing any descriptor of the file would
    release the locks of other threads.

    Args:
        path: The file.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._lock = runtime.lock()
        self._descriptor: int | None = None
        self._of: tuple[int, int] | None = None
        self._close: Callable[[], object] = lambda: None

    def now(self) -> Version | None:
        """The present version; None if it cannot be read at once, or the file has a write-ahead log.

        The content is read only if it is in the page cache; the name usually is in memory as well.
        """
        with suppress(OSError), self._lock:
            found = os.stat(self._path)
            head = bytearray(_HEAD)
            # NOWAIT: this runs in the event loop, and a disk may hang.
            read = os.preadv(self._opened(found), [head], 0, os.RWF_NOWAIT)
            if read == _HEAD and head[_FORMATS] == _ROLLBACK_JOURNAL:
                times = (found.st_mtime_ns, found.st_ctime_ns)
                return (found.st_dev, found.st_ino, found.st_size, *times, bytes(head[_CHANGES]))
        return None

    def _opened(self, found: os.stat_result) -> int:
        """A descriptor of the file, reopened if the file has been replaced."""
        if self._descriptor is None or self._of != (found.st_dev, found.st_ino):
            self._close()
            self._descriptor = descriptor = os.open(self._path, os.O_RDONLY | os.O_CLOEXEC)
            self._close = weakref.finalize(self, os.close, descriptor)
            opened = os.fstat(descriptor)
            self._of = (opened.st_dev, opened.st_ino)
            if self._of != (found.st_dev, found.st_ino):
                raise OSError(errno.ESTALE, os.strerror(errno.ESTALE), str(self._path))
        return self._descriptor


class NotRemembered(Exception):
    """A value is not cached, so the database would have to be read."""


class Remembered(Generic[T]):
    """A cache of values read from a database, valid until anything in it changes; any thread may call.

    Args:
        version: Version of the database's file.
        most: Maximum number of values; the least recently used one is dropped.
    """

    def __init__(self, version: FileVersion, most: int) -> None:
        self._version = version
        self._most = most
        self._lock = runtime.lock()
        self._of: Version | None = None
        self._values: OrderedDict[Hashable, T] = OrderedDict()

    def get(self, key: Hashable, read: Callable[[], T | None], *, at_once: bool = False) -> T | None:
        """The value of a key, from the cache or the database; None is not cached.

        Args:
            key: Key of the value.
            read: Reads the value from the database.
            at_once: True if the database must not be read.

        Raises:
            NotRemembered: The value is not cached.
        """
        before = self._version.now()
        with self._lock:
            if before is not None and before == self._of and key in self._values:
                self._values.move_to_end(key)
                return self._values[key]
        if at_once:
            raise NotRemembered
        value = read()
        # Cached only if the version is the same before and after: otherwise the value may belong to either.
        # After a rollback, the next transaction reaches the same counter again with different content.
        if value is not None and before is not None and before == self._version.now():
            self._enter(key, value, before)
        return value

    def _enter(self, key: Hashable, value: T, version: Version) -> None:
        with self._lock:
            if version != self._of:
                self._values.clear()
                self._of = version
            enter(self._values, key, value, self._most)


def enter(entries: OrderedDict[K, V], key: K, value: V, most: int) -> None:
    """Enters a key as the newest, and drops the oldest if there are too many."""
    entries[key] = value
    entries.move_to_end(key)
    if len(entries) > most:
        entries.popitem(last=False)


log = logging.getLogger(__name__)
SECRET_BYTES = 32
"""256 random bits, which cannot be guessed; see `hash_of`."""
SESSION_LIFE = timedelta(days=30)
REMEMBERED = 256
"""Number of tokens and sessions whose holders are cached."""
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")
FILE = "machine.key"
"""Name of the file with the machine key."""
PREFIX = "grabberd_"
"""Prefix of every secret, so that one in a file or a log is recognised."""


@dataclass(frozen=True, slots=True)
class Identity:
    """Identity of the sender of a request.

    Attributes:
        role: Role, which determines what they may do.
        by: Proof of identity: a token, the session it was traded for, the private socket itself, or the
            machine key.
        token: Name of the token; None for the socket and the key.
        expires_utc: Time until which the token is valid; None: until it is removed.
    """

    role: Role
    by: Literal["token", "session", "socket", "machine"]
    token: str | None = None
    expires_utc: str | None = None

    def covers(self, least: Role) -> bool:
        """True if the role suffices where `least` is required; each role includes the ones before it."""
        ascending = list(Role)
        return ascending.index(self.role) >= ascending.index(least)


AT_THE_MACHINE = Identity(Role.OPERATOR, "socket")
"""Identity of any client of a private socket, as long as there are no tokens."""
AS_THE_DAEMON = Identity(Role.ADMIN, "machine")
"""Identity of a client that can read the daemon's own files (docs/decisions/interfaces.md)."""


def hash_of(secret: str) -> bytes:
    """Digest of a secret; the secret itself is never stored.

    One round of SHA-256 suffices: slow, salted hashes protect passwords chosen by people, but 256 random bits
    cannot be guessed. Secrets are looked up by digest, so the duration of a look-up reveals nothing.
    """
    return hashlib.sha256(secret.encode("utf-8", "replace")).digest()


class Access:
    """Tokens and sessions of a state directory; any thread may call.

    The cache is valid only until anything in the database changes: a token added or removed by another
    program takes effect with the next request.

    Args:
        directory: The state directory.
        clock: Source of time.
        heal: Recovers a damaged state database; see `StateDatabase`.

    Attributes:
        key: The machine key, valid while the daemon runs.
    """

    def __init__(
        self, directory: Path, clock: UtcClock | None = None, heal: Callable[[str], None] | None = None
    ) -> None:
        self.key = MachineKey(directory)
        self._store = TokenStore(directory / "state.sqlite", heal)
        version = FileVersion(self._store.path)
        self._holders: Remembered[Holder] = Remembered(version, REMEMBERED)
        self._guarded: Remembered[bool] = Remembered(version, 1)
        self._is_open = False
        self._clock = clock or SystemClock()

    def open(self) -> None:
        """Creates the store if it does not exist; may be called twice.

        Raises:
            StorageError: It cannot be used.
        """
        self._store.open()

    def needs_token(self, *, at_once: bool = False) -> bool:
        """True if access requires a token.

        It does if there are tokens, even expired ones, or may have been some before the database was lost.

        Args:
            at_once: True if only the cache may be used; likewise in the following methods.

        Raises:
            NotRemembered: The value is not cached.
            StorageError: The tokens cannot be read, and existed when they were last read.
        """
        try:
            self._is_open = not self._guarded.get(GUARDED, self._store.guards, at_once=at_once)
        except StorageError:
            if not self._is_open:
                raise
        return not self._is_open

    def add(self, name: str, role: Role, life: timedelta | None = None) -> str:
        """Adds a token and returns its secret, which cannot be read again.

        Args:
            name: Name of its holder, or of its purpose.
            role: Role of its holder.
            life: Time after which it expires; None: it is valid until it is removed.

        Raises:
            InputError: The name is invalid.
            Conflict: A token with that name already exists.
        """
        if not _NAME.fullmatch(name):
            raise InputError(
                f"{name!r} is not a valid token name",
                "use at most 64 letters, digits, '.', '_' and '-', beginning with a letter or digit",
            )
        secret = PREFIX + secrets.token_urlsafe(SECRET_BYTES)
        now = self._clock.utc_now()
        expires_utc = None if life is None else iso_utc(now + life)
        self._store.add(name, role.value, hash_of(secret), iso_utc(now), expires_utc)
        return secret

    def remove(self, name: str) -> None:
        """Removes a token and ends its sessions.

        Raises:
            NotFound: No token has that name.
        """
        self._store.remove(name)

    def list(self) -> list[TokenRow]:
        """All tokens, without their secrets."""
        return self._store.list(self._now())

    def of_token(self, secret: str, *, at_once: bool = False) -> Identity | None:
        """Identity of a token's holder; None if the token is unknown.

        Raises:
            AccessExpired: The token has expired.
            NotRemembered: See `needs_token`.
        """
        if self.key.fits(secret):
            return AS_THE_DAEMON
        digest = hash_of(secret)
        found = self._holders.get(("token", digest), lambda: self._store.of_token(digest), at_once=at_once)
        if found is not None and found.expires_utc is not None and found.expires_utc <= self._now():
            raise AccessExpired(
                f"the token {found.name} expired at {found.expires_utc}",
                f"ask for a new one: grabberd token remove {found.name}, then grabberd token add",
            )
        return _identity(found, "token")

    def of_session(self, secret: str, *, at_once: bool = False) -> Identity | None:
        """Identity of a session's holder; None if the session is unknown or has ended.

        Raises:
            NotRemembered: See `needs_token`.
        """
        digest, now = hash_of(secret), self._now()
        found = self._holders.get(
            ("session", digest), lambda: self._store.of_session(digest, now), at_once=at_once
        )
        if found is not None and found.ends_utc is not None and found.ends_utc <= now:
            return None
        return _identity(found, "session")

    def open_session(self, identity: Identity) -> str:
        """Trades a token for a session and returns the session's secret.

        Raises:
            Conflict: The identity is not based on a token.
            NotFound: The token has just been removed.
        """
        if identity.by != "token" or identity.token is None:
            raise Conflict(
                "only a token can be traded for a session", "send it as 'Authorization: Bearer TOKEN'"
            )
        secret, now = secrets.token_urlsafe(SECRET_BYTES), self._clock.utc_now()
        ends = min(iso_utc(now + SESSION_LIFE), identity.expires_utc or "~")  # '~' sorts after every time
        self._store.add_session(hash_of(secret), identity.token, iso_utc(now), ends)
        return secret

    def close_session(self, secret: str) -> None:
        """Ends a session; may be called twice."""
        self._store.remove_session(hash_of(secret))

    def _now(self) -> str:
        return iso_utc(self._clock.utc_now())


def _identity(found: Holder | None, by: Literal["token", "session"]) -> Identity | None:
    return None if found is None else Identity(Role(found.role), by, found.name, found.expires_utc)


class MachineKey:
    """A file with a secret that is created at every start and is valid until the daemon ends.

    Whoever can read it can also write the tokens beside it, so it grants no additional access.

    Args:
        directory: The daemon's state directory, which it has locked.
    """

    def __init__(self, directory: Path) -> None:
        self.path = directory / FILE
        self._hash: bytes | None = None

    def make(self) -> None:
        """Creates a new key; if the disk cannot be written, logs a warning and continues without one."""
        secret = PREFIX + secrets.token_urlsafe(SECRET_BYTES)
        try:
            # Never written into an existing file, which another process may hold open.
            self.path.unlink(missing_ok=True)
            descriptor = os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, OWNER_ONLY)
            with os.fdopen(descriptor, "w", encoding="ascii") as file:
                file.write(f"{secret}\n")
        except OSError as error:
            log.warning("%s cannot be written: %s; diagnostics take a token", self.path.name, error.strerror)
            return
        self._hash = hash_of(secret)

    def remove(self) -> None:
        """Invalidates the key and removes its file; may be called twice."""
        if self._hash is not None:
            self._hash = None
            with suppress(OSError):
                self.path.unlink(missing_ok=True)

    def fits(self, secret: str) -> bool:
        """True if a secret is the key, compared in constant time."""
        return self._hash is not None and hmac.compare_digest(self._hash, hash_of(secret))


def readable_key(directory: Path) -> Path | None:
    """Path of a daemon's key, or None if it does not exist or this user may not read it."""
    path = directory / FILE
    return path if os.access(path, os.R_OK) else None
