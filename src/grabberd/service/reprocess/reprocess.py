"""Measuring an archive of captures again, on many processes, into a data set that is added to for years."""

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import CancelledError
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from grabberd.errors import NotReady, StorageError
from grabberd.geometry import Calibration
from grabberd.reconstruction import ObjectModel
from grabberd.service.reprocess.capture_selection import LeftOut, Plan, Planner, Refusal, find_captures
from grabberd.service.reprocess.executors import Workers
from grabberd.service.reprocess.fan_out import FanOut
from grabberd.service.reprocess.reprocess_capture import Asked, Order, Outcome, measure_capture
from grabberd.service.setup import location_settings, read_documents
from grabberd.storage.export.dataset import DataSet
from grabberd.storage.export.dataset_file import fields_so_far
from grabberd.storage.export.parquet_file import check_parquet

ORDERS_A_WORKER = 2
"""One that is measured and one that waits, so that no worker does."""


@dataclass(frozen=True, slots=True)
class Request:
    """What is to be done.

    Attributes:
        sources: folders, patterns and files.
        out: the data set's folder.
        calibration: file; `object_model`: file, None for each capture's own.
        settings: those that differ from the captures' own, such as `method`.
        barn: of captures whose site has none.
        replace: whether points of another calibration make room.
    """

    sources: Sequence[str]
    out: Path
    calibration: Path
    object_model: Path | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)
    barn: str | None = None
    replace: bool = False


class Progress(NamedTuple):
    """How far it is: fields of captures that are done and under way, and of all; captures that are left."""

    fields: int
    all_fields: int
    left: int
    fields_per_s: float


@dataclass(slots=True)
class Summary:
    """What became of all captures."""

    measured: int = 0
    unchanged: int = 0
    fields: int = 0
    points: int = 0
    seconds: float = 0.0
    refused: list[Refusal] = field(default_factory=list)
    left_out: list[LeftOut] = field(default_factory=list)
    interrupted: bool = False

    @property
    def fields_per_s(self) -> float:
        """Of those that were measured."""
        return self.fields / self.seconds if self.seconds else 0.0


Tell = Callable[[Progress], None]


def reprocess(
    request: Request, workers: Callable[[Path], AbstractContextManager[Workers]], tell: Tell
) -> Summary:
    """Measures the captures that are not done yet; a capture that cannot be is listed, and the others go on.

    Args:
        request: what is to be done.
        workers: makes those that do it, given the data set's folder.
        tell: is told the progress, about once a second.

    Raises:
        InputError, NotFound: no captures; a calibration, object model or setting that is none.
        Conflict: the data set has these captures with another calibration.
        NotReady: the cluster is not there, or went away.
        ExtraMissing: Parquet or Dask is not installed.
        StorageError: the data set cannot be written, or is being written.
    """
    check_parquet()
    documents = _documents(request)
    found = find_captures(request.sources)
    with DataSet(request.out) as dataset:
        model = documents["object"]
        asked = Asked(
            dataset.keep(documents["calibration"]), model and dataset.keep(model), dict(request.settings)
        )
        planner = Planner(dataset, dataset.new_scratch(), asked, barn=request.barn, replace=request.replace)
        plan = planner.plan(found)
        if not plan.orders:
            return _Tally(plan, tell).summary
        with workers(dataset.directory) as those:
            return _carry_out(plan, dataset, those, tell)


def _documents(request: Request) -> dict[str, Any]:
    documents = read_documents(request.calibration, request.object_model)
    Calibration.from_document(documents["calibration"])
    if documents["object"] is not None:
        ObjectModel.from_document(documents["object"])
    location_settings(request.settings)
    return documents


def _carry_out(plan: Plan, dataset: DataSet, workers: Workers, tell: Tell) -> Summary:
    tally = _Tally(plan, tell)
    at_once = workers.number * ORDERS_A_WORKER
    crew: FanOut[Order, Outcome] = FanOut(measure_capture, workers.start, at_once, tally.tick)
    try:
        for order, outcome in crew.results(plan.orders):
            tally.enter(order, outcome)
    except KeyboardInterrupt:
        tally.summary.interrupted = True
    finally:
        dataset.clear_scratch()  # who still writes notices, and ends
        crew.close()
    return tally.summary


class _Tally:
    """What has become of the orders so far."""

    def __init__(self, plan: Plan, tell: Tell) -> None:
        self.summary = Summary(
            unchanged=plan.unchanged, refused=list(plan.refused), left_out=list(plan.left_out)
        )
        self._tell = tell
        self._began = time.monotonic()
        self._left = len(plan.orders)
        self._all_fields = sum(order.span for order in plan.orders)
        self._passed = 0

    def tick(self, under_way: Iterable[Order]) -> None:
        under_way_fields = sum(fields_so_far(order.part) for order in under_way)
        self.summary.seconds = time.monotonic() - self._began
        measured = self.summary.fields + under_way_fields
        rate = measured / self.summary.seconds if self.summary.seconds else 0.0
        self._tell(Progress(self._passed + under_way_fields, self._all_fields, self._left, rate))

    def enter(self, order: Order, outcome: Outcome | BaseException) -> None:
        if isinstance(outcome, CancelledError):
            raise NotReady("the cluster went away", "start it, then give the same command again: it goes on")
        known = _of_error(outcome) if isinstance(outcome, BaseException) else outcome
        if known.hopeless:
            raise StorageError(known.problem, known.hint)
        self._left -= 1
        self._passed += order.span
        self.summary.measured += known.state == "measured"
        self.summary.unchanged += known.state == "unchanged"
        self.summary.fields += known.fields
        self.summary.points += known.points
        self.summary.seconds = time.monotonic() - self._began
        if known.state == "failed":
            self.summary.refused.append(Refusal(order.capture, known.problem, known.hint))


def _of_error(error: BaseException) -> Outcome:
    problem = f"the process that measured it ended before it was done ({type(error).__name__})"
    hint = "see whether memory is short or the file is damaged, then give the same command again"
    return Outcome("failed", problem=problem, hint=hint)
