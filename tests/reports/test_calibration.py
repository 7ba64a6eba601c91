import copy
import re
import subprocess
import sys

import pytest

from grabberd.errors import ExtraMissing, InputError
from grabberd.reports import calibration_html
from grabberd.reports.notation import fixed, measured, probability, significant
from reports.documents import BLUNDER, DROPPED, full, least
from reports.hostile import EVIL, hostile
from reports.pages import Page


@pytest.fixture(scope="module")
def document():
    return full()


@pytest.fixture(scope="module")
def text(document):
    return calibration_html(document)


@pytest.fixture(scope="module")
def page(text):
    return Page(text)


def number(cell):
    return float(cell.replace("−", "-"))


def test_the_page_stands_alone(text, page):
    assert text.startswith('<!DOCTYPE html>\n<html lang="en">')
    assert text.endswith("</html>\n")
    named = set(re.findall(r"https?://[^\s\"'<>]+", text))
    assert named <= {"http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"}
    assert not {"script", "link", "iframe", "img", "object"} & {tag for tag, _ in page.elements}
    assert "url(" not in text.partition("</style>")[0]
    references = [a.get("href") or a.get("xlink:href") for _, a in page.elements if "href" in str(a)]
    assert all(reference.startswith("#") for reference in references)


def test_every_reference_inside_the_page_leads_somewhere(text, page):
    ids = [attributes["id"] for _, attributes in page.elements if "id" in attributes]
    assert len(ids) == len(set(ids))
    assert set(re.findall(r"url\(#([^)]+)\)", text)) <= set(ids)


@pytest.mark.slow
def test_the_same_document_gives_the_same_page(document, text):
    assert calibration_html(copy.deepcopy(document)) == text


def test_chapters_are_numbered(page):
    assert page.headings[:3] == ["Calibration report", "1 Acceptance", "Reasons of the verdict"]
    chapters = [heading for heading in page.headings[1:] if heading != "Reasons of the verdict"]
    assert [int(heading.split()[0]) for heading in chapters] == [*range(1, 17)]


def test_figures_can_be_heard_and_tables_have_captions_and_heads(page):
    pictures = page.all("svg")
    assert len(pictures) == len(page.captions) == 10
    assert all(picture["role"] == "img" and picture["aria-label"] for picture in pictures)
    assert len({picture["aria-label"] for picture in pictures}) == 10
    assert all(page.captions)
    assert len(page.tables) == len(page.all("table"))
    assert all(head.get("scope") in {"row", "col"} for head in page.all("th"))


def test_the_head_says_what_came_out(document, page):
    result = document["result"]
    for said in (document["id"], document["version"], significant(result["sigma0"]), str(result["freedom"])):
        assert said in page.text
    assert f"{significant(result['sigma0_px'])} px" in page.text


def test_the_verdict_stands_first_with_its_reasons_what_to_do_and_the_rig(document, page):
    assert "Failed: this calibration must not be used" in page.text
    for reason in document["acceptance"]["reasons"]:
        assert reason["message"] in page.text
        assert reason["hint"] in page.text
    assert "certified 119.397 mm, measured 121.763 mm" in page.text
    assert page.table("The rig: nominal, previous and found")[0][0] == "base"


