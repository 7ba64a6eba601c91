"""One program at a time for a folder of captures: another's unsealed file is not a crash's."""

import fcntl
import os
from pathlib import Path

from grabberd.errors import StorageError
from grabberd.storage.disk import storage_errors


class DirectoryLock:
    """Held from `acquire` to `release`, or until the process ends, however it ends."""

    def __init__(self, directory: Path) -> None:
        self.path = directory / ".lock"
        self._descriptor: int | None = None

    def acquire(self) -> None:
        """Takes the lock; safe twice.

        Raises:
            StorageError: another program holds it, or the folder cannot be written.
        """
        if self._descriptor is not None:
            return
        with storage_errors(self.path):
            self.path.parent.mkdir(parents=True, exist_ok=True)
            descriptor = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o644)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(descriptor)
            raise StorageError(
                f"another grabberd uses {self.path.parent}",
                "stop it, or give this one a folder of its own (storage.directory)",
            ) from None
        self._descriptor = descriptor

    def release(self) -> None:
        """Gives the lock back; safe twice."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None
