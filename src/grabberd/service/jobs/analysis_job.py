"""Analysing a sealed capture: a job, and its order."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from grabberd.errors import ExtraMissing
from grabberd.service.jobs.analysis_report import write_document, write_page
from grabberd.service.jobs.job_runner import Job, Progress
from grabberd.storage.disk import storage_errors
from grabberd.storage.state.analysis_store import RECORD, AnalysisStore

if TYPE_CHECKING:
    from grabberd.service.jobs.analyse_file import Analysed
    from grabberd.service.service import Service

SOURCE = "the order over HTTP"
_ANALYSED = 0.8
"""Share of the work; the rest is drawing and writing."""


def order_analysis(
    service: "Service",
    capture_id: str,
    inputs: Mapping[str, Any],
    *,
    bursts: Sequence[str] = (),
    run: int | None = None,
    vacuum_log: str | None = None,
) -> Job:
    """Queues the analysis of a sealed capture.

    Args:
        service: whose capture it is.
        capture_id: its id.
        inputs: what is known beside the points.
        bursts: ids of captures that are put together with it by phase.
        run: whose points; None: the latest.
        vacuum_log: text of a logger's file.

    Raises:
        NotFound, Conflict: one of the captures is not there, or still running.
    """
    return service.jobs.submit(
        "analyse",
        capture_id,
        analyse_capture,
        capture_id=capture_id,
        path=service.archive.sealed_path(capture_id),
        bursts=[service.archive.sealed_path(burst) for burst in bursts],
        inputs=dict(inputs),
        run=run,
        vacuum_log=vacuum_log,
        store=service.analyses.directory,
    )


def analyse_capture(
    progress: Progress,
    *,
    capture_id: str,
    path: Path,
    bursts: Sequence[Path],
    inputs: Mapping[str, Any],
    run: int | None,
    vacuum_log: str | None,
    store: Path,
) -> dict[str, Any]:
    """Analyses, and stores tables, maps and report as the capture's next analysis, whole or not at all.

    Returns:
        Its number as `analysis`, and its record.

    Raises:
        GrabberdError: see `grabberd.service.jobs.analyse_file.analyse_file`.
    """
    from grabberd.service.jobs.analyse_file import analyse_file  # noqa: PLC0415 - the daemon does not analyse

    made = analyse_file(
        lambda share: progress(_ANALYSED * share),
        path=path,
        inputs=inputs,
        bursts=bursts,
        run=run,
        vacuum_log=vacuum_log,
        sources=dict.fromkeys([*inputs, *(["vacuum.log"] if vacuum_log else [])], SOURCE),
    )
    analyses = AnalysisStore(store)
    with analyses.scratch() as folder:
        record = _write_all(folder, made)
        return {"analysis": analyses.publish(capture_id, folder), **record}


def _write_all(folder: Path, made: "Analysed") -> dict[str, Any]:
    from grabberd.processes.analysis.maps import map_units, target_maps  # noqa: PLC0415
    from grabberd.storage.export.analysis_export import write_csv  # noqa: PLC0415
    from grabberd.storage.export.analysis_maps import write_maps  # noqa: PLC0415

    write_csv(folder, made.tables)
    write_maps(folder, target_maps(made.tables, made.analysis.grid), map_units(made.tables))
    document = write_document(folder, made)
    record = {
        **{key: document[key] for key in ("created_utc", "version", "problems")},
        "device": made.about["device"],
        "run": made.about["run"],
        "bursts": made.about["bursts"],
        "lacks": document["inputs"]["lacks"],
        "inputs": document["inputs"]["given"],
        "summary": {one["name"]: one["values"][0] for one in document["tables"]["summary"]["columns"]},
        **_drawn(folder, document),
    }
    with storage_errors(folder / RECORD):
        (folder / RECORD).write_text(json.dumps(record, ensure_ascii=False), encoding="utf-8")
    return record


def _drawn(folder: Path, document: Mapping[str, Any]) -> dict[str, str | None]:
    """Why there is no page, if there is none: a fault in a picture must not cost the analysis."""
    try:
        write_page(folder, document)
    except ExtraMissing as error:
        return {"missing_extra": error.extra, "page_problem": None}
    except Exception as error:
        return {"missing_extra": None, "page_problem": f"{type(error).__name__}: {error}"}
    return {"missing_extra": None, "page_problem": None}
