"""The report of a guided test: one page that says what failed, in words."""

import copy

import pytest

from grabberd.errors import InputError
from grabberd_liner.guided_tests.documents import LinerTestDocument
from grabberd_liner.guided_tests.report import liner_test_html
from reports.hostile import EVIL, hostile
from reports.pages import Page

AXES = {"x_title": "pressure difference", "x_unit": "kPa", "y_title": "distance", "y_unit": "mm"}
DOCUMENT = LinerTestDocument.model_validate(
    {
        "schema": "grabberd/liner-test/1",
        "kind": "ramp",
        "liner": "A",
        "captures": [
            {
                "id": "20260301T093000Z-barn",
                "captured_utc": "2026-03-01T09:30:00.000Z",
                "device": "barn",
                "run": 2,
                "bits": 8,
                "calibration": "rig-7",
                "object_model": "liner",
                "labels": {"liner": "A"},
                "profiles": [{"kind": "liner", "name": "A", "version": 3, "sha256": "0" * 64}],
            }
        ],
        "created_utc": "2026-03-01T10:00:00.000Z",
        "version": "1.0",
        "verdict": "failed",
        "checks": [
            {"name": "a", "title": "liner buckles", "verdict": "passed"},
            {
                "name": "b",
                "title": "opposite walls touch",
                "verdict": "failed",
                "value": 3.14159,
                "sigma": 0.12,
                "unit": "mm",
                "limit": "at most 1 mm",
                "reason": "still 3.1 mm apart",
                "remedy": "go on until they touch",
            },
        ],
        "quantities": [
            {
                "name": "touch_kpa",
                "title": "touch point",
                "definition": "where they touch",
                "unit": "kPa",
                "value": 14.66,
                "sigma": 0.21,
            },
            {
                "name": "E_mpa",
                "title": "modulus",
                "definition": "Young's",
                "unit": "MPa",
                "value": None,
                "sigma": None,
                "reason": "the ramp does not reach touch",
            },
        ],
        "curves": [
            {
                "name": "distance",
                "title": "wall",
                **AXES,
                "style": "line",
                "x": [0, 5, 9],
                "y": [20, 18, None],
                "sigma": [0.1, 0.1, None],
            },
            {
                "name": "touch",
                "title": "TPPD",
                **AXES,
                "style": "mark",
                "x": [14.7],
                "y": [None],
                "sigma": [0.2],
            },
            {
                "name": "steps",
                "title": "steps",
                **AXES,
                "y_title": "found",
                "style": "points",
                "x": [1.0],
                "y": [2.0],
                "sigma": [0.3],
            },
        ],
        "offer": {"profile": {}, "after": 3, "changes": ["material.E_mpa: 3 → 3.3"]},
    }
).model_dump(by_alias=True)


@pytest.fixture(scope="module")
def page():
    return Page(liner_test_html(DOCUMENT))


def test_the_verdict_names_what_failed(page):
    assert "The test has failed. Opposite walls touch." in page.text


def test_every_check_has_its_verdict_as_a_word_and_what_to_do(page):
    rows = page.tables["Checks"]
    assert ["opposite walls touch", "failed", "3.14 ± 0.12 mm", "at most 1 mm"] in rows
    assert ["Still 3.1 mm apart. Go on until they touch."] in rows
    assert ["liner buckles", "passed", "", ""] in rows


def test_quantities_that_were_found_have_their_sigma(page):
    _, *rows = page.tables["Quantities"]
    assert rows == [["touch point", "14.66 ± 0.21 kPa", ""]]


def test_what_several_checks_have_in_common_is_said_once():
    again = {**DOCUMENT["checks"][1], "title": "levels between"}
    page = liner_test_html({**DOCUMENT, "checks": [*DOCUMENT["checks"], again]})
    assert page.count("Still 3.1 mm apart") == 1


def test_it_says_what_was_captured_with_what_and_what_is_offered(page):
    for said in ("20260301T093000Z-barn", "rig-7", "liner A, version 3", "E_mpa: 3 → 3.3", "version after 3"):
        assert said in page.text


def test_the_same_document_makes_the_same_page():
    assert liner_test_html(DOCUMENT) == liner_test_html(copy.deepcopy(DOCUMENT))


def test_another_schema_is_refused():
    with pytest.raises(InputError, match="schema must be"):
        liner_test_html({**DOCUMENT, "schema": "grabberd/liner-test/9"})


def test_no_text_of_the_document_becomes_markup():
    assert EVIL not in liner_test_html(
        {**DOCUMENT, "liner": EVIL, "checks": hostile(DOCUMENT["checks"], {"verdict"})}
    )