def test_parameters_are_given_with_their_sigma_at_the_same_place(document, page):
    rows = page.table("Parameters of the views")
    assert len(rows) == 18
    for index, view in enumerate(document["views"]):
        for row, given in zip(rows, view["parameters"], strict=True):
            value, sigma, state = row[2 + 3 * index : 5 + 3 * index]
            power = re.match(r"10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)", row[1])
            exponent = int(power[1].translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789"))) if power else 0
            assert state == given["state"]
            assert (value, sigma) == measured(given["value"], given["sigma"], exponent)
            assert number(value) * 10.0**exponent == pytest.approx(
                given["value"], abs=given["sigma"] or 1e-12
            )


def test_the_comparison_has_every_parameter_with_its_verdict(document, page):
    rows = page.table("Left and right compared")
    assert len(rows) == len(document["comparison"])
    for row, given in zip(rows, document["comparison"], strict=True):
        assert row[6:8] == [significant(given["statistic"]), probability(given["p"])]
        assert row[8] == ("differ" if given["p"] < 0.05 else "alike")


def test_the_protocol_has_every_test_and_names_what_was_dropped(document, page):
    rows = page.table("Protocol of the F tests")
    assert len(rows) == len(document["tests"])
    for row, given in zip(rows, document["tests"], strict=True):
        assert row[0:2] == [str(given["round"]), given["kind"]]
        assert row[3:8] == [significant(given["statistic"]), str(given["q"]), str(given["freedom"]),
                            probability(given["p"]), significant(given["effect_px"], 2)]  # fmt: skip
        assert row[8] == ("dropped" if given["dropped"] else "kept")
    assert len(DROPPED) == 2
    assert "Dropped from the model: left b₅, right b₅." in page.text


def test_strong_correlations_are_listed_strongest_first(document, page):
    matrix = document["unknowns"]["correlation"]
    strong = sorted(
        (abs(r) for i, line in enumerate(matrix) for r in line[:i] if abs(r) > 0.95), reverse=True
    )
    assert [abs(number(row[2])) for row in page.table("Unknowns correlated")] == pytest.approx(
        strong, abs=5e-4
    )


def test_every_image_point_is_listed_with_its_residual(document, page):
    rows = page.table("Image points")
    assert len(rows) == len(document["residuals"]) == 216
    for row, given in zip(rows, document["residuals"], strict=True):
        assert row[:2] == [given["view"], str(given["target"])]
        assert row[2:6] == [
            fixed(given["x_px"], 3),
            fixed(given["y_px"], 3),
            fixed(given["dx_px"], 4),
            fixed(given["dy_px"], 4),
        ]
        assert row[10:] == [fixed(given["tau_x"], 2), fixed(given["tau_y"], 2), str(given["fields"])]


def test_a_blunder_stands_in_the_table_and_in_the_picture(page, text):
    ((view, target, axis, *_, state),) = page.table("Blunders")
    assert (view, int(target), axis) == (*BLUNDER, "x")
    assert state == "kept"
    picture = text.split("Residual vectors of the image points")[1].split("</svg>")[0]
    assert f">{BLUNDER[1]}</text>" in picture


def test_a_blunder_that_was_left_out_is_ringed_at_its_own_place(document):
    rows = [row for row in document["residuals"] if (row["view"], row["target"]) != BLUNDER]
    found = document["blunders"][0] | {"x_px": 500.0, "y_px": 230.0}
    changed = least() | {"image": document["image"], "residuals": rows, "blunders": [found]}
    text = calibration_html(changed)
    assert f">{BLUNDER[1]}</text>" in text
    assert Page(text).table("Blunders")[0][-1] == "left out"


def test_how_each_view_was_identified_is_told(document):
    told = {"left": "target 5 at (10, 20) px", "right": "target 6 at (500, 20) px"}
    identification = {**document["identification"], "by": None, "description": told}
    page = Page(calibration_html(least() | {"identification": identification}))
    assert "left: target 5 at (10, 20) px." in page.text
    assert page.table("Identification of 108 targets")[1] == [
        "right",
        "+1",
        "108",
        "2",
        "0.290",
        "5.20",
        "–",
        "–",
    ]


@pytest.mark.parametrize(
    ("accepted", "said"), [(True, "fit better with it"), (False, "is not part of the calibration")]
)
def test_whether_the_local_field_was_accepted_is_said_with_its_gain(document, accepted, said):
    field = document["local_field"] | {"accepted": accepted, "gain": 12.93}
    page = Page(calibration_html(least() | {"local_field": field}))
    assert said in page.text
    assert "change by −12.9 standard errors" in page.text
    assert page.table("Local residual field")[0] == ["left", "0.0610", "0.0640", "95.0", "0.0210"]


def test_held_out_targets_are_listed_and_summed_up(document, page):
    observed, predicted = page.table("Held-out targets [mm]")
    assert observed[1:] == [
        fixed(document["validation"]["rmse_mm"][axis], 4) for axis in ("x", "y", "z", "xyz")
    ]
    assert predicted[1:] == [
        fixed(document["validation"]["predicted_mm"][axis], 4) for axis in ("x", "y", "z", "xyz")
    ]
    assert len(page.table("Held-out targets: position")) == 108


def test_the_volume_is_summed_up_plane_by_plane(document, page):
    rows = page.table("σ in each plane")
    for row, plane in zip(rows, document["volume"]["planes"], strict=True):
        largest = max(value for line in plane["total"]["z"] for value in line if value is not None)
        assert row[0] == fixed(plane["z_mm"], 1)
        assert row[6].endswith(f"({fixed(largest, 4)})")


def test_what_a_views_movement_would_cost_stands_in_a_table(document, page):
    rows = page.table("Error of X / Y / Z")
    assert len(rows) == 10
    first = document["validity"]["movements"][0]
    assert rows[0][:2] == ["left", "picture shifted along x, 0.1 px"]
    assert rows[0][2].split(" / ") == [fixed(first["middle_mm"][axis], 4) for axis in "xyz"]


def test_project_data_are_given_with_units_and_unknown_keys_too(document):
    capture = {"started_utc": "2026-01-02T02:59:00+00:00", "shutter_ms": 1.5}
    frame = document["calibration_frame"] | {"temperature_C": None}
    page = Page(calibration_html(least() | {"capture": capture, "calibration_frame": frame}))
    assert dict(page.tables["Capture"]) == {"started [UTC]": "2026-01-02 02:59:00 UTC", "shutter [ms]": "1.5"}
    assert dict(page.tables["Calibration frame"])["temperature [°C]"] == "–"
    assert dict(page.tables["Certificate of the calibration frame"])["number"] == "K-108/7"


def test_a_report_without_any_optional_part_says_so_of_each():
    page = Page(calibration_html(least()))
    assert not page.all("svg")
    assert set(page.tables) == {"Result at a glance"}
    absent = [attributes for tag, attributes in page.elements if attributes.get("class") == "absent"]
    assert len(absent) == 20
    assert "blunders were not sought" in page.text


@pytest.mark.parametrize("part", sorted(set(least()) - {"schema", "id", "created_utc", "result", "views"}))
def test_a_part_that_is_null_is_the_same_as_one_that_is_missing(part):
    without = least()
    del without[part]
    assert calibration_html(without) == calibration_html(least() | {part: None})


def test_nothing_from_outside_becomes_markup(document):
    text = calibration_html(hostile(document, keep={"schema"}))
    page = Page(text)
    assert "<script" not in text
    assert not page.all("script")
    assert page.text.count(EVIL) > 400
    assert text.count("<svg") == 10


def test_a_view_by_another_name_and_a_shared_lens_are_drawn_as_well():
    shared = {"name": "f_mm", "unit": "mm", "value": 8.0, "sigma": 0.01, "state": "adjusted"}
    parameters = [
        {**shared, "unknown": "lens.f_mm"},
        {"name": "b8", "unit": "mm⁻²", "value": 0.0, "sigma": None, "state": "held", "unknown": None},
    ]
    document = least()
    for view, name in zip(document["views"], ("upper", "lower"), strict=True):
        view.update(name=name, parameters=parameters)
    rows = Page(calibration_html(document)).table("Parameters of the views")
    assert rows[0] == ["f", "mm", *("8.000", "0.010", "shared") * 2]
    assert rows[1] == ["b₈", "mm⁻²", *("0", "–", "held") * 2]


@pytest.mark.parametrize("key", ["id", "created_utc", "result", "views"])
def test_a_document_that_lacks_what_every_report_has_is_refused(key):
    with pytest.raises(InputError, match=f"has no {key}"):
        calibration_html(least() | {key: None})


def test_a_document_of_another_schema_is_refused():
    with pytest.raises(InputError, match="other/1"):
        calibration_html(least() | {"schema": "other/1"})


def test_without_matplotlib_it_says_how_to_install_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(ExtraMissing, match="report") as refused:
        calibration_html(least())
    assert refused.value.hint == "install it: pip install 'grabberd[report]'"


def test_importing_the_room_does_not_import_matplotlib():
    asked = "import sys, grabberd.reports; print([m for m in sys.modules if m.startswith('matplotlib')])"
    found = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"
