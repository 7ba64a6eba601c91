"""How fast the liner before a device pulsated last."""

from typing import Any

from grabberd.storage.state.analysis_store import AnalysisStore


def pulsation_document(analyses: AnalysisStore, device: str) -> dict[str, Any]:
    """The rate that was found in the newest analysed capture of a device; nothing but None without one."""
    for capture_id in analyses.captures():
        for record in analyses.records(capture_id):
            rate = (record.get("summary") or {}).get("rate_per_min")
            if record.get("device") == device and rate:
                return {"rate_per_min": rate, "capture": capture_id, "analysis": record["analysis"]}
    return {"rate_per_min": None, "capture": None, "analysis": None}
