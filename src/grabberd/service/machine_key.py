"""A key for whoever may read the daemon's own files: root, and the daemon's user."""

import hashlib
import hmac
import logging
import os
import secrets
from contextlib import suppress
from pathlib import Path

log = logging.getLogger(__name__)

FILE = "machine.key"
PREFIX = "grabberd_"
"""So that a secret which strays into a file is recognised."""
OWNER_ONLY = 0o600


class MachineKey:
    """A file with a secret that is made anew at every start and counts until the daemon ends.

    Who can read it can write the tokens beside it, too: it gives nobody more than they have.

    Args:
        directory: the daemon's own, which it has locked.
    """

    def __init__(self, directory: Path) -> None:
        self.path = directory / FILE
        self._hash: bytes | None = None

    def make(self) -> None:
        """Makes a new one; on a disk that cannot be written there is none, and the log says so."""
        secret = PREFIX + secrets.token_urlsafe(32)
        try:
            self.path.unlink(missing_ok=True)
            descriptor = os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, OWNER_ONLY)
            with os.fdopen(descriptor, "w", encoding="ascii") as file:
                file.write(f"{secret}\n")
        except OSError as error:
            log.warning("%s cannot be written: %s; diagnostics take a token", self.path.name, error.strerror)
            return
        self._hash = _hash(secret)

    def remove(self) -> None:
        """Ends it; safe twice."""
        if self._hash is not None:
            self._hash = None
            with suppress(OSError):
                self.path.unlink(missing_ok=True)

    def fits(self, secret: str) -> bool:
        """Whether this is it."""
        return self._hash is not None and hmac.compare_digest(self._hash, _hash(secret))


def readable_key(directory: Path) -> Path | None:
    """The file with a daemon's key, where there is one and this user may read it."""
    path = directory / FILE
    return path if os.access(path, os.R_OK) else None


def _hash(secret: str) -> bytes:
    return hashlib.sha256(secret.encode("utf-8", "replace")).digest()
