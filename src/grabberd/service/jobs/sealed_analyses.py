"""Queues an analysis of every capture that is sealed, on devices whose configuration asks for it."""

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from typing import Any

from grabberd.acquisition.clock import UtcClock, iso_utc
from grabberd.documents.captures import CaptureDocument
from grabberd.documents.job_problem import JobProblem
from grabberd.errors import GrabberdError, NotFound
from grabberd.service.archive.archive import Archive
from grabberd.service.archive.capture_analyses import CaptureAnalyses
from grabberd.service.jobs.analysis import AnalysisJob
from grabberd.service.jobs.analysis_inputs import inputs_of
from grabberd.service.jobs.check_job import NOTE as CHECK
from grabberd.service.jobs.job_queue import JobQueue
from grabberd.service.profiles.profiles import Profiles
from grabberd.service.setup import DeviceSetup
from grabberd.storage.state.index_entries import SEALED_ENTRY, IndexEntry
from grabberd.storage.state.state_store import StateStore

log = logging.getLogger(__name__)

SINCE = "analysed_when_sealed_since"
"""Key of the settings: by device, the time from which on its captures are analysed by themselves."""
AGAIN_S = 60.0
"""Time until all captures are looked through again, after something could not be read or queued."""
AT_ONCE = 200
"""Index entries read at once."""


class SealedAnalyses:
    """Queues analyses once, whatever comes between the seal of a capture and its place in the queue.

    Captures that are sealed now are told by `sealed`. Those that the end of the daemon kept from the queue
    are found at its next start: they started after the option was first in force, and neither have an
    analysis, nor wait for one, nor has one come to nothing. Captures from before that time are left alone.

    Args:
        queue: The jobs.
        archive: The captures.
        analyses: What is known of each capture's analysis.
        settings: Where the time is kept from which on captures are analysed.
        setups: The devices.
        profiles: Profiles that labels name.
        clock: Source of time.
        now_s: Source of monotonic time.
    """

    def __init__(
        self,
        queue: JobQueue,
        archive: Archive,
        analyses: CaptureAnalyses,
        settings: StateStore,
        setups: Mapping[str, DeviceSetup],
        profiles: Profiles,
        clock: UtcClock,
        now_s: Callable[[], float] = time.monotonic,
    ) -> None:
        self._queue = queue
        self._archive = archive
        self._analyses = analyses
        self._settings = settings
        self._setups = {name: one for name, one in setups.items() if one.config.analysis.when_sealed}
        self._profiles = profiles
        self._clock = clock
        self._now_s = now_s
        self._since: dict[str, str] = {}
        self._sealed: deque[str] = deque()
        self._search_s: float | None = None
        self._one = threading.Lock()

    def open(self) -> None:
        """Notes from when on captures are analysed: for a device that is new to it, from now on.

        Raises:
            StorageError: The settings cannot be read or written.
        """
        known: Any = self._settings.get(SINCE) or {}
        now = iso_utc(self._clock.utc_now())
        self._since = {name: str(known.get(name, now)) for name in self._setups}
        if self._since != known:
            self.keep()
        self._search_s = self._now_s() if self._since else None

    def keep(self) -> None:
        """Stores again from when on captures are analysed.

        Raises:
            StorageError: The settings cannot be written.
        """
        self._settings.put({SINCE: self._since})

    def sealed(self, capture_id: str, device: str) -> None:
        """Takes note of a capture that is sealed: the next look queues it, and nobody waits for that."""
        if device in self._since:
            self._sealed.append(capture_id)

    def look(self) -> None:
        """Queues what is to be queued; called once a second."""
        with self._one:
            try:
                while self._sealed:
                    self._consider(self._sealed.popleft())
                if self._search_s is not None and self._now_s() >= self._search_s:
                    self._search_s = self._now_s() + AGAIN_S
                    for entry in self._found():
                        self._consider(entry.id)
                    self._search_s = None
            except GrabberdError as error:  # the search finds what was not queued, too
                log.warning("captures cannot be queued for analysis now: %s; %s", error.message, error.hint)
                self._search_s = self._now_s() + AGAIN_S

    def _found(self) -> Iterator[IndexEntry]:
        """Yields the captures since the option was set, newest first."""
        after, oldest_utc = None, min(self._since.values())
        while True:
            entries = self._archive.index.page(after, AT_ONCE)
            for entry in entries:
                if entry.state == SEALED_ENTRY and entry.created_utc < oldest_utc:
                    return
                if entry.state == SEALED_ENTRY and entry.created_utc >= self._since.get(entry.device, "~"):
                    yield entry
            if len(entries) < AT_ONCE:
                return
            after = (entries[-1].created_utc, entries[-1].id)

    def _consider(self, capture_id: str) -> None:
        """Queues a capture, or notes why it cannot be analysed; one that is known already is left.

        Raises:
            StorageError: The captures cannot be read, or the queue cannot be written.
            Conflict: The queue is full.
        """
        try:
            document = self._archive.document(capture_id)
        except NotFound:  # deleted meanwhile
            return
        setup = self._setups.get(document.device)
        if document.analysis is not None or document.state != "sealed" or setup is None:
            return
        if document.labels.get("purpose") == CHECK:
            return
        found = self._profiles.of_labels(document.labels)
        wanted = _problem_of(document) or inputs_of(found, setup)
        if isinstance(wanted, JobProblem):
            self._queue.refuse(capture_id, wanted)
            self._analyses.note(capture_id)
            log.warning("capture %s is not analysed: %s; %s", capture_id, wanted.message, wanted.hint)
            return
        source = f"the configuration's {setup.config.analysis.inputs}"
        profiles = found if found.profiles else None
        job = AnalysisJob(subject=capture_id, inputs=wanted, source=source, pulsating=True, profiles=profiles)
        queued = self._queue.submit(job, automatic=True)
        log.info("capture %s is queued for analysis: %s", capture_id, queued.id)


def _problem_of(document: CaptureDocument) -> JobProblem | None:
    """Reason why there is nothing to analyse; None if there are points."""
    if not document.runs:
        return JobProblem(
            message=f"capture {document.id} was not measured: there was no calibration or no object model",
            hint="set up both, and measure the capture again",
        )
    if document.coverage is not None and document.coverage.verdict == "not_measured":
        return JobProblem(
            message=f"capture {document.id} has too few points: {document.coverage.in_words}",
            hint="look at its light, calibration and object model",
        )
    return None
