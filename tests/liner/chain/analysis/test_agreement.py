"""Another method beside the map of an analysis: what the inputs say, what comes of it, and why not."""

from functools import cache

import numpy as np
import pytest

from core.chain.solved_milking import DIFFERENCES_KPA, LINER, LINER_KPA, analysed
from grabberd.errors import InputError
from grabberd_fake.liner_options import LinerOptions
from grabberd_fake.teat_mat import Mat, mat_lines
from grabberd_liner.analysis.other_method import read_record
from grabberd_liner.chain.analysis.agreement import agreement_values, place_values
from grabberd_liner.chain.analysis.inputs import input_problems, read_inputs
from grabberd_liner.chain.analysis.tables import tables
from liner.analysis.walls import solved

CLOSED = (0.0, 34.0)


@cache
def mat() -> str:
    return "\n".join(mat_lines(LinerOptions(wall=LINER), CLOSED[1], Mat(5.0, 1.0), 3))


def above_atmosphere() -> str:
    """The same readings, relative to the atmosphere."""
    head, *rows = mat().splitlines()
    cells = [row.split(",") for row in rows]
    return "\n".join(
        [
            head,
            *(",".join([*one[:2], str(float(one[2]) - LINER_KPA), *one[3:5], "atmosphere"]) for one in cells),
        ]
    )


@cache
def compared(text: str, state: str = "greatest"):
    return analysed(CLOSED, agreement={"table": text, "state": {"field": 1} if state == "field" else state})


def row(found, name):
    return tables(found)["agreement"].column(name).tolist()[0]


def test_the_state_that_is_pressed_most_agrees_with_the_mat_within_sigma() -> None:
    found = compared(mat())
    assert row(found, "state") == "field 1"
    assert (row(found, "above"), row(found, "estimated"), row(found, "reason")) == (
        "liner",
        "along, round",
        "",
    )
    assert abs(row(found, "bias_kpa")) < 2 * row(found, "sigma_bias_kpa")
    assert abs(row(found, "origin_x_mm") - 15) < 2.5 * row(found, "sigma_origin_x_mm")
    assert row(found, "lower_kpa") < row(found, "bias_kpa") < row(found, "upper_kpa")
    assert row(found, "places") + row(found, "outside") == len(mat().splitlines()) - 1


def test_pressures_above_atmosphere_are_compared_with_the_map_above_atmosphere() -> None:
    found, same = compared(above_atmosphere(), "field"), compared(mat())
    assert row(found, "above") == "atmosphere"
    assert row(found, "bias_kpa") == pytest.approx(row(same, "bias_kpa"), abs=0.2)
    below = tables(found)["agreement_places"].column("map_kpa") - tables(same)["agreement_places"].column(
        "map_kpa"
    )
    assert np.allclose(below, -LINER_KPA, atol=0.5)


def test_the_places_have_both_pressures_and_their_difference_with_sigma() -> None:
    places = tables(compared(mat()))["agreement_places"]
    assert len(places) == row(compared(mat()), "places")
    apart = places.column("map_kpa") - places.column("other_kpa")
    assert np.allclose(places.column("difference_kpa"), apart)
    assert set(places.column("sigma_other_kpa")) == {1.0}


def test_an_open_liner_is_not_compared_and_the_reason_is_a_problem_too() -> None:
    found = analysed((0.0, 0.0), agreement={"table": mat(), "state": {"field": 1}})
    assert np.isnan(row(found, "bias_kpa"))
    assert len(tables(found)["agreement_places"]) == 0
    assert row(found, "reason")
    assert any(
        words == f"no agreement with the other method: {row(found, 'reason')}" for words in found.problems
    )


@pytest.mark.parametrize(
    ("inputs", "state", "why"),
    [
        ({}, {"field": 9}, "there is no field 9 with a pressure"),
        ({}, {"phase": 0.4}, "there is no phase 0.4 with a pressure"),
        ({"reference": None}, "greatest", "the analysis has no pressure"),
    ],
)
def test_a_state_without_a_pressure_is_not_compared(inputs, state, why) -> None:
    found = analysed(DIFFERENCES_KPA[:1] * 2, agreement={"table": mat(), "state": state}, **inputs)
    assert row(found, "reason").startswith(why)


def test_without_another_method_both_tables_are_empty() -> None:
    assert all(
        len(values) == 0 for values in agreement_values(None).values() if isinstance(values, np.ndarray)
    )
    assert all(len(values) == 0 for values in place_values(None).values() if isinstance(values, np.ndarray))


def problems(**changed):
    given = {"table": mat(), "state": "greatest"} | changed
    return input_problems({"agreement": {key: value for key, value in given.items() if value is not None}})


def test_what_the_pressures_are_above_is_said_by_the_table_or_the_input() -> None:
    silent = "\n".join(line.rpartition(",")[0] for line in mat().splitlines())
    (why,) = problems(table=silent)
    assert why.startswith("agreement.above: is None, expected liner or atmosphere")
    assert problems(table=silent, above="atmosphere") == []
    (why,) = problems(above="atmosphere")
    assert "the table says liner" in why


@pytest.mark.parametrize(
    ("changed", "why"),
    [
        ({"state": None}, "agreement.state: is None, expected greatest"),
        ({"state": {"second": 3}}, "agreement.state"),
        ({"table": None}, "agreement.table: is missing"),
        (
            {"table": "a,b\n1,2"},
            "agreement.table: the other method's table cannot be read: it has no column along_mm",
        ),
        ({"along": 12}, "agreement.along: is 12, expected estimated, or a mapping of x_mm and sigma_mm"),
        ({"along": {"x_mm": 12}}, "agreement.along.sigma_mm"),
        ({"round": {"deg": 3, "sigma_mm": 1}}, "agreement.round.sigma_mm: unknown key"),
        ({"frm": 1}, "agreement.frm: unknown key"),
    ],
)
def test_wrong_inputs_are_refused_one_by_one(changed, why) -> None:
    assert any(one.startswith(why) for one in problems(**changed)), problems(**changed)


def test_given_offsets_are_read_with_their_sigma() -> None:
    given = {
        "table": mat(),
        "state": {"phase": 0.7},
        "along": {"x_mm": 14, "sigma_mm": 0.5},
        "round": "estimated",
    }
    found = read_inputs({"agreement": given}, solved(LINER).grid).other_method
    assert found is not None
    assert (found.kind, found.value) == ("phase", 0.7)
    assert (found.offsets.x_mm, found.offsets.round_deg) == ((14, 0.5), None)
    assert np.array_equal(found.record.pressure_kpa, read_record(mat()).pressure_kpa)


def test_an_agreement_that_is_no_mapping_is_refused() -> None:
    with pytest.raises(InputError, match=r"agreement: is .film\.csv"):
        read_inputs({"agreement": "film.csv"}, solved(LINER).grid)
