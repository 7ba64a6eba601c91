import copy
import re
import subprocess
import sys

import pytest

from grabberd.errors import ExtraMissing, InputError
from grabberd_liner.analyses.report import analysis_html, marked_outdated, values
from grabberd_liner.reports.environment import environment
from grabberd_liner.reports.figures import model_svg, states_of
from liner.reports.analysis_documents import earlier, full, least
from reports import pages
from reports.hostile import EVIL, hostile
from reports.pages import Page


def chapter(name, document):
    """One chapter alone."""
    return pages.chapter(environment(), "analysis", name, {"document": document, **values(document)})


@pytest.fixture(scope="module")
def text():
    return analysis_html(full())


@pytest.fixture(scope="module")
def page(text):
    return Page(text)


@pytest.fixture(scope="module")
def of_before():
    """Of an analysis with the earlier pressures."""
    return Page(analysis_html(earlier()))


@pytest.fixture(scope="module")
def bare():
    return Page(analysis_html(least()))


def test_the_page_stands_alone(text, page):
    assert text.startswith('<!DOCTYPE html>\n<html lang="en">')
    assert text.endswith("</html>\n")
    named = set(re.findall(r"https?://[^\s\"'<>]+", text))
    assert named <= {"http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"}
    assert not {"script", "link", "iframe", "img", "object"} & {tag for tag, _ in page.elements}


def test_every_reference_inside_the_page_leads_somewhere(text, page):
    ids = [attributes["id"] for _, attributes in page.elements if "id" in attributes]
    assert len(ids) == len(set(ids))
    assert set(re.findall(r"url\(#([^)]+)\)", text)) <= set(ids)


def test_chapters_are_numbered(page):
    assert page.headings[:5] == [
        "Analysis report",
        "Missing inputs",
        "Quantities that are left out",
        "Problems",
        "1 The wall and its pressure",
    ]
    assert [heading.split()[0] for heading in page.headings[4:]] == [*"123456789"]


def test_the_top_says_what_was_found_with_its_sigma(page):
    assert "3 of 4 fields were analysed." in page.text
    assert "one cycle takes 1.00120 ± 0.00030 s" in page.text
    assert "greatest at phase 0.50: 9.0 (2.0) kPa" in page.text


def test_the_first_page_has_the_quantities_that_were_found_with_sigma_and_verdict(page):
    found = dict(page.tables["Quantities of the milking (± is one σ)"])
    assert found == {"Teat load": "38.7 ± 1.5 N", "Phase b of the cycle": "0.4512 ± 0.0020, ISO 5707: met"}


def test_every_quantity_is_defined_and_one_that_lacks_says_why(page):
    rows = {row[0]: row[1:] for row in page.table("Quantities and their definitions")}
    assert rows["Teat load"] == ["38.7 ± 1.5 N", "", "Force of one side.", "the wall"]
    assert rows["Beyond flow stop"][0] == "flow_stop was not given"


def test_the_load_over_height_is_drawn_in_every_wall_phase():
    drawn = chapter("load", full())
    assert "not a teat" in drawn.text
    assert len(drawn.all("svg")) == 1
    assert drawn.captions[0].startswith("Force per height on the side that faces the cameras")


def test_a_document_of_an_earlier_version_has_a_report_without_quantities():
    document = full()
    del document["tables"]["quantities"], document["tables"]["phase_profile"]
    assert "had no such quantities" in Page(analysis_html(document)).text


def test_what_lacks_and_what_went_wrong_stands_at_the_top(page):
    before = page.text.partition("1 The wall")[0]
    assert "plane: without it no widths" in before
    assert "left out: targets 63" in before


def test_a_value_without_sigma_or_unit_has_none(page):
    glance = dict(page.tables["Result at a glance (± is one σ)"])
    assert glance["Cycles"] == "2.5"
    assert glance["Cycle"].endswith(" s")


def test_targets_without_a_pressure_are_counted_by_reason(page):
    rows = page.table("Targets with a determined")
    assert rows[0] == ["opening (a)", "12", "0", "all are determined"]
    assert rows[1] == ["closed (d)", "9", "3", "no targets near enough: 2; σ exceeds it: 1"]


def test_a_state_without_a_map_has_no_target_determined():
    document = full()
    for column in document["states"][0]["targets"]["columns"]:
        if column["name"] in ("contact_kpa", "sigma_contact_kpa"):
            column["values"] = [None] * 12
    (row, _) = chapter("wall_pressure", document).table("Targets with a determined")
    assert row == ["opening (a)", "0", "12", "this state has no map: see the problems above"]


def test_every_figure_is_heard_and_has_a_caption(page):
    figures = page.all("svg")
    assert len(figures) == len(page.captions) == 8
    assert len({attributes["aria-label"] for attributes in figures}) == 8


def test_how_well_a_wall_in_equilibrium_explains_the_points_is_told(page):
    assert "misses the points, and what was known of the load before, by 0.62 times" in page.text


def test_pressures_of_the_earlier_way_are_called_wrong_at_the_top(of_before):
    top = of_before.text.partition("1 The wall")[0]
    assert of_before.headings[:2] == ["Analysis report", "Wrong pressures"]
    assert "The pressures of this analysis are wrong" in top
    assert "Analyse the capture again" in top
    assert "grabberd analyse" in top
    assert "mean pressure is greatest" not in top


