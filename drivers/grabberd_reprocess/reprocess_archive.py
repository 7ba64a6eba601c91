"""Re-measures an archive of captures into a data set that grows for years.

The captures are selected, and it is said why the others are not, before any work is done.
"""

import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import CancelledError
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from glob import glob
from pathlib import Path
from typing import NamedTuple

from grabberd import __version__
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.schema import DAMAGED, PART, SUFFIX
from grabberd.archive.export.dataset import DataSet, Place, fields_so_far, read_about
from grabberd.archive.export.table_files import check_parquet
from grabberd.archive.measure_setups import location_settings
from grabberd.core.geometry import Calibration
from grabberd.core.reconstruction import ObjectModel
from grabberd.documents.document import JsonObject
from grabberd.errors import CaptureFileError, Conflict, GrabberdError, InputError, NotReady, StorageError
from grabberd.files.reading import read_documents
from grabberd_reprocess.reprocess_capture import CaptureTask, Recipe, TaskResult, reprocess_capture
from grabberd_reprocess.workers import TaskPool, Workers

LISTED = 3
"""Number of other calibrations that a message names."""


class Refusal(NamedTuple):
    """A capture that cannot be measured."""

    capture: Path
    problem: str
    hint: str


class Skipped(NamedTuple):
    """A file that was skipped, as it should be."""

    capture: Path
    reason: str


@dataclass(slots=True)
class Selection:
    """The tasks to do; `unchanged` counts the captures that are done already."""

    tasks: list[CaptureTask] = field(default_factory=list)
    unchanged: int = 0
    refused: list[Refusal] = field(default_factory=list)
    left_out: list[Skipped] = field(default_factory=list)


class Found(NamedTuple):
    """Sealed captures, and files that are skipped."""

    captures: list[Path]
    left_out: list[Skipped]


def find_captures(sources: Iterable[str]) -> Found:
    """Finds captures by name, by patterns such as `*/2026-03-*.grab`, and anywhere below folders.

    Raises:
        InputError: A source does not exist, or there is no capture at all.
    """
    sources = list(sources)
    paths = sorted({path.resolve() for source in sources for path in _files(source)})
    left_out = [Skipped(path, reason) for path in paths if (reason := _reason_to_skip(path))]
    captures = [path for path in paths if path.name.endswith(SUFFIX) and not _reason_to_skip(path)]
    if not captures:
        also = f"; {left_out[0].capture.name} is skipped: it {left_out[0].reason}" if left_out else ""
        raise InputError(
            f"no sealed captures in {', '.join(sources)}{also}", f"name folders, or files ending in {SUFFIX}"
        )
    return Found(captures, left_out)


def _files(source: str) -> Iterator[Path]:
    path = Path(source)
    if path.is_dir():
        yield from (one for end in (SUFFIX, SUFFIX + PART) for one in path.rglob(f"*{end}") if one.is_file())
    elif path.is_file():
        yield path
    elif found := glob(source, recursive=True):
        for one in found:
            yield from _files(one)
    else:
        hint = "check the name; put patterns in quotes, and use ** to go down into folders"
        raise InputError(f"there is no {source}", hint)


def _reason_to_skip(path: Path) -> str | None:
    if path.name.endswith(SUFFIX + PART):
        return "is not sealed: it is still being recorded, or its daemon has to be started once"
    if path.parent.name == DAMAGED:
        return "was set aside as damaged"
    return None


class CaptureSelector:
    """Compares captures with the data set.

    Args:
        dataset: Where the points go.
        scratch: Its folder for unfinished files.
        recipe: What to measure with.
        barn: Barn of captures whose site names none.
        replace: True to replace points made with another calibration.
    """

    def __init__(
        self, dataset: DataSet, scratch: Path, recipe: Recipe, *, barn: str | None, replace: bool
    ) -> None:
        self._dataset = dataset
        self._scratch = scratch
        self._recipe = recipe
        self._barn = barn
        self._replace = replace
        self._taken: dict[tuple[str, str], tuple[Place, Path | None]] = {
            (place.barn, place.capture): (place, None) for place in dataset.places()
        }
        self._other_calibrations: list[str] = []

    def select(self, found: Found) -> Selection:
        """Decides what to do with each capture.

        Raises:
            Conflict: The data set has points of these captures that were measured with something else.
        """
        selection = Selection(left_out=list(found.left_out))
        for number, path in enumerate(found.captures):
            try:
                self._enter(path, self._scratch / f"{number}{PART}", selection)
            except GrabberdError as error:
                selection.refused.append(Refusal(path, error.message, error.hint))
        if self._other_calibrations:
            raise self._conflict()
        return selection

    def _enter(self, path: Path, part: Path, selection: Selection) -> None:
        with CaptureReader(path) as reader:
            place, span = self._place(reader), reader.field_span
        if reason := self._copy_of(place, path):
            selection.left_out.append(Skipped(path, reason))
            return
        target = self._dataset.directory / place.path
        if target.exists() and self._is_done(path, target, place.barn):
            selection.unchanged += 1
            return
        documents = self._dataset.made_with
        selection.tasks.append(CaptureTask(path, place.barn, target, part, documents, self._recipe, span))

    def _place(self, reader: CaptureReader) -> Place:
        barn = str(reader.meta.site.get("barn") or self._barn or "").strip()
        if not barn:
            raise InputError(
                f"the site of capture {reader.meta.id} names no barn", "name it with --barn NAME"
            )
        try:
            return Place.of(reader.meta, barn)
        except ValueError as error:
            raise CaptureFileError(
                f"{reader.path}: its start time is invalid: {error}", "set the file aside"
            ) from error

    def _copy_of(self, place: Place, path: Path) -> str | None:
        """Says of which other file this one is a copy; None if it is none.

        Raises:
            Conflict: Another capture has the same id.
        """
        other, other_path = self._taken.setdefault((place.barn, place.capture), (place, path))
        if other != place:
            where = other_path or self._dataset.directory / other.path
            raise Conflict(
                f"another capture of barn {place.barn} is also called {place.capture}: {where}",
                "measure one of them into another --out, or with another --barn",
            )
        self._taken[place.barn, place.capture] = (place, other_path or path)
        return None if other_path in {None, path} else f"is the same capture as {other_path}"

    def _is_done(self, path: Path, target: Path, barn: str) -> bool:
        about, known = read_about(target), path.stat()
        if not self._replace and about.get("asked", self._wanted) != self._wanted:
            self._other_calibrations.append(str((about.get("calibration") or {}).get("id")))
            return True
        capture = about.get("capture") or {}
        same_file = (capture.get("bytes"), capture.get("mtime_ns")) == (known.st_size, known.st_mtime_ns)
        same_barn = (about.get("site") or {}).get("barn") == barn
        # By size and time, not by digest: a run over an archive of years must not read all of it.
        made = (about.get("asked"), about.get("version"))
        return same_file and same_barn and made == (self._wanted, __version__)

    @property
    def _wanted(self) -> Mapping[str, object]:
        return self._recipe.to_document()

    def _conflict(self) -> Conflict:
        names = ", ".join(sorted(set(self._other_calibrations))[:LISTED])
        return Conflict(
            f"{self._dataset.directory} has points of {len(self._other_calibrations)} of these captures, "
            f"measured with another calibration or object model, or other settings (calibration {names}); "
            "nothing was done",
            "name another --out to keep both, or --replace to replace those points",
        )


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
            unchanged=selection.unchanged, refused=list(selection.refused), left_out=list(selection.left_out)
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
