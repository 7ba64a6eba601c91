"""The report of a study as a page."""

import re
from typing import Any

import pytest

from grabberd.errors import ExtraMissing, InputError
from grabberd_liner.chain.study.study import Found, LeftOut, Studied, StudyQuestion, make_study
from grabberd_liner.chain.study.study_document import study_document, tables
from grabberd_liner.studies.report import study_html
from liner.chain.study.captured import capture, herd
from reports.hostile import EVIL
from reports.pages import Page

QUESTION = StudyQuestion(by="liner", within="cow", over="milkings")
ABOUT = {"created_utc": "2026-11-02T00:00:00Z", "version": "0.1.0", "select": ["results", "liner=A,B,C"]}


def document(
    captures: list[Studied], question: StudyQuestion = QUESTION, left_out: tuple[LeftOut, ...] = ()
) -> Any:
    study = make_study(question, captures, left_out)
    return study_document(study, tables(study), ABOUT)


@pytest.fixture(scope="module")
def text() -> str:
    return study_html(document(herd(), left_out=(LeftOut("c099", "", "it has not been analysed"),)))


@pytest.fixture(scope="module")
def page(text: str) -> Page:
    return Page(text)


def test_the_page_stands_alone_and_is_the_same_every_time(text: str, page: Page) -> None:
    named = set(re.findall(r"https?://[^\s\"'<>]+", text))
    assert named <= {"http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"}
    assert not {"script", "link", "iframe", "img"} & {tag for tag, _ in page.elements}
    left_out = (LeftOut("c099", "", "it has not been analysed"),)
    assert study_html(document(herd(), left_out=left_out)) == text


def test_every_reference_inside_the_page_leads_somewhere(text: str, page: Page) -> None:
    ids = [attributes["id"] for _, attributes in page.elements if "id" in attributes]
    assert len(ids) == len(set(ids))
    assert set(re.findall(r"url\(#([^)]+)\)", text)) <= set(ids)


def test_it_opens_with_question_answers_and_verdicts(page: Page) -> None:
    assert page.headings[0] == "Study of 12 captures"
    assert "Does it matter which liner" in page.text
    answers = page.tables["Answers (± is one σ; p is adjusted for all pairs of a quantity)"]
    assert answers[1][:2] == ["liner compression, mean", "differ"]
    assert answers[1][2].startswith("B is ")


def test_differences_have_sigma_its_common_part_interval_and_p(page: Page) -> None:
    rows = page.tables["Differences of every two groups"]
    assert rows[0] == [
        *("Quantity", "Difference", "Value (σ)", "of σ, common", "95 %", "Freedom", "p, adjusted", "σ by"),
        "Verdict",
    ]
    assert rows[1][:2] == ["liner compression, mean [kPa]", "B − A"]
    assert re.fullmatch(r"\d\.\d+ \(0\.\d+\)", rows[1][2])
    assert len(rows) == 1 + 6


def test_a_remark_on_several_quantities_is_made_once() -> None:
    untold = {
        name: Found(unit, value, 0.5, None, "")
        for name, unit, value in (("a", "kPa", 1.0), ("b", "s", 2.0), ("c", "N", 3.0), ("d", "mm", 4.0))
    }
    page = Page(study_html(document([capture(n, found=untold) for n in range(3)], StudyQuestion())))
    assert page.text.count("3 of 3 analyses do not tell") == 1
    assert "4 quantities: 3 of 3" in page.text


def test_every_capture_and_what_was_left_out_are_listed(page: Page) -> None:
    assert len(page.tables["Captures, part 1 (σ in brackets)"]) == 1 + 12
    left_out = page.tables["Captures without an analysis that can be studied"]
    assert left_out[1] == ["c099", "it has not been analysed"]


def test_every_group_has_its_slope(page: Page) -> None:
    slopes = page.tables["Slopes per milking"]
    assert [row[1] for row in slopes[1:5]] == ["A", "B", "C", "all, in common"]


@pytest.mark.parametrize(
    "question", [StudyQuestion(), StudyQuestion(by="liner"), StudyQuestion(over="date"), QUESTION]
)
@pytest.mark.parametrize("count", [0, 1, 2, 13])
def test_any_number_of_captures_makes_a_page(question: StudyQuestion, count: int) -> None:
    captures = [capture(n, "ABCDEFGHIJKLM"[n], str(n)) for n in range(count)]
    assert Page(study_html(document(captures, question))).headings[0].startswith(f"Study of {count} capture")


def test_words_of_labels_are_never_markup() -> None:
    captures = [
        one._replace(id=one.id + EVIL, labels={**one.labels, "liner": one.labels["liner"] + EVIL})
        for one in herd()
    ]
    evil = study_html(document(captures, left_out=(LeftOut(EVIL, "", EVIL),)))
    assert "<script" not in evil.lower()
    assert "script" not in {tag for tag, _ in Page(evil).elements}


def test_another_document_is_refused() -> None:
    with pytest.raises(InputError, match="schema must be 'grabberd/study/1'"):
        study_html({"schema": "grabberd/analysis-report/1"})


def test_without_matplotlib_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("grabberd.reports.figures.drawing.find_spec", lambda _: None)
    with pytest.raises(ExtraMissing, match="a report with figures"):
        study_html(document(herd()))
