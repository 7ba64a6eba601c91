"""The page of the analysis report on the agreement with another method, and the advice on targets."""

import pytest

from grabberd_liner.analyses.report import analysis_html, values
from grabberd_liner.glued_targets import glued_targets
from grabberd_liner.reports.environment import environment
from liner.reports.analysis_documents import full, table
from reports import pages
from reports.pages import Page

PLACES = 12


def agreeing(**changed):
    """A document with another method; `changed` are the only row's values by column."""
    document = full()
    row = {
        "state": ("", ["phase 0.8333"]),
        "above": ("", ["liner"]),
        "places": ("", [PLACES]),
        "outside": ("", [3]),
        "origin_x_mm": ("mm", [14.82], [0.58]),
        "origin_round_deg": ("°", [7.3], [0.77]),
        "estimated": ("", ["along"]),
        "bias_kpa": ("kPa", [-1.62], [0.41]),
        **{f"{name}_kpa": ("kPa", [at]) for name, at in (("bias_low", -2.5), ("bias_high", -0.7))},
        **{
            f"{name}_kpa": ("kPa", [at])
            for name, at in (("lower", -9.1), ("lower_low", -11.6), ("lower_high", -6.6))
        },
        **{
            f"{name}_kpa": ("kPa", [at])
            for name, at in (("upper", 5.9), ("upper_low", 3.4), ("upper_high", 8.4))
        },
        "sd_kpa": ("kPa", [3.83]),
        "expected_sd_kpa": ("kPa", [4.05]),
        "independent": ("1", [7.6]),
        "slope": ("1", [-0.11], [0.07]),
        "chi2": ("1", [9.3]),
        "dof": ("", [10]),
        "p": ("1", [0.5]),
        "reason": ("", [""]),
    }
    document["tables"]["agreement"] = table("agreement", **row | changed)
    document["tables"]["agreement_places"] = table(
        "places",
        x_mm=("mm", [-5.0 * (k // 3) for k in range(PLACES)]),
        round_deg=("°", [30.0 * (k % 3) - 30 for k in range(PLACES)]),
        map_kpa=("kPa", [10.0 + 3 * k for k in range(PLACES)], [3.0] * PLACES),
        other_kpa=("kPa", [11.0 + 3.2 * k for k in range(PLACES)], [1.0] * PLACES),
        difference_kpa=("kPa", [-1.0 - 0.2 * k for k in range(PLACES)], [3.2] * PLACES),
    )
    return document


def chapter(document, name="agreement"):
    return pages.chapter(environment(), "analysis", name, {"document": document, **values(document)})


@pytest.fixture(scope="module")
def page() -> Page:
    return chapter(agreeing())


def test_there_is_such_a_chapter_only_with_another_method() -> None:
    assert "8 Agreement with another method" in Page(analysis_html(agreeing())).headings
    assert not any("Agreement" in heading for heading in Page(analysis_html(full())).headings)


def test_the_bias_stands_with_its_sigma_and_whether_both_sigma_explain_the_scatter(page) -> None:
    assert "map less the other method is −1.62 ± 0.41 kPa in the mean over 12 places" in page.text
    assert "scatter as the σ of both let expect (χ² 9.30 for 10 degrees of freedom, p = 0.50)" in page.text
    too_much = chapter(agreeing(p=("1", [0.0004])))
    assert "scatter more than the σ of both let expect" in too_much.text


def test_bias_and_limits_stand_with_their_confidence(page) -> None:
    rows = page.table("Bias and 95 % limits")
    assert rows[0] == ["bias", "−1.6", "−2.5 … −0.7"]
    assert rows[2] == ["upper limit", "5.9", "3.4 … 8.4"]


def test_how_the_methods_were_compared_is_told(page) -> None:
    found = dict(page.tables["How the methods were compared (± is one σ)"])
    assert found["Pressures are above"] == "the gas in the liner"
    assert found["Origin of the other method's places"] == "14.82 ± 0.58 mm, 7.30 ± 0.77 °"
    assert found["Proportional bias, difference per mean"] == "−0.110 ± 0.070"
    assert found["Of these estimated from the pressures"] == "along"


def test_differences_are_drawn_over_means_and_both_methods_along_the_teat(page) -> None:
    (drawing,) = page.all("svg")
    assert drawing["aria-label"].startswith("Differences of both methods over their mean")
    for words in (
        "mean of both methods",
        "map less other method",
        "upper limit",
        "along the teat, x",
        "other method",
    ):
        assert words in page.text


def test_methods_that_could_not_be_compared_have_the_reason_alone() -> None:
    page = chapter(agreeing(reason=("", ["4 of 60 places lie in the supported part of the map"])))
    assert "could not be compared: 4 of 60 places" in page.text
    assert not page.all("svg")


def test_a_table_among_the_inputs_is_listed_by_its_first_line() -> None:
    document = full()
    document["inputs"]["given"] |= {"agreement": {"table": "along_mm,round_deg\n1,2\n3,4\n"}}
    given = dict(chapter(document, "inputs").tables["Inputs as given"])
    assert given["agreement.table"] == "3 lines, the first of them: along_mm,round_deg"


def test_what_other_grids_of_targets_would_give_stands_with_the_reliability() -> None:
    document = full()
    rows = chapter(document, "reliability").table("What more columns")
    assert [row[:2] for row in rows] == [
        [str(one.columns), f"{one.row_pitch_mm:g}"] for one in glued_targets()
    ]
    assert not any(row[-1] for row in rows)
    grid = {"u_mm": [6.5 * row for row in range(18) for _ in range(4)], "column": [*range(4)] * 18}
    marked = chapter({**document, "grid": document["grid"] | grid}, "reliability").table("What more columns")
    assert [row[:2] for row in marked if row[-1] == "as it is"] == [["4", "6.5"]]
