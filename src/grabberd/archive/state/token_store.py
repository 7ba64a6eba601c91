"""Tokens and the browser sessions they were traded for: only hashes, never a secret."""

from typing import NamedTuple

from grabberd.archive.state.state_database import StateDatabase
from grabberd.errors import Conflict, NotFound

GUARDED = "guarded"
"""Key of the settings: tokens were lost, so access requires a token until a new one is added."""
SESSIONS_A_TOKEN = 32
"""Maximum number of sessions per token; beyond it, the oldest end."""


class TokenRow(NamedTuple):
    """A token without its secret, with the number of its active sessions.

    Attributes:
        expires_utc: Expiry; None: valid until it is removed.
    """

    name: str
    role: str
    created_utc: str
    sessions: int
    expires_utc: str | None = None


class Holder(NamedTuple):
    """Holder of a token or of a session.

    Attributes:
        name: Name of the token.
        role: Role of the token.
        expires_utc: Time when the token expires; None: never.
        ends_utc: Time when the session ends, which is never after that; None for a token.
    """

    name: str
    role: str
    expires_utc: str | None = None
    ends_utc: str | None = None


class TokenStore(StateDatabase):
    """The tokens and sessions in `state.sqlite`. Times are ISO 8601 UTC in one format: they sort as text."""

    def add(
        self, name: str, role: str, token_hash: bytes, created_utc: str, expires_utc: str | None = None
    ) -> None:
        """Stores a token.

        Raises:
            Conflict: A token with that name already exists.
        """
        with self.transaction() as connection:
            if connection.execute("SELECT 1 FROM tokens WHERE name = ?", (name,)).fetchone():
                raise Conflict(
                    f"token {name!r} exists already",
                    f"choose another name, or remove the old one first: grabberd token remove {name}",
                )
            connection.execute("DELETE FROM settings WHERE key = ?", (GUARDED,))
            connection.execute(
                "INSERT INTO tokens (name, role, hash, created_utc, expires_utc) VALUES (?, ?, ?, ?, ?)",
                (name, role, token_hash, created_utc, expires_utc),
            )

    def remove(self, name: str) -> None:
        """Removes a token and all its sessions.

        Raises:
            NotFound: No token has that name.
        """
        with self.transaction() as connection:
            if not connection.execute("DELETE FROM tokens WHERE name = ?", (name,)).rowcount:
                raise NotFound(f"no token {name!r}", "grabberd token list shows the existing tokens")

    def list(self, now_utc: str) -> list[TokenRow]:
        """All tokens, sorted by name."""
        query = (
            "SELECT name, role, created_utc, (SELECT count(*) FROM sessions "
            "WHERE token = name AND sessions.expires_utc > ?), expires_utc FROM tokens ORDER BY name"
        )
        return [TokenRow(*row) for row in self.execute(query, now_utc)]

    def guards(self) -> bool:
        """True if there is any token, even an expired one, or tokens may have been lost."""
        return bool(
            self.execute(
                "SELECT 1 FROM tokens UNION ALL SELECT 1 FROM settings WHERE key = ? LIMIT 1", GUARDED
            )
        )

    def of_token(self, token_hash: bytes) -> Holder | None:
        """Holder of a token, expired or not."""
        return self._holder("SELECT name, role, expires_utc FROM tokens WHERE hash = ?", token_hash)

    def of_session(self, session_hash: bytes, now_utc: str) -> Holder | None:
        """Holder of the token behind a session, if neither has expired."""
        query = (
            "SELECT name, role, tokens.expires_utc, "
            "min(sessions.expires_utc, ifnull(tokens.expires_utc, sessions.expires_utc)) "
            "FROM sessions JOIN tokens ON token = name "
            "WHERE sessions.hash = ?1 AND sessions.expires_utc > ?2 "
            "AND (tokens.expires_utc IS NULL OR tokens.expires_utc > ?2)"
        )
        return self._holder(query, session_hash, now_utc)

    def add_session(self, session_hash: bytes, token: str, now_utc: str, expires_utc: str) -> None:
        """Stores a session, and removes expired ones.

        Raises:
            NotFound: The token has been removed.
        """
        with self.transaction() as connection:
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
        """Ends a session, if it exists."""
        self.execute("DELETE FROM sessions WHERE hash = ?", session_hash)

    def _holder(self, query: str, *values: object) -> Holder | None:
        rows = self.execute(query, *values)
        return Holder(*rows[0]) if rows else None
