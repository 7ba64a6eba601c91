"""Machine key: access for whoever may read the daemon's own files, that is root and the daemon's user."""

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
"""Prefix of every secret, by which one that strays into a file or a log is recognised."""
OWNER_ONLY = 0o600


class MachineKey:
    """A file with a secret that is created anew at every start and is valid until the daemon ends.

    Whoever can read it can write the tokens beside it, too: it gives nobody more than they have.

    Args:
        directory: The daemon's state directory, which it has locked.
    """

    def __init__(self, directory: Path) -> None:
        self.path = directory / FILE
        self._hash: bytes | None = None

    def make(self) -> None:
        """Creates a new key; if the disk cannot be written there is none, and a warning is logged."""
        secret = PREFIX + secrets.token_urlsafe(32)
        try:
            # Never written into an existing file: somebody may hold that open, with other rights.
            self.path.unlink(missing_ok=True)
            descriptor = os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, OWNER_ONLY)
            with os.fdopen(descriptor, "w", encoding="ascii") as file:
                file.write(f"{secret}\n")
        except OSError as error:
            log.warning("%s cannot be written: %s; diagnostics take a token", self.path.name, error.strerror)
            return
        self._hash = _hash(secret)

    def remove(self) -> None:
        """Invalidates the key and removes its file; safe twice."""
        if self._hash is not None:
            self._hash = None
            with suppress(OSError):
                self.path.unlink(missing_ok=True)

    def fits(self, secret: str) -> bool:
        """True if a secret is the key; takes the same time whichever part of it is wrong."""
        return self._hash is not None and hmac.compare_digest(self._hash, _hash(secret))


def readable_key(directory: Path) -> Path | None:
    """Path of a daemon's key, or None if there is none or this user may not read it."""
    path = directory / FILE
    return path if os.access(path, os.R_OK) else None


def _hash(secret: str) -> bytes:
    return hashlib.sha256(secret.encode("utf-8", "replace")).digest()
