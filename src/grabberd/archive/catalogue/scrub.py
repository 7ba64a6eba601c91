"""Scrubbing: once a month, all sealed captures are checked against their digests.

What is whole of captures that were set aside as unreadable is saved as well, once after each start.
"""

import logging
from collections.abc import Callable, Mapping
from datetime import datetime, timedelta
from pathlib import Path

from grabberd import runtime
from grabberd.archive.capture.crash_recovery import save_whole
from grabberd.archive.capture.schema import DAMAGED
from grabberd.archive.capture.verification import verify_files
from grabberd.archive.catalogue.archive import Archive
from grabberd.archive.state.index_entries import SEALED_ENTRY
from grabberd.archive.state.state_database import StateStore
from grabberd.errors import Cause, GrabberdError
from grabberd.fault_board import Complaint, FaultBoard
from grabberd.runtime import UtcClock, iso_utc

log = logging.getLogger(__name__)
EVERY = timedelta(days=30)
LOOK_S = 600.0
"""Interval of checks whether a month is over and whether a running capture has ended: scrubbing would compete
with recording for the disk."""
KEY = "scrub"
_NAMED = 3


class Scrub:
    """Verifies the captures in its own thread; damaged ones are reported as a fault until they are removed.

    Args:
        archive: The captures.
        store: Stores the result over restarts.
        faults: Board for reporting damage.
        clock: Source of time.
        busy: Returns True while a capture is being recorded.
    """

    def __init__(
        self,
        archive: Archive,
        store: StateStore,
        faults: FaultBoard,
        clock: UtcClock,
        busy: Callable[[], bool],
    ) -> None:
        self._archive = archive
        self._store = store
        self._faults = faults
        self._clock = clock
        self._busy = busy
        self._stopping = runtime.event()
        self._complaint = Complaint(log, "the captures cannot be verified: %s")
        self._tried: set[Path] = set()

    def start(self) -> None:
        """Starts the thread."""
        runtime.Thread(target=self._run, name="scrub", daemon=True).start()

    def stop(self) -> None:
        """Ends the thread after the present file; the next round starts from the first."""
        self._stopping.set()

    def look(self) -> bool:
        """Verifies all captures if a month is over; returns True if it did.

        Raises:
            StorageError: The captures are not accessible, or no process can be started.
        """
        known = self._store.get(KEY) or {}
        if not known:  # the first start: a month begins
            self._keep({})
            return False
        self._report(known.get("damaged", {}))
        since = self._clock.utc_now() - datetime.fromisoformat(known["ended_utc"])
        # A negative interval: a clock that was set back must not delay the next round for years.
        if timedelta(0) <= since < EVERY or self._busy():
            return False
        damaged = self._round()
        if damaged is None:
            return False
        self._keep(damaged)
        self._report(damaged)
        return True

    def save_whole(self) -> None:
        """Saves what is whole of captures that were set aside, unless somebody records.

        Raises:
            StorageError: The index cannot be used.
        """
        paths = [self._archive.directory / entry.file for entry in self._archive.index.damaged()]
        for path in paths:
            if path in self._tried or path.parent.name != DAMAGED or self._busy() or self._stopping.is_set():
                continue
            self._tried.add(path)
            if (saved := save_whole(path)) is not None:
                log.warning("what is whole of %s is saved as %s", path.name, saved.name)
                self._archive.index.add(saved)

    def _round(self) -> dict[str, str] | None:
        """The damaged captures with the damage of each; None if the round was interrupted."""
        damaged: dict[str, str] = {}
        entries = [entry for entry in self._archive.index.list() if entry.state == SEALED_ENTRY]
        for entry in entries:
            while self._busy() and not self._stopping.wait(LOOK_S):
                pass
            if self._stopping.is_set():
                return None
            path = self._archive.directory / entry.file
            for _, found in verify_files([path]):
                if found.damages and path.exists():
                    damaged[entry.id] = found.damages[0]
                    log.error("capture %s is damaged: %s", entry.id, "; ".join(found.damages))
        log.info("%d captures were verified, %d are damaged", len(entries), len(damaged))
        return damaged

    def _keep(self, damaged: Mapping[str, str]) -> None:
        self._store.put({KEY: {"ended_utc": iso_utc(self._clock.utc_now()), "damaged": dict(damaged)}})

    def _report(self, damaged: Mapping[str, str]) -> None:
        there = {entry.id for entry in self._archive.index.list() if entry.state == SEALED_ENTRY}
        left = {capture_id: reason for capture_id, reason in damaged.items() if capture_id in there}
        if not left:
            self._faults.resolve(Cause.CAPTURE_CHANGED)
            return
        named = "; ".join(f"{capture_id}: {reason}" for capture_id, reason in list(left.items())[:_NAMED])
        more = f"; and {len(left) - _NAMED} more" if len(left) > _NAMED else ""
        self._faults.report(
            Cause.CAPTURE_CHANGED,
            f"the disk has altered stored data: {named}{more}",
            "copy these captures back from a backup, or delete them after exporting what is left; "
            "check the disk (smartctl); grabberd storage verify lists everything that is damaged",
        )

    def _run(self) -> None:
        while not self._stopping.is_set():
            try:
                self.save_whole()
                self.look()
                self._complaint.over()
            except (GrabberdError, OSError) as error:
                self._complaint.failed(f"{error}")
            self._stopping.wait(LOOK_S)
