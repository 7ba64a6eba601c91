"""Documents of analyses: the pulsation rate, device by device."""

import json
from pathlib import Path

import pytest

from grabberd.documents.devices import PulsationDocument
from grabberd.service.archive.analysis_documents import pulsation_document
from grabberd.storage.state.analysis_store import RECORD, AnalysisStore

NOTHING = PulsationDocument(rate_per_min=None, capture=None, analysis=None)


@pytest.fixture
def analyses(tmp_path: Path) -> AnalysisStore:
    return AnalysisStore(tmp_path)


def analysed(analyses: AnalysisStore, capture: str, device: str, rate: float | None) -> None:
    record = {"device": device, "summary": {"rate_per_min": rate}}
    with analyses.scratch() as folder:
        (folder / RECORD).write_text(json.dumps(record))
        analyses.publish(capture, folder)


def test_before_the_first_analysis_nothing_is_known(analyses: AnalysisStore) -> None:
    assert pulsation_document(analyses, "barn") == NOTHING


def test_the_newest_analysed_capture_counts_and_of_it_the_newest_analysis(analyses: AnalysisStore) -> None:
    analysed(analyses, "20260301T090000000Z-barn", "barn", 58.0)
    analysed(analyses, "20260302T090000000Z-barn", "barn", 60.0)
    analysed(analyses, "20260302T090000000Z-barn", "barn", 60.4)
    found = pulsation_document(analyses, "barn")
    expected = {"rate_per_min": 60.4, "capture": "20260302T090000000Z-barn", "analysis": 2}
    assert found == PulsationDocument.model_validate(expected)


def test_what_has_no_cycle_in_it_is_passed_over(analyses: AnalysisStore) -> None:
    analysed(analyses, "20260301T090000000Z-barn", "barn", 58.0)
    analysed(analyses, "20260302T090000000Z-barn", "barn", None)
    assert pulsation_document(analyses, "barn").rate_per_min == 58.0


def test_so_is_another_device_and_a_record_that_cannot_be_read(analyses: AnalysisStore) -> None:
    analysed(analyses, "20260301T090000000Z-barn", "barn", 58.0)
    analysed(analyses, "20260302T090000000Z-left", "left", 62.0)
    analysed(analyses, "20260303T090000000Z-barn", "barn", 60.0)
    (analyses.directory / "20260303T090000000Z-barn" / "1" / RECORD).write_text("{")
    assert pulsation_document(analyses, "barn").rate_per_min == 58.0
