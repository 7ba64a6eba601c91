"""The latest analysis of each capture, as it is shown with the capture, and of each device.

Queues a job for every capture that is sealed: its guided test, if a label names one, or its analysis, on
devices whose configuration asks for it.
"""

import logging
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import ValidationError

from grabberd import runtime
from grabberd.archive.catalogue.archive import Archive
from grabberd.archive.state.capture_index import CaptureIndex
from grabberd.archive.state.index_entries import SEALED_ENTRY, IndexEntry
from grabberd.archive.state.state_database import Annotation, StateStore
from grabberd.config import Config
from grabberd.documents.captures import CaptureDocument
from grabberd.documents.document import JobProblem, JsonObject
from grabberd.documents.jobs import JobDocument
from grabberd.errors import ConfigError, GrabberdError, NotFound, Problem
from grabberd.files.reading import read_json
from grabberd.instrument.setup import DeviceSetup, set_up
from grabberd.runtime import UtcClock, iso_utc
from grabberd.server.daemon.jobs import NOTE as CHECK
from grabberd.work.job_queue import JobQueue
from grabberd.work.job_spec import JobSpec
from grabberd_liner.analyses.documents import (
    AnalysisRecord,
    CaptureAnalysis,
    DeviceAnalysis,
    QuantityDocument,
)
from grabberd_liner.analyses.job import AnalysisJob
from grabberd_liner.analyses.store import AnalysisStore
from grabberd_liner.chain.guided_tests.recipes import LABEL, RECIPES, Recipe
from grabberd_liner.guided_tests.job import LinerTestJob
from grabberd_liner.profiles.profiles import FoundProfiles, Profiles

log = logging.getLogger(__name__)

ANALYSING = ("analyse", "test")
"""Kinds of the jobs that analyse their subject."""
MAIN = (
    "liner_compression_mean_kpa",
    "teat_end_beyond_flow_stop_kpa",
    "teat_load_n",
    "liner_opening_s",
    "liner_closing_s",
    "rate_per_min",
    "wall_ratio",
    "stroke_mm",
    "touch_kpa",
    "buckling_kpa",
    "stiffness_n_mm",
    "liner_compression_mean_above_atmosphere_kpa",
    "overpressure_derived_kpa",
    "overpressure_raised_kpa",
    "overpressure_map_kpa",
)
"""Quantities of the table of that name which are shown with a capture; new ones come last."""
REMEMBERED = 4096


class _Made(NamedTuple):
    """An analysis in short."""

    created_utc: str | None
    quantities: tuple[QuantityDocument, ...]
    problem: str | None = None


class CaptureAnalyses:
    """Tells which analysis a capture has, and which one of a device's captures ended last.

    Args:
        analyses: The analyses that were made.
        jobs: Those that wait or run, and what came to nothing.
        index: The captures, by which their devices are known.

    Attributes:
        latest: The analysis that ended last of each device, from memory: the state shows it, and never waits
            for a disk.
    """

    def __init__(self, analyses: AnalysisStore, jobs: JobQueue, index: CaptureIndex) -> None:
        self.latest: dict[str, DeviceAnalysis] = {}
        self._analyses = analyses
        self._jobs = jobs
        self._index = index
        # An analysis never changes; its record may hold a whole vacuum log.
        self._made = lru_cache(REMEMBERED)(self._read)

    def of(self, capture_id: str) -> CaptureAnalysis | None:
        """The latest analysis of a capture; None if none was ever asked for."""
        job, failed = self._jobs.analysing(capture_id), self._jobs.unanalysed(capture_id)
        number = max(self._analyses.numbers(capture_id), default=None)
        if job is None and failed is None and number is None:
            return None
        made = _Made(None, ()) if number is None else self._made(capture_id, number)
        problem = None if failed is None else JobProblem.model_validate_json(failed.problem)
        if made.problem is not None and problem is None:
            problem = JobProblem(message=made.problem, hint="analyse the capture again")
        state = "done" if failed is None else failed.state
        return CaptureAnalysis.model_validate(
            {
                "state": state if job is None else job.state.value,
                "job": None if job is None else job.id,
                "analysis": number,
                "created_utc": made.created_utc,
                "quantities": made.quantities,
                "problem": problem if job is None else None,
            }
        )

    def open(self, jobs: Iterable[JobDocument]) -> None:
        """Learns which analyses ended last, from the jobs that are known, in their order."""
        ended = [job for job in jobs if job.kind in ANALYSING and job.ended_utc is not None]
        for job in sorted(ended, key=lambda job: job.ended_utc or ""):
            self.note(job.subject)

    def ended(self, captures: Iterable[str]) -> None:
        """Takes note of the end of a job that should have analysed these captures."""
        for capture_id in captures:
            self.note(capture_id)

    def note(self, capture_id: str) -> None:
        """Takes note of a capture whose analysis has ended, or that cannot be analysed."""
        try:
            device = self._index.get(capture_id).device
            analysis = self.of(capture_id)
        except (GrabberdError, OSError) as error:  # deleted meanwhile, or its disk is gone
            log.info("the analysis of capture %s is not shown with its device: %s", capture_id, error)
            return
        if analysis is not None:
            known = analysis.model_dump() | {"capture": capture_id}
            self.latest[device] = DeviceAnalysis.model_validate(known)

    def _read(self, capture_id: str, number: int) -> _Made:
        try:
            record = AnalysisRecord.model_validate(self._analyses.record(capture_id, number))
        except (OSError, ValueError, ValidationError) as error:
            return _Made(None, (), f"analysis {number} cannot be read: {str(error)[:200]}")
        return _Made(record.created_utc, tuple(_main(record)))


