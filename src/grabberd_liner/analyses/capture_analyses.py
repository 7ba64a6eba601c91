"""The latest analysis of each capture, as it is shown with the capture, and of each device."""

import logging
from collections.abc import Iterable, Mapping
from functools import lru_cache
from typing import NamedTuple

from pydantic import ValidationError

from grabberd.archive.state.capture_index import CaptureIndex
from grabberd.documents.captures import CaptureDocument
from grabberd.documents.document import JobProblem
from grabberd.documents.jobs import JobDocument
from grabberd.errors import GrabberdError
from grabberd.work.job_queue import JobQueue
from grabberd_liner.analyses.documents import (
    AnalysisRecord,
    CaptureAnalysis,
    DeviceAnalysis,
    QuantityDocument,
)
from grabberd_liner.analyses.store import AnalysisStore

log = logging.getLogger(__name__)

ANALYSING = ("analyse", "test")
"""Kinds of the jobs that analyse their subject."""
MAIN = (
    "liner_compression_mean_kpa",
    "overpressure_kpa",
    "teat_load_n",
    "liner_opening_s",
    "liner_closing_s",
    "rate_per_min",
    "wall_ratio",
    "stroke_mm",
    "touch_kpa",
    "buckling_kpa",
    "stiffness_n_mm",
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
