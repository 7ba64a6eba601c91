"""The list of captures as a table, for spreadsheets: a row a capture."""

import csv
import io
from collections.abc import Iterable, Iterator, Sequence

from grabberd.archive.export.csv_file import cells
from grabberd.core.ledger import Outcome
from grabberd.documents.captures import CaptureDocument
from grabberd_liner.analyses.capture_analyses import MAIN


def captures_csv(captures: Sequence[CaptureDocument]) -> str:
    """The captures as CSV, with a column for each label that any of them has, and main quantities with σ."""
    labels = sorted({name for capture in captures for name in capture.labels})
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(cells(_head(labels)))
    writer.writerows(cells(_row(capture, labels)) for capture in captures)
    return text.getvalue()


def _head(labels: Iterable[str]) -> list[object]:
    measured = [column for name in MAIN for column in (name, f"sigma_{name}")]
    return [
        *("id", "device", "created_utc", "state", "verdict", "fields", "received"),
        *("coverage_verdict", "share_found", "bits", "lines"),
        *(f"label_{name}" for name in labels),
        *("note", "pinned", "size_bytes", "analysis_state", "analysis", "analysis_problem"),
        *measured,
    ]


def _row(capture: CaptureDocument, labels: Iterable[str]) -> list[object]:
    covered, analysis = capture.coverage, capture.analysis
    received = capture.ledger.counts.get(Outcome.RECEIVED, 0)
    return [
        *(capture.id, capture.device, capture.created_utc, capture.state, capture.verdict or ""),
        *(capture.fields, received),
        *((covered.verdict, covered.share) if covered else ("", None)),
        *(capture.bits, capture.lines or ""),
        *(capture.labels.get(name, "") for name in labels),
        *(capture.note, str(capture.pinned).lower(), capture.size_bytes),
        *((analysis.state, analysis.analysis) if analysis else ("", None)),
        analysis.problem.message if analysis and analysis.problem else "",
        *_measured(capture),
    ]


def _measured(capture: CaptureDocument) -> Iterator[float | None]:
    """The main quantities, each with its σ, to seven digits as in all tables; None where there is none."""
    found = {one.name: one for one in capture.analysis.quantities} if capture.analysis else {}
    for name in MAIN:
        known = (found[name].value, found[name].sigma) if name in found else (None, None)
        yield from (None if value is None else float(f"{value:.7g}") for value in known)
