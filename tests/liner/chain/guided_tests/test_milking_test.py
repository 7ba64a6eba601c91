"""The test of a milking: what was found, what is missing, the pulsator by ISO 5707."""

from dataclasses import replace

import numpy as np
import pytest

from core.chain.milking import FAKE, analysed, field, log
from grabberd_fake.vacuum import pulsation_kpa
from grabberd_liner.analysis.estimate import Estimate
from grabberd_liner.analysis.load.pressure import PressureMap
from grabberd_liner.analysis.vacuum.milk_flow import FlowCurve
from grabberd_liner.chain.analysis.tables import tables
from grabberd_liner.chain.guided_tests.milking_test import milking_test
from liner.analysis.load.profiles import closed
from liner.chain.guided_tests.evidence import by_name, evidence, profile

FIELDS = [field(n) for n in range(62)]
LOGGED = {
    "pulsation": "log",
    "liner": "log",
    "log": log(1.6, start_s=-0.3),
    "offset": {"s": -0.3, "sigma_s": 0.001},
}


def judged(analysis, **changed):
    return milking_test(evidence(analysis=analysis, tables=tables(analysis), captured=FIELDS, **changed))


@pytest.fixture(scope="module")
def plain():
    """Without material, so without pressure."""
    return analysed(FIELDS, reference="nominal", vacuum=LOGGED, phases=12, sought_kpa=1.0)


@pytest.fixture(scope="module")
def loaded(plain):
    """The same with a load that is as if there were a teat."""
    return with_misfit(plain, 0.7)


def with_misfit(plain, misfit):
    none = Estimate(np.zeros(35), np.ones(35))
    mean, seen = Estimate(np.zeros(()), np.ones(())), np.ones(35, bool)
    pressure = PressureMap(none, mean, none, misfit, None, seen, ("",) * 35, closed())
    phases = tuple(state._replace(pressure=pressure) for state in plain.phases)
    given = replace(plain.inputs, flow_stop_kpa=Estimate(np.asarray(9.0), np.asarray(1.0)))
    return replace(plain, phases=phases, inputs=given)


def test_a_milking_whose_load_is_known_has_all_quantities(loaded):
    outcome = judged(loaded)
    found = by_name(outcome)
    known = ("load_known", "teat_end_seen", "times_known", "columns_seen", "misfit")
    assert {found[name].verdict for name in known} == {"passed"}
    names = {one.quantity.name for one in outcome.findings if np.isfinite(one.value)}
    assert {"liner_compression_mean_kpa", "teat_load_n", "liner_closing_s", "liner_closing_1mm_s"} <= names
    assert {"liner_compression_teat_end_above_atmosphere_kpa", "teat_end_beyond_flow_stop_kpa"} <= names
    assert outcome.curves[0].name == "compression"


def test_without_material_the_load_fails_and_says_why(plain):
    check = by_name(judged(plain))["load_known"]
    assert check.verdict == "failed"
    assert "material" in check.reason
    assert by_name(judged(plain))["misfit"].verdict == "not checked"


def test_without_milk_flow_and_flow_stop_overpressure_is_not_checked(loaded):
    lacking = replace(loaded, inputs=replace(loaded.inputs, flow_stop_kpa=None))
    check = by_name(judged(lacking))["overpressure_known"]
    assert check.verdict == "not checked"
    assert "milk_flow was not given" in check.reason
    assert "cow's" in check.reason


def test_an_overpressure_that_was_asked_for_and_not_found_fails(loaded):
    check = by_name(judged(loaded))["overpressure_known"]
    assert check.verdict == "failed"
    assert check.reason.startswith("the contact pressure at the teat's end")


def test_one_way_to_the_overpressure_is_enough():
    given = LOGGED | {"log": log(2.6, start_s=-0.3)}
    plain = analysed([field(n) for n in range(112)], reference="nominal", vacuum=given, phases=4)
    time_s = np.arange(-0.25, 2.25, 1e-3)
    flows = np.clip((pulsation_kpa(FAKE.ellipse, time_s) - 8.0) / 2 + 0.5, 0, 1)
    milking = replace(plain, inputs=replace(plain.inputs, milk_flow=FlowCurve(time_s, flows)))
    assert by_name(judged(milking))["overpressure_known"].verdict == "passed"


def test_a_misfit_that_says_the_inputs_are_wrong_fails(plain):
    assert by_name(judged(with_misfit(plain, 2.1)))["misfit"].verdict == "failed"


def test_the_pulsator_is_judged_by_the_standard(loaded):
    found = by_name(judged(loaded))
    for name in ("phase_b", "phase_d", "phase_d_time"):
        assert found[name].verdict in ("passed", "failed")
        assert found[name].limit.startswith("at least")


def test_few_cycles_fail(loaded):
    found = by_name(judged(loaded))["cycles"]
    assert found.verdict == "failed"
    assert found.value == pytest.approx(62 * 0.02 / 0.6, abs=1.1)


def test_columns_that_are_hardly_seen_do_not_count(loaded):
    def without(one, columns):
        points = one.timed.points
        grid = loaded.grid
        keep = ~np.isin(grid.column[grid.indices(points.target)], columns)
        return one._replace(timed=one.timed._replace(points=points.select(keep)))

    fields = [without(one, (0, 4)) for one in FIELDS]
    one = evidence(analysis=loaded, tables=tables(loaded), captured=fields)
    assert by_name(milking_test(one))["columns_seen"].verdict == "failed"


def test_a_lag_is_offered_to_a_profile_that_has_none(loaded):
    """The lag needs one clock: a light, or channels recorded with the capture."""
    assert judged(loaded, liner=profile(material={})).offer is None
    made = evidence(analysis=loaded, tables=tables(loaded), captured=FIELDS, liner=profile(material={}))
    table = made.tables["quantities"]
    row = table.column("name").tolist().index("opening_lag_s")
    for at, value in ((row, 0.004), (row + 1, -0.003)):
        table.rows["value"][at], table.rows["sigma_value"][at] = value, 0.001
    offer = milking_test(made).offer
    assert offer.content["lag"] == {"opening_s": 0.004, "closing_s": -0.003, "sigma_s": 0.001}
    assert milking_test(made._replace(liner=profile(lag={"opening_s": 0.0}))).offer is None


def test_a_capture_that_was_not_analysed_is_not_checked():
    assert {one.verdict for one in milking_test(evidence()).checks} == {"not checked"}
