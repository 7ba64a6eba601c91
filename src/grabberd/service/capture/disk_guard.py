"""Room on the disk: how long captures may go on, and when they have to end."""

import errno
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from grabberd.errors import Cause, StorageError
from grabberd.field.packed_field import packed_shape
from grabberd.storage.capture.schema import storage_errors

GB = 1_000_000_000
DEFAULT_RESERVE_BYTES = GB // 5
SHARE = {1: 0.06, 2: 0.06, 3: 0.12, 4: 0.21, 5: 0.36, 6: 0.5, 8: 0.6}
"""What compressing leaves of a packed field, by its bits; measured on pictures with 2 % noise, rounded up."""
POINTS_BYTES = 8_000
"""The points of one field and the rows around them, with some seventy targets."""
_CAUSES = {
    errno.ENOENT: Cause.DISK_MISSING,
    errno.ENOTDIR: Cause.DISK_MISSING,
    errno.EROFS: Cause.DISK_READ_ONLY,
}
LEAST_S = 60.0
"""So long a capture without a length has to fit at the least."""


def free_bytes(folder: Path) -> int:
    """Room on the disk that holds a folder.

    Raises:
        OSError: the folder is not there, or the disk is read-only, as one becomes with a fault.
    """
    disk = os.statvfs(folder)
    if disk.f_flag & os.ST_RDONLY:
        raise OSError(errno.EROFS, os.strerror(errno.EROFS), str(folder))
    return disk.f_bavail * disk.f_frsize


def cause_of(error: StorageError) -> Cause:
    """Why the disk cannot be asked, in a word."""
    said = error.__cause__
    number = said.errno if isinstance(said, OSError) else None
    return _CAUSES.get(number or 0, Cause.DISK_FAILED)


def bytes_per_field(bits: int, rows: int, columns: int) -> float:
    """What a field is expected to take in a capture file, its points included."""
    packed = 1
    for extent in packed_shape(rows, columns, bits):
        packed *= extent
    return SHARE[bits] * packed + POINTS_BYTES


class DiskGuard:
    """Captures may take what is free but for a reserve, which leaves room to seal them.

    Args:
        reserve_bytes: what stays free.
        free: bytes that are free on the disk of a folder.
    """

    def __init__(
        self, reserve_bytes: int = DEFAULT_RESERVE_BYTES, free: Callable[[Path], int] = free_bytes
    ) -> None:
        self.reserve_bytes = reserve_bytes
        self._free = free

    def free_bytes(self, folder: Path) -> int:
        """Room on the disk.

        Raises:
            StorageError: the folder is not there.
        """
        with storage_errors(folder):
            return self._free(folder)

    def seconds_left(self, folder: Path, bytes_per_s: float) -> float:
        """How long captures may go on that together write so much."""
        return max(0, self.free_bytes(folder) - self.reserve_bytes) / bytes_per_s

    def document(self, folder: Path, bytes_per_s: float) -> dict[str, Any]:
        """The disk as it is shown, also where it fails."""
        try:
            free, left_s = self.free_bytes(folder), self.seconds_left(folder, bytes_per_s)
        except StorageError as error:
            said = {"problem": error.message, "cause_code": cause_of(error)}
            return {"free_bytes": None, "minutes_left": None, **said}
        left = {"free_bytes": free, "minutes_left": round(left_s / 60, 1)}
        return {**left, "problem": None, "cause_code": None}

    def check_fits(self, folder: Path, bytes_per_s: float, duration_s: float | None) -> None:
        """Whether a capture of this length may begin; without a length, whether a minute of it fits.

        Raises:
            StorageError: it may not; the message says how many minutes would fit.
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
        """Why a running capture has to end now, while it can still be sealed; None while it need not.

        Raises:
            StorageError: the folder is not there.
        """
        free = self.free_bytes(folder)
        if free >= self.reserve_bytes:
            return None
        return StorageError(
            f"disk nearly full: {free / GB:.2f} GB are free, {self.reserve_bytes / GB:g} GB are kept",
            "take captures home and delete them here, or let storage.retention do so",
        )
