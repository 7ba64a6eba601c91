"""Tokens and the browser sessions they were traded for: hashes only, never a secret."""

from pathlib import Path
from typing import NamedTuple

from grabberd.errors import Conflict, NotFound
from grabberd.storage.state.state_database import StateDatabase

SESSIONS_A_TOKEN = 32
"""A token's oldest sessions end when there are more."""


class TokenRow(NamedTuple):
    """A token without its secret.

    Attributes:
        sessions: how many were made of it and have not ended.
        expires_utc: it is good until then; None: until it is removed.
    """

    name: str
    role: str
    created_utc: str
    sessions: int
    expires_utc: str | None = None


class Holder(NamedTuple):
    """Whose a token is, and until when it is good."""

    name: str
    role: str
    expires_utc: str | None = None


class TokenStore:
    """The tokens and sessions in `state.sqlite`. Times are ISO 8601 UTC, all in one format: they compare."""

    def __init__(self, path: Path) -> None:
        self._database = StateDatabase(path)

    def open(self) -> None:
        """Makes the file if it is not there; safe twice.

        Raises:
            StorageError: it cannot be written, is damaged, or is of a later version.
        """
        self._database.open()

    def add(
        self, name: str, role: str, token_hash: bytes, created_utc: str, expires_utc: str | None = None
    ) -> None:
        """Keeps a token, for good or until it expires.

        Raises:
            Conflict: there is one of that name.
            StorageError: the file cannot be written.
        """
        with self._database.transaction() as connection:
            if connection.execute("SELECT 1 FROM tokens WHERE name = ?", (name,)).fetchone():
                raise Conflict(
                    f"there is a token {name!r} already",
                    f"take another name, or end the old one first: grabberd token remove {name}",
                )
            connection.execute(
                "INSERT INTO tokens (name, role, hash, created_utc, expires_utc) VALUES (?, ?, ?, ?, ?)",
                (name, role, token_hash, created_utc, expires_utc),
            )

    def remove(self, name: str) -> None:
        """Forgets a token and all its sessions.

        Raises:
            NotFound: there is none of that name.
            StorageError: the file cannot be written.
        """
        with self._database.transaction() as connection:
            if not connection.execute("DELETE FROM tokens WHERE name = ?", (name,)).rowcount:
                raise NotFound(f"no token {name!r}", "grabberd token list shows the tokens there are")

    def list(self, now_utc: str) -> list[TokenRow]:
        """All tokens by their names."""
        with self._database.transaction() as connection:
            rows = connection.execute(
                "SELECT name, role, created_utc, (SELECT count(*) FROM sessions "
                "WHERE token = name AND sessions.expires_utc > ?), expires_utc FROM tokens ORDER BY name",
                (now_utc,),
            )
            return [TokenRow(*row) for row in rows]

    def any(self) -> bool:
        """Whether there are tokens at all, expired ones too."""
        with self._database.transaction() as connection:
            return connection.execute("SELECT 1 FROM tokens").fetchone() is not None

    def of_token(self, token_hash: bytes) -> Holder | None:
        """Whose a token is, expired or not."""
        query = "SELECT name, role, expires_utc FROM tokens WHERE hash = ?"
        with self._database.transaction() as connection:
            row = connection.execute(query, (token_hash,)).fetchone()
            return None if row is None else Holder(*row)

    def of_session(self, session_hash: bytes, now_utc: str) -> Holder | None:
        """Whose the token is behind a session, where neither has ended."""
        query = (
            "SELECT name, role, tokens.expires_utc FROM sessions JOIN tokens ON token = name "
            "WHERE sessions.hash = ?1 AND sessions.expires_utc > ?2 "
            "AND (tokens.expires_utc IS NULL OR tokens.expires_utc > ?2)"
        )
        with self._database.transaction() as connection:
            row = connection.execute(query, (session_hash, now_utc)).fetchone()
            return None if row is None else Holder(*row)

    def add_session(self, session_hash: bytes, token: str, now_utc: str, expires_utc: str) -> None:
        """Keeps a session, and sweeps out those that have ended.

        Raises:
            NotFound: the token is gone.
            StorageError: the file cannot be written.
        """
        with self._database.transaction() as connection:
            if not connection.execute("SELECT 1 FROM tokens WHERE name = ?", (token,)).fetchone():
                raise NotFound(f"no token {token!r}", "it has just been removed; ask for another")
            connection.execute(
                "INSERT INTO sessions VALUES (?, ?, ?, ?)", (session_hash, token, now_utc, expires_utc)
            )
            connection.execute("DELETE FROM sessions WHERE expires_utc <= ?", (now_utc,))
            connection.execute(
                "DELETE FROM sessions WHERE token = ? AND hash NOT IN (SELECT hash FROM sessions "
                "WHERE token = ? ORDER BY created_utc DESC, hash LIMIT ?)",
                (token, token, SESSIONS_A_TOKEN),
            )

    def remove_session(self, session_hash: bytes) -> None:
        """Ends a session; one that has ended stays so."""
        with self._database.transaction() as connection:
            connection.execute("DELETE FROM sessions WHERE hash = ?", (session_hash,))
