"""A lock for a folder of captures: tells a file that another program writes from one that a crash left."""

import fcntl
import os
from pathlib import Path

from grabberd.errors import StorageError
from grabberd.files.disk import storage_errors

NAME = ".lock"


class DirectoryLock:
    """Held from `acquire` to `release`, or until the process ends, however it ends.

    flock rather than a file with a process id: the kernel releases it with the process.
    """

    def __init__(self, directory: Path) -> None:
        self.path = directory / NAME
        self._descriptor: int | None = None

    def acquire(self) -> None:
        """Acquires the lock; does nothing if it is held already.

        Raises:
            StorageError: Another program holds it, or the folder cannot be written.
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
        """Releases the lock; does nothing if it is not held."""
        if self._descriptor is not None:
            os.close(self._descriptor)
            self._descriptor = None

    @property
    def in_place(self) -> bool:
        """True if it is held, and the folder at its path is the one that it was acquired in."""
        if self._descriptor is None:
            return False
        try:
            there = os.stat(self.path)
        except OSError:
            return False
        return os.path.samestat(there, os.fstat(self._descriptor))
