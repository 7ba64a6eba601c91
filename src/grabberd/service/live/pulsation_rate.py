"""Latest known pulsation rate of the liner before a device."""

from grabberd.documents.devices import PulsationDocument
from grabberd.storage.state.analysis_store import AnalysisStore


def pulsation_document(analyses: AnalysisStore, device: str) -> PulsationDocument:
    """The rate found in the newest analysed capture of a device; all None where there is none."""
    for capture_id in analyses.captures():
        for record in analyses.records(capture_id):
            rate = (record.get("summary") or {}).get("rate_per_min")
            if record.get("device") == device and rate:
                return PulsationDocument(rate_per_min=rate, capture=capture_id, analysis=record["analysis"])
    return PulsationDocument(rate_per_min=None, capture=None, analysis=None)
