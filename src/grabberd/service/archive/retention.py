"""How long captures are kept: which of them go, oldest first, and their going."""

import logging
import threading
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import NamedTuple

from grabberd.config import RetentionConfig
from grabberd.errors import Conflict, GrabberdError, NotFound
from grabberd.service.archive.archive import Archive
from grabberd.service.capture.disk_guard import GB, DiskGuard
from grabberd.service.clock import Clock
from grabberd.storage.capture.schema import SUFFIX
from grabberd.storage.state.capture_index import IndexEntry

log = logging.getLogger(__name__)

EVERY_S = 60.0


@dataclass(frozen=True, slots=True)
class Policy:
    """How long captures are kept; None: that does not matter.

    Attributes:
        keep_days: they go when they are older.
        min_free_bytes: the oldest go until so much is free.
    """

    keep_days: float | None = None
    min_free_bytes: int | None = None

    @classmethod
    def from_config(cls, config: RetentionConfig) -> "Policy":
        """The policy in a configuration."""
        least = config.min_free_gb
        return cls(config.keep_days, None if least is None else round(least * GB))

    @property
    def removes(self) -> bool:
        """Whether it ever removes anything."""
        return self.keep_days is not None or self.min_free_bytes is not None


class Kept(NamedTuple):
    """A sealed capture that may go, and when it was last changed."""

    id: str
    changed: datetime
    size_bytes: int


class Removal(NamedTuple):
    """A capture that goes, and why."""

    id: str
    size_bytes: int
    because: str


def removals(captures: Iterable[Kept], policy: Policy, now: datetime, free_bytes: int) -> list[Removal]:
    """What a policy removes at a moment, oldest first.

    Args:
        captures: those that may go at all.
        policy: how long they are kept.
        now: the time.
        free_bytes: the room on the disk.
    """
    found = []
    for capture in sorted(captures, key=lambda capture: capture.changed):
        because = _because(capture, policy, now, free_bytes)
        if because:
            found.append(Removal(capture.id, capture.size_bytes, because))
            free_bytes += capture.size_bytes
    return found


def _because(capture: Kept, policy: Policy, now: datetime, free_bytes: int) -> str | None:
    if policy.keep_days is not None and now - capture.changed > timedelta(days=policy.keep_days):
        return f"older than {policy.keep_days:g} days"
    if policy.min_free_bytes is not None and free_bytes < policy.min_free_bytes:
        return f"less than {policy.min_free_bytes / GB:g} GB were free"
    return None


def candidates(directory: Path, entries: Iterable[IndexEntry], spared: Collection[str]) -> Iterator[Kept]:
    """Captures that may go: sealed, whole enough to be read, and not spared."""
    for entry in entries:
        path = directory / entry.file
        if entry.state == "sealed" and path.suffix == SUFFIX and entry.id not in spared and path.exists():
            stat = path.stat()
            yield Kept(entry.id, _changed(entry.created_utc, stat.st_mtime), stat.st_size)


def _changed(created_utc: str, written: float) -> datetime:
    """The later of both: what has just been copied here, or measured again, is not old."""
    moment = datetime.fromtimestamp(written, UTC)
    try:
        created = datetime.fromisoformat(created_utc)
    except ValueError:
        return moment
    return max(moment, created if created.tzinfo else created.replace(tzinfo=UTC))


class Retention:
    """Removes captures as the policy says, now and then, in a thread of its own.

    Args:
        archive: the captures.
        policy: how long they are kept.
        disk: says what is free.
        spared: gives the ids of captures that stay whatever the policy says.
        delete: deletes one; refuses one that has to stay after all.

    Attributes:
        removed: so many captures since the start; `removed_bytes`: their sizes together.
        applied: notified with every removal.
    """

    def __init__(
        self,
        archive: Archive,
        policy: Policy,
        disk: DiskGuard,
        clock: Clock,
        spared: Callable[[], Collection[str]],
        delete: Callable[[str], None],
    ) -> None:
        self.applied = threading.Condition()
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
        """Begins, if the policy ever removes anything."""
        if self._policy.removes:
            threading.Thread(target=self._run, name="retention", daemon=True).start()

    def stop(self) -> None:
        """Removes nothing any more."""
        self._stopping.set()

    def apply(self) -> list[Removal]:
        """Removes what has to go now.

        Raises:
            StorageError: the disk does not let it, or it is not known what is to be spared.
        """
        directory = self._archive.directory
        kept = candidates(directory, self._archive.index.list(), self._spared())
        due = removals(kept, self._policy, self._clock.utc_now(), self._disk.free_bytes(directory))
        return [removal for removal in due if self._remove(removal)]

    def _remove(self, removal: Removal) -> bool:
        try:
            self._delete(removal.id)
        except (Conflict, NotFound):  # pinned, taken up by a job or deleted at this moment
            return False
        with self.applied:
            self.removed += 1
            self.removed_bytes += removal.size_bytes
            self.applied.notify_all()
        size_gb = removal.size_bytes / GB
        log.warning("capture %s was removed (%.3f GB): %s", removal.id, size_gb, removal.because)
        return True

    def _run(self) -> None:
        while not self._stopping.is_set():
            try:
                self.apply()
                self._last_failure = None
            except (GrabberdError, OSError) as error:
                self._report(str(error))
            self._stopping.wait(EVERY_S)

    def _report(self, failure: str) -> None:
        if failure != self._last_failure:
            log.error("no capture can be removed: %s", failure)
        self._last_failure = failure
