"""Retention: removes the oldest captures by age and by free disk space."""

import logging
import threading
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import NamedTuple

from grabberd.archive.capture.schema import SUFFIX
from grabberd.archive.catalogue.archive import Archive
from grabberd.archive.catalogue.disk_guard import GB, DiskGuard
from grabberd.archive.state.index_entries import IndexEntry
from grabberd.clock import UtcClock
from grabberd.config import RetentionConfig
from grabberd.errors import Conflict, NotFound

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
        self._stopping = threading.Event()
        self._last_failure: str | None = None

    def start(self) -> None:
        """Starts the thread if the policy has any limit."""
        if self._policy.removes:
            threading.Thread(target=self._run, name="retention", daemon=True).start()

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
                self._last_failure = None
            except (
                Exception
            ) as error:  # whatever the index or a file contains: without this thread the disk fills up
                self._report(str(error) or type(error).__name__)
            self._stopping.wait(EVERY_S)

    def _report(self, failure: str) -> None:
        """Logs a failure once, not every minute while it lasts."""
        if failure != self._last_failure:
            log.error("no capture can be removed: %s", failure)
        self._last_failure = failure
