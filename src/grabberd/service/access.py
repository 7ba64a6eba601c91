"""Who may: tokens with roles, and the browser sessions they are traded for."""

import hashlib
import re
import secrets
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from typing import Literal

from grabberd.documents.roles import Role
from grabberd.errors import AccessExpired, Conflict, InputError
from grabberd.service.clock import Clock, SystemClock, iso_utc
from grabberd.service.machine_key import PREFIX, MachineKey
from grabberd.storage.state.token_store import Holder, TokenRow, TokenStore

SECRET_BYTES = 32
SESSION_LIFE = timedelta(days=30)
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")


@dataclass(frozen=True, slots=True)
class Identity:
    """Who asks.

    Attributes:
        role: what they may.
        by: a token, the session it was traded for, the private socket itself, or the machine's key.
        token: the token's name; None for the socket and the key.
        expires_utc: until when the token is good; None: until it is removed.
    """

    role: Role
    by: Literal["token", "session", "socket", "machine"]
    token: str | None = None
    expires_utc: str | None = None


AT_THE_MACHINE = Identity(Role.OPERATOR, "socket")
"""Whoever reaches a private socket, as long as there are no tokens."""
AS_THE_DAEMON = Identity(Role.ADMIN, "machine")
"""Whoever can read the daemon's own files."""


def hash_of(secret: str) -> bytes:
    """What is kept of a secret.

    One round of SHA-256 is right here: a slow, salted hash protects what people think up, and nobody
    guesses 256 random bits. It is looked up by its hash, so how long that takes tells nothing of a secret.
    """
    return hashlib.sha256(secret.encode("utf-8", "replace")).digest()


class Access:
    """The tokens of a state directory. Any thread may call; nothing is kept between calls, so that a token
    made or removed by another program counts from the next request on.

    Attributes:
        key: of the machine, while a daemon runs.
    """

    def __init__(self, directory: Path, clock: Clock | None = None) -> None:
        self.key = MachineKey(directory)
        self._store = TokenStore(directory / "state.sqlite")
        self._clock = clock or SystemClock()

    def open(self) -> None:
        """Makes the store if it is not there; safe twice.

        Raises:
            StorageError: it cannot be used.
        """
        self._store.open()

    @property
    def has_tokens(self) -> bool:
        """Whether anybody has been given a token, also one that has expired since."""
        return self._store.any()

    def add(self, name: str, role: Role, life: timedelta | None = None) -> str:
        """Makes a token and returns its secret, which nobody can ask for again.

        Args:
            name: whose it is, or what it is for.
            role: what it may.
            life: it expires after that; None: it is good until it is removed.

        Raises:
            InputError: it cannot be a name.
            Conflict: there is a token of that name.
        """
        if not _NAME.fullmatch(name):
            raise InputError(
                f"{name!r} cannot be a token's name",
                "letters, digits, '.', '_' and '-', at most 64, beginning with a letter or digit",
            )
        secret = PREFIX + secrets.token_urlsafe(SECRET_BYTES)
        now = self._clock.utc_now()
        expires_utc = None if life is None else iso_utc(now + life)
        self._store.add(name, role.value, hash_of(secret), iso_utc(now), expires_utc)
        return secret

    def remove(self, name: str) -> None:
        """Ends a token and its sessions.

        Raises:
            NotFound: there is none of that name.
        """
        self._store.remove(name)

    def list(self) -> list[TokenRow]:
        """All tokens, without their secrets."""
        return self._store.list(self._now())

    def of_token(self, secret: str) -> Identity | None:
        """Whose token it is; None where it is nobody's.

        Raises:
            AccessExpired: it was good until a day that has passed.
        """
        if self.key.fits(secret):
            return AS_THE_DAEMON
        found = self._store.of_token(hash_of(secret))
        if found is not None and found.expires_utc is not None and found.expires_utc <= self._now():
            raise AccessExpired(
                f"the token {found.name} has expired: it was good until {found.expires_utc}",
                f"ask for a new one: grabberd token remove {found.name}, then grabberd token add",
            )
        return _identity(found, "token")

    def of_session(self, secret: str) -> Identity | None:
        """Whose session it is; None where it is nobody's, or has ended."""
        return _identity(self._store.of_session(hash_of(secret), self._now()), "session")

    def open_session(self, identity: Identity) -> str:
        """Trades a token for a session and returns the session's secret.

        Raises:
            Conflict: who asks has no token.
            NotFound: the token has just been removed.
        """
        if identity.by != "token" or identity.token is None:
            raise Conflict(
                "only a token can be traded for a session", "send it as 'Authorization: Bearer TOKEN'"
            )
        secret, now = secrets.token_urlsafe(SECRET_BYTES), self._clock.utc_now()
        ends = min(iso_utc(now + SESSION_LIFE), identity.expires_utc or "~")  # comes after every time
        self._store.add_session(hash_of(secret), identity.token, iso_utc(now), ends)
        return secret

    def close_session(self, secret: str) -> None:
        """Ends a session; safe twice."""
        self._store.remove_session(hash_of(secret))

    def _now(self) -> str:
        return iso_utc(self._clock.utc_now())


def _identity(found: Holder | None, by: Literal["token", "session"]) -> Identity | None:
    return None if found is None else Identity(Role(found.role), by, found.name, found.expires_utc)
