"""Access: tokens with roles, and the browser sessions they are traded for."""

import hashlib
import re
import secrets
from collections.abc import Callable
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from typing import Literal

from grabberd.archive.machine_key import PREFIX, MachineKey
from grabberd.archive.state.file_version import FileVersion, Remembered
from grabberd.archive.state.token_store import GUARDED, Holder, TokenRow, TokenStore
from grabberd.clock import SystemClock, UtcClock, iso_utc
from grabberd.documents.roles import Role
from grabberd.errors import AccessExpired, Conflict, InputError, StorageError

SECRET_BYTES = 32
"""256 random bits, which nobody guesses; see `hash_of`."""
SESSION_LIFE = timedelta(days=30)
REMEMBERED = 256
"""Tokens and sessions whose holders are remembered."""
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")


@dataclass(frozen=True, slots=True)
class Identity:
    """Identity of whoever sends a request.

    Attributes:
        role: Role, which says what they may do.
        by: Proof of identity: a token, the session it was traded for, the private socket itself, or the
            machine's key.
        token: Name of the token; None for the socket and the key.
        expires_utc: Time until which the token is valid; None: until it is removed.
    """

    role: Role
    by: Literal["token", "session", "socket", "machine"]
    token: str | None = None
    expires_utc: str | None = None

    def covers(self, least: Role) -> bool:
        """True if the role is enough where `least` is required; each role includes the ones before it."""
        ascending = list(Role)
        return ascending.index(self.role) >= ascending.index(least)


AT_THE_MACHINE = Identity(Role.OPERATOR, "socket")
"""Identity of whoever reaches a private socket, as long as there are no tokens."""
AS_THE_DAEMON = Identity(Role.ADMIN, "machine")
"""Identity of whoever can read the daemon's own files (docs/decisions/0012)."""


def hash_of(secret: str) -> bytes:
    """Digest of a secret, which is all that is stored of it.

    One round of SHA-256 is right here: a slow, salted hash protects passwords that people think up, and
    nobody guesses 256 random bits. Secrets are looked up by their digest, so the time that takes reveals
    nothing of a secret.
    """
    return hashlib.sha256(secret.encode("utf-8", "replace")).digest()


class Access:
    """Tokens and sessions of a state directory; any thread may call.

    What is read is remembered only until anything in the database changes: a token that another program adds
    or removes counts from the next request on.

    Args:
        directory: The state directory.
        clock: Source of time.
        heal: Recovers a damaged state database; see `StateDatabase`.

    Attributes:
        key: Key of the machine, valid while a daemon runs.
    """

    def __init__(
        self,
        directory: Path,
        clock: UtcClock | None = None,
        heal: Callable[[str], None] | None = None,
    ) -> None:
        self.key = MachineKey(directory)
        self._store = TokenStore(directory / "state.sqlite", heal)
        version = FileVersion(self._store.path)
        self._holders: Remembered[Holder] = Remembered(version, REMEMBERED)
        self._guarded: Remembered[bool] = Remembered(version, 1)
        self._is_open = False
        self._clock = clock or SystemClock()

    def open(self) -> None:
        """Creates the store if it does not exist; safe twice.

        Raises:
            StorageError: It cannot be used.
        """
        self._store.open()

    @property
    def needs_token(self) -> bool:
        """True if nobody is let in without a token.

        There are some, expired ones included, or there may have been before they were lost with the database.

        Raises:
            StorageError: The tokens cannot be read, and there were some when they could be.
        """
        return self.is_guarded()

    def is_guarded(self, *, at_once: bool = False) -> bool:
        """See `needs_token`.

        Args:
            at_once: True if the disk must not be waited for, as in all the following.

        Raises:
            NotRemembered: It would have to be.
            StorageError: See `needs_token`.
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
            Conflict: There is a token of that name already.
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
            NotFound: There is no token of that name.
        """
        self._store.remove(name)

    def list(self) -> list[TokenRow]:
        """All tokens, without their secrets."""
        return self._store.list(self._now())

    def of_token(self, secret: str, *, at_once: bool = False) -> Identity | None:
        """Identity of a token's holder; None if there is no such token.

        Raises:
            AccessExpired: The token has expired.
            NotRemembered: See `is_guarded`.
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
        """Identity of a session's holder; None if there is no such session, or it has ended.

        Raises:
            NotRemembered: See `is_guarded`.
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
            Conflict: The identity has no token.
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
        """Ends a session; safe twice."""
        self._store.remove_session(hash_of(secret))

    def _now(self) -> str:
        return iso_utc(self._clock.utc_now())


def _identity(found: Holder | None, by: Literal["token", "session"]) -> Identity | None:
    return None if found is None else Identity(Role(found.role), by, found.name, found.expires_utc)
