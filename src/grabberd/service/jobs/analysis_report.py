"""The report of an analysis: its document, and the page where it can be drawn."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from grabberd.storage.disk import storage_errors
from grabberd.storage.state.analysis_store import DOCUMENT, PAGE

if TYPE_CHECKING:
    from grabberd.service.jobs.analyse_file import Analysed


def write_document(folder: Path, made: "Analysed") -> dict[str, Any]:
    """Writes `report.json` and returns what is in it.

    Raises:
        StorageError: it cannot be written, or is there already.
    """
    from grabberd.processes.analysis.analysis_document import analysis_document  # noqa: PLC0415
    from grabberd.reports import document_json  # noqa: PLC0415

    document = analysis_document(made.analysis, made.tables, made.about)
    _write(folder / DOCUMENT, document_json(document))
    return document


def write_page(folder: Path, document: Mapping[str, Any]) -> Path:
    """Writes `report.html`.

    Raises:
        ExtraMissing: matplotlib is not installed.
        StorageError: it cannot be written, or is there already.
    """
    from grabberd.reports import analysis_html  # noqa: PLC0415 - only jobs and commands draw

    return _write(folder / PAGE, analysis_html(document))


def _write(path: Path, text: str) -> Path:
    with storage_errors(path), path.open("x", encoding="utf-8") as file:
        file.write(text)
    return path
