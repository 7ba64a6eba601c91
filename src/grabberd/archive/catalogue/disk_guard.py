"""Disk space: how long captures can continue, and when they must end."""

import errno
import os
from collections.abc import Callable
from pathlib import Path

from grabberd.documents.state import StorageDocument
from grabberd.errors import Cause, StorageError
from grabberd.files.disk import storage_errors

GB = 1_000_000_000
DEFAULT_RESERVE_BYTES = GB // 5
SHARE = {1: 0.04, 2: 0.04, 3: 0.12, 4: 0.21, 5: 0.36, 6: 0.5, 8: 0.6}
"""Compressed size relative to a packed field, by bits; measured on pictures with 2 % noise, rounded up."""
POINTS_BYTES = 2_500
"""Bytes of one field's points and their rows, with some seventy targets."""
_CAUSES = {
    errno.ENOENT: Cause.DISK_MISSING,
    errno.ENOTDIR: Cause.DISK_MISSING,
    errno.EROFS: Cause.DISK_READ_ONLY,
}
LEAST_S = 60.0
"""Seconds that must fit on the disk for a capture without a length."""


def free_bytes(folder: Path) -> int:
    """Free bytes on the disk that holds a folder.

    Raises:
        OSError: The folder is missing, or the disk is read-only, as after a fault.
    """
    disk = os.statvfs(folder)
    if disk.f_flag & os.ST_RDONLY:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(folder))
    # f_bavail, not f_bfree: the daemon is not root and cannot use blocks reserved for root.
    return disk.f_bavail * disk.f_frsize


def cause_of(error: StorageError) -> Cause:
    """Cause code of a disk whose space cannot be determined."""
    if error.cause is not None:
        return error.cause
    source = error.__cause__
    number = source.errno if isinstance(source, OSError) else None
    return _CAUSES.get(number or 0, Cause.DISK_FAILED)


def bytes_per_field(bits: int, rows: int, columns: int) -> float:
    """Expected size of a field in a capture file, with its points."""
    return SHARE[bits] * rows * columns * bits / 8 + POINTS_BYTES


class DiskGuard:
    """Lets captures use the disk down to a reserve, which is needed to seal them.

    Args:
        reserve_bytes: Bytes that are kept free.
        free: Returns the free bytes on the disk of a folder.
    """

    def __init__(
        self, reserve_bytes: int = DEFAULT_RESERVE_BYTES, free: Callable[[Path], int] = free_bytes
    ) -> None:
        self.reserve_bytes = reserve_bytes
        self._free = free

    def free_bytes(self, folder: Path) -> int:
        """Free bytes on the disk of a folder.

        Raises:
            StorageError: The folder is missing.
        """
        with storage_errors(folder):
            return self._free(folder)

    def seconds_left(self, folder: Path, bytes_per_s: float) -> float:
        """Seconds until the free space above the reserve is used up at this total rate."""
        return max(0, self.free_bytes(folder) - self.reserve_bytes) / bytes_per_s

    def document(
        self,
        folder: Path,
        bytes_per_s: float,
        *,
        check: Callable[[], None] = lambda: None,
        removed: int = 0,
        removed_bytes: int = 0,
    ) -> StorageDocument:
        """The disk's document, also for a failing disk.

        Args:
            folder: Folder of the captures.
            bytes_per_s: Total rate at which all devices write.
            check: Raises StorageError while the folder is missing.
            removed: Number of captures removed by retention.
            removed_bytes: Their total size.
        """
        free, left_s, problem, code = None, None, None, None
        try:
            check()
            free, left_s = self.free_bytes(folder), self.seconds_left(folder, bytes_per_s)
        except StorageError as error:
            free, problem, code = None, error.message, cause_of(error)
        return StorageDocument(
            free_bytes=free,
            minutes_left=None if left_s is None else round(left_s / 60, 1),
            problem=problem,
            cause_code=code,
            removed=removed,
            removed_bytes=removed_bytes,
        )

    def check_fits(self, folder: Path, bytes_per_s: float, duration_s: float | None) -> None:
        """Checks that a capture of this length fits, or a minute of a capture without a length.

        Raises:
            StorageError: It does not fit; the message states the available minutes.
        """
        left_s, wanted_s = self.seconds_left(folder, bytes_per_s), duration_s or LEAST_S
        if left_s >= wanted_s:
            return
        raise StorageError(
            f"the disk has room for {left_s / 60:.1f} minutes at this rate "
            f"({bytes_per_s * 3600 / GB:.1f} GB/h), {wanted_s / 60:.1f} are needed",
            f"make room, capture with fewer bits, or for a shorter time; "
            f"{self.reserve_bytes / GB:g} GB stay free (storage.reserve_gb)",
        )

    def shortage(self, folder: Path) -> StorageError | None:
        """The error that ends a running capture while it can still be sealed; None if there is enough space.

        Raises:
            StorageError: The folder is missing.
        """
        free = self.free_bytes(folder)
        if free >= self.reserve_bytes:
            return None
        return StorageError(
            f"disk nearly full: {free / GB:.2f} GB are free, {self.reserve_bytes / GB:g} GB are kept",
            "download captures, then delete them here, or let storage.retention do so",
        )
