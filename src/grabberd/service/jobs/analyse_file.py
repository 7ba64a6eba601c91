"""Analysing a capture's points: for the command line and for jobs."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from grabberd import __version__
from grabberd.acquisition import Ledger
from grabberd.analysis import Grid, TimedPoints
from grabberd.errors import InputError, NotReady
from grabberd.processes.analysis.analyse import Analysis, FieldPoints, analyse
from grabberd.processes.analysis.inputs import read_inputs
from grabberd.processes.analysis.tables import AnalysisTables, tables
from grabberd.reconstruction import ObjectModel
from grabberd.service.clock import SystemClock, iso_utc
from grabberd.service.jobs.job_runner import Progress
from grabberd.storage import CaptureReader


class Analysed(NamedTuple):
    """An analysis, the same as tables, and what it was made from."""

    analysis: Analysis
    tables: AnalysisTables
    about: dict[str, Any]


class _Source(NamedTuple):
    """What is read of one capture."""

    fields: list[FieldPoints]
    model: ObjectModel
    about: dict[str, Any]


def analyse_file(
    progress: Progress,
    *,
    path: Path,
    inputs: Mapping[str, Any],
    bursts: Sequence[Path] = (),
    run: int | None = None,
    vacuum_log: str | None = None,
    sources: Mapping[str, str] | None = None,
) -> Analysed:
    """Analyses the points of a capture; nothing is written.

    Args:
        progress: is told the share that is done.
        path: the capture.
        inputs: the document of `processes.analysis_inputs`.
        bursts: captures of the same liner that are put together with it by phase; of each its latest run.
        run: whose points; the latest by default.
        vacuum_log: text of a logger's file, in place of the one in the inputs.
        sources: where inputs come from, by their names.

    Raises:
        CaptureFileError, NotFound: no such capture or run.
        NotReady: a capture was not measured with an object model.
        InputError: an input cannot be used with this capture.
        AnalysisError: the points make no surface.
    """
    captures = [_read(path, run), *(_read(burst, None) for burst in bursts)]
    _check_alike(captures)
    grid = Grid.of(captures[0].model)
    read = read_inputs(_with_log(inputs, vacuum_log), grid)
    progress(0.0)
    fields = [capture.fields for capture in captures]
    analysis = analyse(fields, grid, read, lambda done, of: progress(done / max(of, 1)))
    about = {
        **captures[0].about,
        "created_utc": iso_utc(SystemClock().utc_now()),
        "version": __version__,
        "bursts": [capture.about["id"] for capture in captures[1:]],
        "sources": dict(sources or {}),
    }
    return Analysed(analysis, tables(analysis), about)


def _read(path: Path, run: int | None) -> _Source:
    with CaptureReader(path) as reader:
        info = reader.run(run)
        if not info.made_with.get("object"):
            raise NotReady(
                f"run {info.run} of {path} was measured without an object model",
                f"measure it: grabberd measure {path} --calibration … --object …",
            )
        first_ns = reader.first_time_ns or 0
        fields = [
            FieldPoints(n, TimedPoints((time_ns - first_ns) / 1e9, points))
            for n, time_ns, points in reader.timed_points(info.run)
        ]
        return _Source(fields, ObjectModel.from_document(info.made_with["object"]), _origin(reader, info.run))


def _origin(reader: CaptureReader, run: int) -> dict[str, Any]:
    meta, info = reader.meta, reader.run(run)
    return {
        "id": meta.id,
        "captured_utc": meta.created_utc,
        "device": meta.device.get("name"),
        "run": info.run,
        "run_created_utc": info.created_utc,
        "run_version": info.version,
        "calibration": (info.made_with.get("calibration") or {}).get("id"),
        "object": info.made_with["object"].get("name"),
        "bits": meta.bits,
        "site": meta.site,
        "labels": meta.labels,
        "note": meta.note,
        "ledger": _ledger(reader.ledger),
    }


def _ledger(ledger: Ledger) -> dict[str, Any]:
    lacking = [{**entry._asdict(), "outcome": str(entry.outcome)} for entry in ledger.entries]
    return {"total": ledger.total, "received": ledger.received, "lacking": lacking}


def _check_alike(captures: Sequence[_Source]) -> None:
    """Bursts are put together target by target."""
    first = captures[0]
    for other in captures[1:]:
        same = first.model.target.tolist() == other.model.target.tolist()
        if not same or abs(first.model.xyz_mm - other.model.xyz_mm).max() > 0:
            raise InputError(
                f"burst {other.about['id']} was measured with another object model,"
                f" {other.about['object']}, than {first.about['id']}",
                "measure both with the same object file",
            )


def _with_log(inputs: Mapping[str, Any], vacuum_log: str | None) -> Mapping[str, Any]:
    if vacuum_log is None:
        return inputs
    vacuum = inputs.get("vacuum")
    if not isinstance(vacuum, Mapping):
        raise InputError(
            "there is a vacuum log, but the analysis' inputs have no vacuum",
            "say there where it counts: vacuum: {pulsation: log, liner: log, offset: …}",
        )
    return {**inputs, "vacuum": {**vacuum, "log": vacuum_log}}
