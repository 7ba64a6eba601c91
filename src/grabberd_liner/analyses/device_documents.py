"""The documents of analyses, built from the records beside them."""

from grabberd.errors import ExtraMissing, NotFound
from grabberd_liner.analyses.documents import AnalysisList, AnalysisRow, PulsationDocument
from grabberd_liner.analyses.pressure_method import is_outdated
from grabberd_liner.analyses.store import PAGE, AnalysisStore

_FOR_PRESSURE = frozenset({"reference", "material", "vacuum", "sought_kpa"})
"""Inputs without which no analysis ever had a pressure."""


def analysis_list(analyses: AnalysisStore, capture_id: str) -> AnalysisList:
    """A capture's analyses, newest first."""
    rows = [AnalysisRow.model_validate(record) for record in analyses.records(capture_id)]
    return AnalysisList(
        analyses=[
            row.model_copy(
                update={"outdated_pressure": is_outdated(row.pressure_method, _asked_for_pressure(row))}
            )
            for row in rows
        ]
    )


def analysis_row(analyses: AnalysisStore, capture_id: str, number: int) -> AnalysisRow | None:
    """One analysis of a capture as it is listed; None where there is none of that number."""
    rows = analysis_list(analyses, capture_id).analyses
    return next((row for row in rows if row.analysis == number), None)


def report_page(analyses: AnalysisStore, capture_id: str, number: int) -> bytes:
    """The report of an analysis as HTML; one with outdated pressures says so at its top.

    Raises:
        NotFound: there is no such analysis, or its report could not be drawn.
        ExtraMissing: what draws the report was not installed when the analysis was made.
    """
    row = analysis_row(analyses, capture_id, number)
    if row is not None and row.missing_extra:
        raise ExtraMissing("the report of an analysis", row.missing_extra)
    if row is not None and row.page_problem:
        raise NotFound(
            f"the report of analysis {number} could not be drawn: {row.page_problem}",
            "its numbers are available: leave /report off the address",
        )
    page = analyses.file(capture_id, number, PAGE).read_bytes()
    if row is None or not row.outdated_pressure:
        return page
    # What draws the notice is needed for these pages alone, and the daemon starts without it.
    from grabberd_liner.analyses.report import marked_outdated  # noqa: PLC0415

    return marked_outdated(page.decode()).encode()


def _asked_for_pressure(row: AnalysisRow) -> bool:
    """True if an analysis had all that pressures take; whether every field got one does not matter."""
    lacked = any("pressure" in words for words in row.lacks)
    return row.inputs.keys() >= _FOR_PRESSURE and not lacked


def pulsation_document(analyses: AnalysisStore, device: str) -> PulsationDocument:
    """The rate found in the newest analysed capture of a device; all None where there is none."""
    for capture_id in analyses.captures():
        for record in analyses.records(capture_id):
            rate = (record.get("summary") or {}).get("rate_per_min")
            if record.get("device") == device and rate:
                return PulsationDocument(rate_per_min=rate, capture=capture_id, analysis=record["analysis"])
    return PulsationDocument(rate_per_min=None, capture=None, analysis=None)
