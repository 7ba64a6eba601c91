"""The tables of the pressure's accuracy, on a wall or two."""

import numpy as np
import pytest

from grabberd_liner.analysis.estimate import Estimate
from grabberd_liner.analysis.load.collapse import Collapse
from grabberd_liner.analysis.load.empty_ramp import LinerValues
from grabberd_liner.analysis.load.pressure import ChamberVacuum

from .middle_accuracy import case as middles
from .pressure_accuracy import CYCLE, FIELD, FOUR, PHASE, case
from .pressure_case import Figures, Given, Judged, refused_text
from .pressure_empty import table as empty_liners
from .pressure_ramp import Ramped, value_rows, worth_rows
from .pressure_robustness import JUDGED, REFERENCES, SEEN, Aside, SolvedLiner, asides, maps


@pytest.fixture(scope="module")
def found():
    return case("wide-round", FOUR, {"closing": (12.0,)})


def test_a_wall_is_judged_by_bits_and_by_the_fields_averaged(found):
    assert {(one.bits, one.averaged) for one in found} == {
        (b, a) for b in (8, 1) for a in (FIELD, PHASE, CYCLE)
    }
    assert {(one.design, one.teat, one.columns) for one in found} == {("wide", "round", FOUR)}
    assert Figures.of_places(one.judged for one in found).rms < 5.0


def test_half_of_four_columns_are_inner(found):
    assert all(one.inner.sum() == len(one.inner) / 2 for one in found)


def test_the_mean_of_one_state_s_cycle_is_that_state(found):
    mean, cycle = (
        [one.judged for one in found if (one.bits, one.averaged) == (8, way)] for way in (PHASE, CYCLE)
    )
    for one, other in zip(mean, cycle, strict=True):
        assert np.array_equal(one.error_kpa, other.error_kpa)


def test_refused_maps_are_counted_and_left_out():
    good = Judged(np.array([1.0, -1.0]), np.ones(2), 0.0, 0.7, False)
    bad = Judged(np.array([90.0, 90.0]), np.ones(2), 90.0, 0.7, True)
    assert Figures.of_places([good, bad, Judged.refusal(2)]) == Figures(0.0, 1.0, 1.0, 1.0)
    assert refused_text([good, bad, Judged.refusal(2), good]) == "50 %"
    assert Figures.of_places([bad]).text() == "none"


def test_the_estimator_is_told_values_that_err_with_their_sigma():
    given = Given(E=0.1, kpa=2.0, kpa_sigma=0.7)
    told = given.material(SolvedLiner("reference-round"))
    assert told["E_mpa"] == pytest.approx(3.3)
    assert told["E_sigma_mpa"] == pytest.approx(0.105)
    vacuum: ChamberVacuum = given.vacuum(15.0)
    assert vacuum.difference_kpa == pytest.approx(17.0)
    assert vacuum.difference_sigma_kpa == pytest.approx(0.7)


def test_every_row_names_points_that_can_be_made():
    liner = SolvedLiner("reference-round")
    for aside in asides():
        assert REFERENCES[aside.reference](liner) is None or aside.reference != "none"
        assert len(SEEN[aside.seen](liner, 16.0, np.random.default_rng(0)))
        assert JUDGED[aside.judged](liner).any()


def test_a_row_judges_its_places_in_every_state():
    found = maps(Aside("off", ("reference-round",), judged="glued"), Given(kpa=1.0), (12.0,))
    assert [len(one.error_kpa) for one in found] == [9, 9]


def test_equilibrium_and_smooth_surface_are_compared_in_the_same_states():
    found = middles("wide-round", {"closed": (30.0,)})
    assert [(one.method, one.bits, one.refused) for one in found] == [
        (method, bits, False) for bits in (8, 1) for method in ("equilibrium", "smooth")
    ]
    wall, smooth = (np.abs(one.error[~one.inner, 3]).mean() for one in found[:2])
    assert wall < 0.2 * smooth


def test_an_empty_liner_and_one_on_a_teat_are_counted_apart():
    (row,) = empty_liners(("wide-empty", "wide-round"), (25.0,)).splitlines()[-1:]
    assert row == "| 25 | 100 % | none | 0 % |"


def test_a_ramp_is_judged_by_the_bending_stiffness_and_by_the_mean_on_a_teat():
    values = LinerValues(
        3.0, 2.5, 60.0, 1e-4 * np.eye(3), 1e-5 * np.eye(3), (0,), Estimate(np.ones(1), np.ones(1)), 1.0, ("",)
    )
    touch = Collapse(
        Estimate(np.array(9.0), np.array(0.1)), Estimate(np.array(8.0), np.array(0.2)), 0.05, 0.05
    )
    ramped = Ramped("thin", np.array([0.02, -0.01, 0.05]), values, touch, {"without": [1.0, -2.0]})
    (values_row,), (worth_row,) = (list(rows([ramped]))[2:] for rows in (value_rows, worth_rows))
    assert values_row.startswith("| thin | -1.0 / 3.2 | +2.0 / 1.0 | -1.0 / 1.0 | +5.0 / 1.0 | +")
    assert worth_row == "| thin | +1.0, -2.0 |"