def _main(record: AnalysisRecord) -> Iterable[QuantityDocument]:
    """The main quantities of an analysis that were found."""
    found = {one.name: one for one in record.quantities if one.value is not None}
    return [found[name] for name in MAIN if name in found]


def capture_columns(capture: CaptureDocument | None) -> Mapping[str, object]:
    """Columns of the table of captures: state and number of the analysis, and main quantities with σ.

    Values have seven digits, as in all tables; there is None where nothing was found.
    """
    analysis: CaptureAnalysis | None = getattr(capture, "analysis", None)
    found = {one.name: one for one in analysis.quantities} if analysis else {}
    columns: dict[str, object] = {
        "analysis_state": analysis.state if analysis else "",
        "analysis": analysis.analysis if analysis else None,
        "analysis_problem": analysis.problem.message if analysis and analysis.problem else "",
    }
    for name in MAIN:
        values = (found[name].value, found[name].sigma) if name in found else (None, None)
        for column, value in zip((name, f"sigma_{name}"), values, strict=True):
            columns[column] = None if value is None else float(f"{value:.7g}")
    return columns


_STATED = {"liner": ("material",), "pulsator": ("vacuum",), "cow": ("flow_stop",)}
"""Inputs that come from a profile, by its kind."""


def inputs_of(found: FoundProfiles, device: DeviceSetup) -> JsonObject | JobProblem:
    """The inputs of a capture's analysis, to be completed by its profiles, or why there are none.

    Args:
        found: Profiles that the capture's labels name.
        device: The device that captured it.
    """
    if device.analysis_inputs is None and not found.profiles:
        return JobProblem(
            message=f"device {device.name} names no inputs for the analysis of its captures, and the labels"
            " of this one name no profile",
            hint=f"name a file in the configuration, devices.{device.name}.analysis.inputs, or label"
            " captures with the name of a liner's profile",
        )
    return device.analysis_inputs or {}


def inputs_of_test(recipe: Recipe, found: FoundProfiles, device: DeviceSetup) -> JsonObject:
    """The device's inputs for the analyses of a guided test.

    Left out is what the recipe or a profile states, since the test is of that liner and of that recipe; and
    without a teat the vacuum, since the configuration states that of a milking.

    Args:
        recipe: The recipe.
        found: Profiles that the capture's labels name.
        device: The device that captured it.
    """
    stated = {*recipe.inputs, *(["vacuum"] if recipe.teat is False else [])}
    for one in found.profiles:
        stated |= {*_STATED.get(one.kind, ()), *one.profile.get("analysis", {})}
    return {key: value for key, value in (device.analysis_inputs or {}).items() if key not in stated}


def check_inputs(config: Config, file: Path) -> None:
    """Checks captures' analyses with their devices' inputs, as far as they are known beforehand.

    Raises:
        ConfigError: They cannot be made.
    """
    try:
        setups = set_up(config, file)
    except ConfigError:  # which is said of the devices
        return
    if problems := [problem for setup in setups.values() for problem in _problems(setup, file)]:
        raise ConfigError(problems)


def _problems(setup: DeviceSetup, file: Path) -> Iterator[Problem]:
    key = f"devices.{setup.name}.analysis"
    if setup.config.analysis.when_sealed and not setup.documents.get("object"):
        words = "captures without an object model have no points: name one"
        yield Problem(str(file), f"{key}.when_sealed", words)
    if setup.analysis_inputs is None or not setup.documents.get("object"):
        return
    # Not at the head: the daemon reads inputs, but never analyses.
    from grabberd.core.reconstruction import ObjectModel  # noqa: PLC0415
    from grabberd_liner.analysis.grid import Grid  # noqa: PLC0415
    from grabberd_liner.chain.analysis.inputs import read_inputs  # noqa: PLC0415

    try:
        read_inputs(setup.analysis_inputs, Grid.of(ObjectModel.from_document(setup.documents["object"])))
    except GrabberdError as error:
        yield Problem(str(file), f"{key}.inputs", f"{error.message}; {error.hint}")


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

    Captures that are sealed now come from `sealed`. Those that the end of the daemon kept from the queue
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
        now_s: Callable[[], float] = runtime.monotonic,
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
        self._one = runtime.lock()

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
