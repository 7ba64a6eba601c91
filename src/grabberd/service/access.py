"""Who may: tokens with roles, and the browser sessions they are traded for."""

import hashlib
import re
import secrets
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from typing import Literal

from grabberd.errors import Conflict, InputError
from grabberd.service.clock import Clock, SystemClock, iso_utc
from grabberd.service.roles import Role
from grabberd.storage.tokens import TokenRow, TokenStore

PREFIX = "grabberd_"
"""So that a token which strays into a file is recognised."""
SECRET_BYTES = 32
SESSION_LIFE = timedelta(days=30)
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]{0,63}")


@dataclass(frozen=True, slots=True)
class Identity:
    """Who asks.

    Attributes:
        role: what they may.
        by: a token, the session it was traded for, or the private socket itself.
        token: the token's name; None for the socket.
    """

    role: Role
    by: Literal["token", "session", "socket"]
    token: str | None = None


AT_THE_MACHINE = Identity(Role.OPERATOR, "socket")
"""Whoever reaches a private socket, as long as there are no tokens."""


def hash_of(secret: str) -> bytes:
    """What is kept of a secret.

    One round of SHA-256 is right here: a slow, salted hash protects what people think up, and nobody
    guesses 256 random bits. It is looked up by its hash, so how long that takes tells nothing of a secret.
    """
    return hashlib.sha256(secret.encode("utf-8", "replace")).digest()


class Access:
    """The tokens of a state directory. Any thread may call; nothing is kept between calls, so that a token
    made or removed by another program counts from the next request on.
    """

    def __init__(self, directory: Path, clock: Clock | None = None) -> None:
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
        """Whether anybody has been given a token."""
        return self._store.any()

    def add(self, name: str, role: Role) -> str:
        """Makes a token and returns its secret, which nobody can ask for again.

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
        self._store.add(name, role.value, hash_of(secret), self._now())
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
        """Whose token it is; None where it is nobody's."""
        return _identity(self._store.of_token(hash_of(secret)), "token")

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
        self._store.add_session(hash_of(secret), identity.token, iso_utc(now), iso_utc(now + SESSION_LIFE))
        return secret

    def close_session(self, secret: str) -> None:
        """Ends a session; safe twice."""
        self._store.remove_session(hash_of(secret))

    def _now(self) -> str:
        return iso_utc(self._clock.utc_now())


def _identity(found: tuple[str, str] | None, by: Literal["token", "session"]) -> Identity | None:
    return None if found is None else Identity(Role(found[1]), by, found[0])
