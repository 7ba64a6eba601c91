"""What is told of analyses over MQTT, and that the documents say so."""

import re
from pathlib import Path

from grabberd.documents.captures import CaptureDocument
from grabberd.documents.document import JobProblem
from grabberd.documents.examples import CAPTURE
from grabberd_liner.analyses.documents import DeviceAnalysis
from grabberd_liner.messages import AnalysisMessage, MeasuredValue, device_analysis

DOCUMENT = Path(__file__).parents[2] / "docs" / "howto" / "mqtt.md"


def test_an_analysis_has_its_quantities_by_name_or_its_problem() -> None:
    known = CaptureDocument.model_validate(CAPTURE).analysis
    assert known is not None
    done = device_analysis("cup", DeviceAnalysis.model_validate(known.model_dump() | {"capture": "c1"}))
    assert (done.device, done.capture_id, done.state, done.analysis, done.problem) == (
        "cup",
        "c1",
        "done",
        1,
        None,
    )
    assert done.quantities["liner_compression_mean_kpa"] == MeasuredValue(value=11.8, sigma=1.1, unit="kPa")
    problem = JobProblem(message="the wall does not pulsate", hint="start the pulsator")
    failed = device_analysis("cup", DeviceAnalysis(state="failed", capture="c2", problem=problem))
    assert (failed.quantities, failed.problem, failed.hint) == ({}, problem.message, problem.hint)


def test_the_document_names_every_key() -> None:
    part = DOCUMENT.read_text().partition("## A device's latest analysis")[2].partition("\n## ")[0]
    assert set(re.findall(r"^\| `(\w+)` \|", part, re.M)) == set(AnalysisMessage.model_fields)
