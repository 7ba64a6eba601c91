"""Queues a job for every capture that is sealed: its guided test, if a label names one, or its analysis, on
devices whose configuration asks for it.
"""

import logging
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

from grabberd.archive.catalogue.archive import Archive
from grabberd.archive.state.index_entries import SEALED_ENTRY, IndexEntry
from grabberd.archive.state.state_database import Annotation, StateStore
from grabberd.clock import UtcClock, iso_utc
from grabberd.documents.captures import CaptureDocument
from grabberd.documents.document import JobProblem
from grabberd.errors import GrabberdError, NotFound
from grabberd.files.json_value import read_json
from grabberd.instrument.setup import DeviceSetup
from grabberd.server.daemon.check_job import NOTE as CHECK
from grabberd.work.job_queue import JobQueue
from grabberd.work.job_spec import JobSpec
from grabberd_liner.analyses.capture_analyses import CaptureAnalyses
from grabberd_liner.analyses.inputs import inputs_of, inputs_of_test
from grabberd_liner.analyses.job import AnalysisJob
from grabberd_liner.chain.guided_tests.recipes import LABEL, RECIPES
from grabberd_liner.guided_tests.job import LinerTestJob
from grabberd_liner.profiles.profiles import FoundProfiles, Profiles

log = logging.getLogger(__name__)


def sealed_job(
    document: CaptureDocument, found: FoundProfiles, device: DeviceSetup, *, analysed: bool
) -> JobSpec | JobProblem | None:
    """The job for a capture: its guided test if a label names one, else its analysis if it is to be analysed.

    Args:
        document: The capture.
        found: Profiles that its labels name.
        device: The device that captured it.
        analysed: True if its device has its captures analysed.

    Returns:
        The job; a problem if there is nothing to analyse; None for a capture that is left alone, among them
        those of a recipe that evaluates several: they are analysed with the test.
    """
    named = document.labels.get(LABEL)
    recipe = None if named is None else RECIPES.get(named)
    if named is not None and recipe is None:
        words = "capture %s is taken for no guided test: there is none %r, but %s"
        log.warning(words, document.id, named, ", ".join(RECIPES))
    if document.labels.get("purpose") == CHECK or (recipe is None and not analysed):
        return None
    if recipe is not None and recipe.several:
        return None
    if (problem := _problem_of(document)) is not None:
        return problem
    source = f"the configuration's {device.config.analysis.inputs}"
    if recipe is not None:
        inputs = inputs_of_test(recipe, found, device)
        return LinerTestJob(
            subject=document.id, test=recipe.kind, inputs=inputs, profiles={document.id: found}, source=source
        )
    wanted = inputs_of(found, device)
    if isinstance(wanted, JobProblem):
        return wanted
    return AnalysisJob(
        subject=document.id,
        inputs=wanted,
        source=source,
        pulsating=True,
        profiles=found if found.profiles else None,
    )


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


SINCE = "analysed_when_sealed_since"
"""Key of the settings: by device, the time from which on its captures are analysed by themselves."""
TESTED_SINCE = "tested_when_sealed_since"
"""The same of captures whose label names a guided test."""
NEVER = "~"
"""Later than any time."""
AGAIN_S = 60.0
"""Time until all captures are looked through again, after something could not be read or queued."""
AT_ONCE = 200
"""Index entries read at once."""


class SealedAnalyses:
    """Queues analyses once, whatever comes between the seal of a capture and its place in the queue.

    Captures that are sealed now are told by `sealed`. Those that the end of the daemon kept from the queue
    are found at its next start: they started after the option was first in force, and neither have an
    analysis, nor wait for one, nor has one come to nothing. Captures from before that time are left alone.
    For guided tests no option is needed: their time is that of the first start with a device.

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
        self._setups = dict(setups)
        self._profiles = profiles
        self._clock = clock
        self._now_s = now_s
        self._since: dict[str, str] = {}
        self._tested_since: dict[str, str] = {}
        self._sealed: deque[str] = deque()
        self._search_s: float | None = None
        self._one = threading.Lock()

    def open(self) -> None:
        """Notes from when on captures are analysed: for a device that is new to it, from now on.

        Raises:
            StorageError: The settings cannot be read or written.
        """
        asking = [name for name, one in self._setups.items() if one.config.analysis.when_sealed]
        self._since = self._times(SINCE, asking)
        self._tested_since = self._times(TESTED_SINCE, self._setups)
        if (self._since, self._tested_since) != (self._known(SINCE), self._known(TESTED_SINCE)):
            self.keep()
        self._search_s = self._now_s() if self._setups else None

    def keep(self) -> None:
        """Stores again from when on captures are analysed.

        Raises:
            StorageError: The settings cannot be written.
        """
        self._settings.put({SINCE: self._since, TESTED_SINCE: self._tested_since})

    def sealed(self, capture_id: str, device: str) -> None:
        """Takes note of a capture that is sealed: the next look queues it, and nobody waits for that."""
        if device in self._setups:
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

    def _known(self, key: str) -> dict[str, Any]:
        return dict(self._settings.get(key) or {})

    def _times(self, key: str, devices: Iterable[str]) -> dict[str, str]:
        """The time of each device, which for one that is new is now."""
        known, now = self._known(key), iso_utc(self._clock.utc_now())
        return {name: str(known.get(name, now)) for name in devices}

    def _found(self) -> Iterator[IndexEntry]:
        """Yields the captures since the first device was to be looked after, newest first."""
        after, oldest_utc = None, min([*self._since.values(), *self._tested_since.values()])
        annotations = self._archive.annotations()
        while True:
            entries = self._archive.index.page(after, AT_ONCE)
            for entry in entries:
                if entry.state == SEALED_ENTRY and entry.created_utc < oldest_utc:
                    return
                if entry.state == SEALED_ENTRY and self._may_be_meant(entry, annotations.get(entry.id)):
                    yield entry
            if len(entries) < AT_ONCE:
                return
            after = (entries[-1].created_utc, entries[-1].id)

    def _may_be_meant(self, entry: IndexEntry, annotation: Annotation | None) -> bool:
        """True for a capture that is worth looking into: its file need not be opened for the others."""
        if entry.created_utc >= self._since.get(entry.device, NEVER):
            return True
        changed = None if annotation is None else annotation.labels
        labels = read_json(entry.labels) if changed is None else changed
        tested = entry.created_utc >= self._tested_since.get(entry.device, NEVER)
        return tested and labels.get(LABEL) in RECIPES

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
        if self._analyses.of(capture_id) is not None or document.state != "sealed" or setup is None:
            return
        found = self._profiles.of_labels(document.labels)
        analysed = document.created_utc >= self._since.get(document.device, NEVER)
        wanted = sealed_job(document, found, setup, analysed=analysed)
        if isinstance(wanted, JobProblem):
            self._queue.refuse(capture_id, wanted)
            self._analyses.note(capture_id)
            log.warning("capture %s is not analysed: %s; %s", capture_id, wanted.message, wanted.hint)
        elif wanted is not None:
            queued = self._queue.submit(wanted, automatic=True)
            log.info("capture %s is queued (%s): %s", capture_id, queued.kind, queued.id)
