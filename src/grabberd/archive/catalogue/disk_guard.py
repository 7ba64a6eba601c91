"""Disk space: how long captures can continue, when they must end, and which are removed to make room."""

import errno
import logging
import os
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import NamedTuple

from grabberd import runtime
from grabberd.archive.capture.schema import SUFFIX
from grabberd.archive.catalogue.archive import Archive
from grabberd.archive.state.index_entries import IndexEntry
from grabberd.config import RetentionConfig
from grabberd.documents.state import StorageDocument
from grabberd.errors import Cause, Conflict, NotFound, StorageError
from grabberd.fault_board import Complaint
from grabberd.files.disk import storage_errors
from grabberd.runtime import UtcClock

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


log = logging.getLogger(__name__)

EVERY_S = 60.0


@dataclass(frozen=True, slots=True)
class Policy:
    """Limits on how long captures are kept; without limits, nothing is removed.

    Attributes:
        keep_days: Maximum age in days, or None.
        min_free_bytes: Free disk space below which the oldest captures are removed, or None.
    """

    keep_days: float | None = None
    min_free_bytes: int | None = None

    @classmethod
    def from_config(cls, config: RetentionConfig) -> "Policy":
        """Reads the policy from the configuration."""
        least = config.min_free_gb
        return cls(config.keep_days, None if least is None else round(least * GB))

    @property
    def removes(self) -> bool:
        """True if the policy has any limit."""
        return self.keep_days is not None or self.min_free_bytes is not None


class Candidate(NamedTuple):
    """A sealed capture that may be removed, and when it was last changed."""

    id: str
    changed: datetime
    size_bytes: int


class Removal(NamedTuple):
    """A capture to remove, and why."""

    id: str
    size_bytes: int
    because: str


def removals(captures: Iterable[Candidate], policy: Policy, now: datetime, free_bytes: int) -> list[Removal]:
    """Returns what a policy removes now, oldest first.

    Args:
        captures: The candidates.
        policy: How long captures are kept.
        now: Present time.
        free_bytes: Free space on the disk.
    """
    found = []
    for capture in sorted(captures, key=lambda capture: capture.changed):
        because = _because(capture, policy, now, free_bytes)
        if because:
            found.append(Removal(capture.id, capture.size_bytes, because))
            # As if the capture were deleted already, so that no more than necessary is chosen.
            free_bytes += capture.size_bytes
    return found


def _because(capture: Candidate, policy: Policy, now: datetime, free_bytes: int) -> str | None:
    if policy.keep_days is not None and now - capture.changed > timedelta(days=policy.keep_days):
        return f"older than {policy.keep_days:g} days"
    if policy.min_free_bytes is not None and free_bytes < policy.min_free_bytes:
        return f"less than {policy.min_free_bytes / GB:g} GB were free"
    return None


def candidates(
    directory: Path, entries: Iterable[IndexEntry], spared: Collection[str]
) -> Iterator[Candidate]:
    """Yields the captures that may be removed: sealed, readable, and not spared."""
    for entry in entries:
        path = directory / entry.file
        if entry.state == "sealed" and path.suffix == SUFFIX and entry.id not in spared and path.exists():
            stat = path.stat()
            yield Candidate(entry.id, _changed(entry.created_utc, stat.st_mtime), stat.st_size)


def _changed(created_utc: str, written: float) -> datetime:
    """Returns the later of the two: a capture that was just copied here or re-measured is not old."""
    return max(datetime.fromtimestamp(written, UTC), datetime.fromisoformat(created_utc))


class Retention:
    """Removes captures according to the policy, once a minute in its own thread.

    Args:
        archive: The captures.
        policy: How long they are kept.
        disk: Measures the free space.
        clock: Source of time.
        spared: Returns the ids of captures that must be kept regardless of the policy.
        delete: Deletes one capture; raises Conflict or NotFound if it cannot be deleted after all.

    Attributes:
        removed: Number of captures removed since the start; `removed_bytes`: their total size.
    """

    def __init__(
        self,
        archive: Archive,
        policy: Policy,
        disk: DiskGuard,
        clock: UtcClock,
        spared: Callable[[], Collection[str]],
        delete: Callable[[str], None],
    ) -> None:
        self.removed = 0
        self.removed_bytes = 0
        self._archive = archive
        self._policy = policy
        self._disk = disk
        self._clock = clock
        self._spared = spared
        self._delete = delete
        self._stopping = runtime.event()
        self._complaint = Complaint(log, "no capture can be removed: %s")

    def start(self) -> None:
        """Starts the thread if the policy has any limit."""
        if self._policy.removes:
            runtime.Thread(target=self._run, name="retention", daemon=True).start()

    def stop(self) -> None:
        """Stops removing captures."""
        self._stopping.set()

    def apply(self) -> list[Removal]:
        """Removes captures according to the policy, and returns them.

        Raises:
            StorageError: A file cannot be deleted, or the captures to keep are unknown.
        """
        directory = self._archive.directory
        known = candidates(directory, self._archive.index.list(), self._spared())
        due = removals(known, self._policy, self._clock.utc_now(), self._disk.free_bytes(directory))
        return [removal for removal in due if self._remove(removal)]

    def _remove(self, removal: Removal) -> bool:
        try:
            self._delete(removal.id)
        except (Conflict, NotFound):  # pinned, needed by a job or deleted after `spared` was called
            return False
        self.removed += 1
        self.removed_bytes += removal.size_bytes
        size_gb = removal.size_bytes / GB
        log.warning("capture %s was removed (%.3f GB): %s", removal.id, size_gb, removal.because)
        return True

    def _run(self) -> None:
        while not self._stopping.is_set():
            try:
                self.apply()
                self._complaint.over()
            # Whatever the index or a file contains: without this thread the disk fills up.
            except Exception as error:
                self._complaint.failed(str(error) or type(error).__name__)
            self._stopping.wait(EVERY_S)
