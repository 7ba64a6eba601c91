"""Re-measures an archive of captures into a data set that grows for years."""

import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import CancelledError
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

from grabberd.archive.export.dataset import DataSet
from grabberd.archive.export.dataset_file import fields_so_far
from grabberd.archive.export.parquet_file import check_parquet
from grabberd.archive.measure_setups import location_settings
from grabberd.core.geometry import Calibration
from grabberd.core.reconstruction import ObjectModel
from grabberd.documents.named_types import JsonObject
from grabberd.errors import NotReady, StorageError
from grabberd.files.documents import read_documents
from grabberd.library.reprocess.capture_selection import (
    CaptureSelector,
    Refusal,
    Selection,
    Skipped,
    find_captures,
)
from grabberd.library.reprocess.reprocess_capture import CaptureTask, Recipe, TaskResult, reprocess_capture
from grabberd.library.reprocess.task_pool import TaskPool
from grabberd.library.reprocess.workers import Workers

TASKS_A_WORKER = 2
"""One that is measured and one that waits, so that no worker has to."""


@dataclass(frozen=True, slots=True)
class ReprocessRequest:
    """A request to re-measure captures.

    Attributes:
        sources: Folders, patterns and files.
        out: Folder of the data set.
        calibration: File of the calibration.
        object_model: File of the object model; None for each capture's own.
        settings: Settings that replace the captures' own, such as `method`.
        barn: Barn of captures whose site names none.
        replace: True to replace points made with another calibration.
    """

    sources: Sequence[str]
    out: Path
    calibration: Path
    object_model: Path | None = None
    settings: JsonObject = field(default_factory=dict)
    barn: str | None = None
    replace: bool = False


class ReprocessProgress(NamedTuple):
    """Fields of the captures done and in progress, fields of all captures, and number of captures left."""

    fields: int
    all_fields: int
    left: int
    fields_per_s: float


@dataclass(slots=True)
class ReprocessSummary:
    """Result for all captures."""

    measured: int = 0
    unchanged: int = 0
    fields: int = 0
    points: int = 0
    seconds: float = 0.0
    refused: list[Refusal] = field(default_factory=list)
    left_out: list[Skipped] = field(default_factory=list)
    warned: list[Skipped] = field(default_factory=list)
    interrupted: bool = False

    @property
    def fields_per_s(self) -> float:
        """Mean rate over the whole time."""
        return self.fields / self.seconds if self.seconds else 0.0


OnProgress = Callable[[ReprocessProgress], None]


def reprocess_archive(
    request: ReprocessRequest,
    workers: Callable[[Path], AbstractContextManager[Workers]],
    on_progress: OnProgress,
) -> ReprocessSummary:
    """Re-measures the captures that are not done yet; one that cannot be measured is listed, others go on.

    Args:
        request: Captures, and what to measure them with.
        workers: Starts the workers, given the folder of the data set.
        on_progress: Called about once a second.

    Raises:
        InputError, NotFound: There are no captures; a calibration, object model or setting is invalid.
        Conflict: The data set has these captures with another calibration.
        NotReady: The cluster cannot be reached, or went away.
        ExtraMissing: Parquet or Dask is not installed.
        StorageError: The data set cannot be written, or another program is writing it.
    """
    check_parquet()
    documents = _documents(request)
    found = find_captures(request.sources)
    with DataSet(request.out) as dataset:
        model = documents["object"]
        recipe = Recipe(
            dataset.keep(documents["calibration"]), model and dataset.keep(model), dict(request.settings)
        )
        selector = CaptureSelector(
            dataset, dataset.new_scratch(), recipe, barn=request.barn, replace=request.replace
        )
        selection = selector.select(found)
        if not selection.tasks:
            return _Tally(selection, on_progress).summary
        with workers(dataset.directory) as started:
            return _run(selection, dataset, started, on_progress)


def _documents(request: ReprocessRequest) -> JsonObject:
    documents = read_documents(request.calibration, request.object_model)
    Calibration.from_document(documents["calibration"])
    if documents["object"] is not None:
        ObjectModel.from_document(documents["object"])
    location_settings(request.settings)
    return documents


def _run(
    selection: Selection, dataset: DataSet, workers: Workers, on_progress: OnProgress
) -> ReprocessSummary:
    tally = _Tally(selection, on_progress)
    pool: TaskPool[CaptureTask, TaskResult] = TaskPool(
        reprocess_capture, workers.start, workers.number * TASKS_A_WORKER, tally.tick
    )
    try:
        for task, result in pool.results(selection.tasks):
            tally.enter(task, result)
    except KeyboardInterrupt:
        tally.summary.interrupted = True
    finally:
        # Before the pool is closed: a worker whose unfinished file is gone fails at its next write, so that
        # nobody waits for the end of a long capture.
        dataset.clear_scratch()
        pool.close()
    return tally.summary


class _Tally:
    """Counts the results so far."""

    def __init__(self, selection: Selection, on_progress: OnProgress) -> None:
        self.summary = ReprocessSummary(
            unchanged=selection.unchanged,
            refused=list(selection.refused),
            left_out=list(selection.left_out),
        )
        self._on_progress = on_progress
        self._began_s = time.monotonic()
        self._left = len(selection.tasks)
        self._all_fields = sum(task.span for task in selection.tasks)
        self._done_fields = 0

    def tick(self, pending: Iterable[CaptureTask]) -> None:
        pending_fields = sum(fields_so_far(task.part) for task in pending)
        self.summary.seconds = time.monotonic() - self._began_s
        measured = self.summary.fields + pending_fields
        rate = measured / self.summary.seconds if self.summary.seconds else 0.0
        done = self._done_fields + pending_fields
        self._on_progress(ReprocessProgress(done, self._all_fields, self._left, rate))

    def enter(self, task: CaptureTask, result: TaskResult | BaseException) -> None:
        if isinstance(result, CancelledError):
            raise NotReady("the cluster went away", "start it, then give the same command again: it goes on")
        known = _failure(result) if isinstance(result, BaseException) else result
        if known.hopeless:
            raise StorageError(known.problem, known.hint)
        self._left -= 1
        self._done_fields += task.span
        self.summary.measured += known.state == "measured"
        self.summary.unchanged += known.state == "unchanged"
        self.summary.fields += known.fields
        self.summary.points += known.points
        self.summary.seconds = time.monotonic() - self._began_s
        if known.warning:
            self.summary.warned.append(Skipped(task.capture, known.warning))
        if known.state == "failed":
            self.summary.refused.append(Refusal(task.capture, known.problem, known.hint))


def _failure(error: BaseException) -> TaskResult:
    problem = f"the process that measured it ended before it was done ({type(error).__name__})"
    hint = "check whether memory is short or the file is damaged, then give the same command again"
    return TaskResult("failed", problem=problem, hint=hint)