def test_a_report_with_the_earlier_columns_opens_without_a_map_of_what_it_does_not_have(of_before):
    assert "Map of the pressure above atmosphere" not in {one["aria-label"] for one in of_before.all("svg")}


def test_pressures_of_a_wall_in_equilibrium_are_not_called_wrong(page):
    assert "Wrong pressures" not in page.headings


def test_an_earlier_analysis_without_pressures_has_nothing_wrong():
    document = least()
    del document["pressure_method"]
    assert "Wrong pressures" not in Page(analysis_html(document)).headings


def test_a_report_that_was_drawn_earlier_gets_the_same_notice_at_its_top(text):
    marked = Page(marked_outdated(text, "pressure"))
    assert marked.headings[:2] == ["Wrong pressures", "Analysis report"]
    assert "Analyse the capture again" in marked.text
    assert marked.text.count("Its pressures are wrong.") == 0


def test_a_contact_pressure_that_was_called_overpressure_is_explained_at_the_top():
    document = full()
    names = next(one for one in document["tables"]["quantities"]["columns"] if one["name"] == "name")
    names["values"][names["values"].index("teat_end_beyond_flow_stop_kpa")] = "overpressure_kpa"
    page = Page(analysis_html(document))
    assert page.headings[:2] == ["Analysis report", "No overpressure"]
    assert "is now called teat_end_beyond_flow_stop_kpa" in page.text
    assert "Its pressures are wrong" not in page.text


def test_inputs_are_listed_with_their_sources(page):
    assert dict(page.tables["Inputs as given"])["material.E_mpa"] == "3"
    assert dict(page.tables["Sources of the inputs"]) == {"material": "liner.yaml"}


def test_missing_fields_are_listed(page):
    assert page.table("Fields without points") == [["1", "7", "5"]]


def test_nothing_from_outside_becomes_markup():
    document = hostile(full(), keep={"schema", "name", "phase"})
    document["states"][0]["name"] = document["tables"]["fields"]["columns"][0]["name"] = EVIL
    written = analysis_html(document)
    page = Page(written)
    assert "<script" not in written
    assert not page.all("script")
    assert page.text.count(EVIL) > 40


def test_a_dollar_sign_in_a_name_is_no_formula():
    document = full()
    document["states"][0]["name"] = r"$\frac{"
    assert r"$\frac{" in chapter("wall_pressure", document).text


def test_of_the_shape_alone_there_is_a_page_that_says_what_there_is_not(bare):
    assert "No pulsation was found." in bare.text
    assert "There is no mean cycle" in bare.text
    assert "The pressure was not determined in any field" in bare.text
    assert "larger principal strain is not known" in bare.text
    assert len(bare.all("svg")) == 3


def changed(table, name, values):
    """The full document's text with other values in one column."""
    document = full()
    column = next(one for one in document["tables"][table]["columns"] if one["name"] == name)
    column["values"] = values
    return document


def test_a_pressure_that_is_there_from_the_first_field_on_is_not_said_to_begin(page):
    assert "Pressure starts in field 7" in page.text
    document = changed("summary", "touch_n", [0])
    glance = dict(chapter("head", document).tables["Result at a glance (± is one σ)"])
    assert glance["Pressure is already present in"] == "field 0, target 5"
    assert "so its start was not seen" in chapter("reliability", document).text


def test_points_that_are_worse_than_their_sigma_are_told_with_what_it_means():
    assert "too small" not in chapter("reliability", full()).text
    told = chapter("reliability", changed("fields", "misfit", [2.0] * 3)).text
    assert "too small by a factor of about 1.4" in told


def test_lines_are_drawn_to_a_hundredth_of_a_point(text):
    assert re.findall(r' d="[^"]*\.\d\d[^"]*"', text)
    assert not re.findall(r' d="[^"]*\.\d{3}[^"]*"', text)


def test_a_wall_of_many_columns_keeps_its_numbers_apart():
    document = full()
    for state in document["states"]:
        for column in state["targets"]["columns"]:
            if column["name"] == "column":
                column["values"] = [10 * value for value in column["values"]]
    numbers = Page(model_svg(states_of(document), "contact_kpa", "pressure", "map")).text.split()
    assert numbers.count("18") == numbers.count("9") == 2
    assert not {"19", "20"} & set(numbers)


@pytest.mark.slow
def test_the_same_document_gives_the_same_page(text):
    assert analysis_html(copy.deepcopy(full())) == text


@pytest.mark.parametrize("key", ["id", "inputs", "tables", "states"])
def test_a_document_without_its_parts_is_refused(key):
    with pytest.raises(InputError, match=f"has no {key}"):
        analysis_html(full() | {key: None})


def test_a_document_of_another_schema_or_with_a_number_that_is_none_is_refused():
    with pytest.raises(InputError, match="schema"):
        analysis_html(full() | {"schema": "grabberd/calibration-report/1"})
    with pytest.raises(InputError, match=r"about\.run"):
        analysis_html(full() | {"about": {"run": float("nan")}})


def test_without_matplotlib_the_extra_is_named(monkeypatch):
    monkeypatch.setattr("grabberd.reports.figures.drawing.find_spec", lambda name: None)
    with pytest.raises(ExtraMissing, match="report"):
        analysis_html(full())


def test_reports_are_imported_without_matplotlib():
    code = "import sys, grabberd_liner.analyses.report; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
