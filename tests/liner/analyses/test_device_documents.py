"""Documents of analyses: how they are listed and marked; the pulsation rate, device by device."""

import json
from pathlib import Path

import pytest

from grabberd_liner.analyses.documents import PulsationDocument
from grabberd_liner.analyses.store import (
    PAGE,
    RECORD,
    AnalysisStore,
    pulsation_document,
    report_page,
)

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


TOLD = {"reference": "nominal", "material": {}, "vacuum": {}, "sought_kpa": 1.0}
PAGE_TEXT = "<html><body><main><h1>Analysis report</h1></main></body></html>"


def stored(analyses: AnalysisStore, **record: object) -> None:
    """An analysis of the capture "one", with a page."""
    with analyses.scratch() as folder:
        (folder / RECORD).write_text(json.dumps(record))
        (folder / PAGE).write_text(PAGE_TEXT)
        analyses.publish("one", folder)


def outdated(analyses: AnalysisStore) -> list[bool]:
    numbers = reversed(analyses.numbers("one"))
    return [analyses.row("one", number).outdated_pressure for number in numbers]


def test_pressures_of_an_analysis_that_names_no_method_are_outdated(analyses: AnalysisStore) -> None:
    stored(analyses, inputs=TOLD)
    stored(analyses, inputs=TOLD, pressure_method="equilibrium")
    assert outdated(analyses) == [False, True]


def test_an_analysis_that_found_no_pressures_has_no_outdated_ones(analyses: AnalysisStore) -> None:
    stored(analyses, inputs={"plane": "symmetry"}, lacks=["material: without it no tension and pressure"])
    stored(analyses, inputs=TOLD, lacks=["homologous: so there are no strain, tension, pressure"])
    stored(analyses, inputs=TOLD)
    (analyses.directory / "one" / "3" / RECORD).write_text("{")
    assert outdated(analyses) == [False, False, False]


OLD_QUANTITY = {"name": "overpressure_kpa", "unit": "kPa", "value": 48.4, "sigma": 5.2, "sigma_common": 5.1}


def test_an_analysis_that_calls_a_contact_pressure_overpressure_says_so_and_has_it_by_its_name_now(
    analyses: AnalysisStore,
) -> None:
    stored(analyses, inputs=TOLD, pressure_method="equilibrium", quantities=[OLD_QUANTITY])
    row = analyses.row("one", 1)
    assert (row.outdated_overpressure, row.outdated_pressure, row.outdated) == (True, False, "overpressure")
    assert [(one.name, one.value) for one in row.quantities] == [("teat_end_beyond_flow_stop_kpa", 48.4)]
    marked = report_page(analyses, "one", 1).decode()
    assert marked.index("Overpressure in milking research") < marked.index("Analysis report")
    kept = json.loads((analyses.directory / "one" / "1" / RECORD).read_text())
    assert kept["quantities"] == [OLD_QUANTITY]


def test_an_analysis_with_today_s_names_has_nothing_wrong(analyses: AnalysisStore) -> None:
    today = {**OLD_QUANTITY, "name": "overpressure_derived_kpa"}
    stored(analyses, inputs=TOLD, pressure_method="equilibrium", quantities=[today])
    assert analyses.row("one", 1).outdated == ""


def test_its_report_says_so_at_the_top(analyses: AnalysisStore) -> None:
    stored(analyses, inputs=TOLD)
    stored(analyses, inputs=TOLD, pressure_method="equilibrium")
    marked = report_page(analyses, "one", 1).decode()
    assert marked.index("The pressures of this analysis are wrong") < marked.index("Analysis report")
    assert report_page(analyses, "one", 2).decode() == PAGE_TEXT
