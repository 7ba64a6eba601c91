"""The documents of analyses, built from the records beside them."""

from grabberd.documents.analyses import AnalysisList, AnalysisRow
from grabberd.documents.devices import PulsationDocument
from grabberd.errors import ExtraMissing, NotFound
from grabberd.storage.state.analysis_store import PAGE, AnalysisStore


def analysis_list(analyses: AnalysisStore, capture_id: str) -> AnalysisList:
    """A capture's analyses, newest first."""
    records = analyses.records(capture_id)
    return AnalysisList(analyses=[AnalysisRow.model_validate(record) for record in records])


def report_page(analyses: AnalysisStore, capture_id: str, number: int) -> bytes:
    """The report of an analysis as HTML.

    Raises:
        NotFound: there is no such analysis, or its report could not be drawn.
        ExtraMissing: what draws the report was not installed when the analysis was made.
    """
    rows = analysis_list(analyses, capture_id).analyses
    row = next((row for row in rows if row.analysis == number), None)
    if row is not None and row.missing_extra:
        raise ExtraMissing("the report of an analysis", row.missing_extra)
    if row is not None and row.page_problem:
        raise NotFound(
            f"the report of analysis {number} could not be drawn: {row.page_problem}",
            "its numbers are available: leave /report off the address",
        )
    return analyses.file(capture_id, number, PAGE).read_bytes()


def pulsation_document(analyses: AnalysisStore, device: str) -> PulsationDocument:
    """The rate found in the newest analysed capture of a device; all None where there is none."""
    for capture_id in analyses.captures():
        for record in analyses.records(capture_id):
            rate = (record.get("summary") or {}).get("rate_per_min")
            if record.get("device") == device and rate:
                return PulsationDocument(rate_per_min=rate, capture=capture_id, analysis=record["analysis"])
    return PulsationDocument(rate_per_min=None, capture=None, analysis=None)
