"""The artificial teat: slope, offset, hysteresis, on a wall solved as a solid and on made-up steps."""

import numpy as np
import pytest

from grabberd.core.chain.columns import Column, Table
from grabberd_liner.analysis.estimate import Estimate
from grabberd_liner.chain.guided_tests.artificial_teat import artificial_teat_test
from liner.analysis.walls import solved
from liner.chain.guided_tests.evidence import analysed, by_name, evidence, material_of, still_fields

STEPS = (0.0, 2.0, 4.0, 6.0, 8.0)


def step(known, found, common=0.1, sigma=0.05, **labels):
    """A capture of one step, five fields of which found this pressure."""
    fields = found + sigma * np.array([-1.0, -0.5, 0.0, 0.5, 1.0])
    whole = np.full(5, np.hypot(sigma, common))
    rows = {"mean_contact_kpa": fields, "sigma_mean_contact_kpa": whole}
    columns = tuple(Column(name, "kPa", "float64", "pressure") for name in rows)
    table = Table("fields", "fields", columns, rows)
    return evidence(labels={"liner": "A", "known_kpa": f"{known:g}", **labels}, tables={"fields": table})


def judged(found=lambda known, up: known, steps=(*STEPS, *STEPS[-2::-1])):
    """Steps up and down, whose found pressure is a function of the known one."""
    top = int(np.argmax(steps))
    return artificial_teat_test([step(known, found(known, at <= top)) for at, known in enumerate(steps)])


def test_a_rig_that_finds_the_known_pressures_passes():
    outcome = judged()
    assert {one.verdict for one in outcome.checks} == {"passed"}
    found = {one.quantity.name: one for one in outcome.findings}
    assert found["slope"].value == pytest.approx(1.0)
    assert found["offset_kpa"].value == pytest.approx(0.0, abs=1e-9)
    assert found["offset_kpa"].common == pytest.approx(0.1, rel=0.1)


def test_what_is_common_to_all_steps_stays_in_the_sigma_of_the_offset():
    many = judged(steps=STEPS * 20)
    found = {one.quantity.name: one for one in many.findings}
    assert found["offset_kpa"].sigma >= 0.1


def test_a_modulus_that_is_off_by_a_quarter_fails_by_the_slope():
    found = by_name(judged(lambda known, up: 1.25 * known))
    assert found["slope"].verdict == "failed"
    assert "ramp" in found["slope"].remedy
    assert found["offset"].verdict == "passed"


def test_a_gauge_that_is_off_by_two_kpa_fails_by_the_offset():
    found = by_name(judged(lambda known, up: known - 2.0))
    assert found["offset"].verdict == "failed"
    assert found["zero_step"].verdict == "failed"
    assert found["slope"].verdict == "passed"


def test_a_slope_near_its_limit_is_not_certain():
    assert by_name(judged(lambda known, up: 1.09 * known))["slope"].verdict == "not certain"


def test_a_rubber_that_lags_fails_by_the_hysteresis():
    outcome = judged(lambda known, up: known if up else known + 2.0)
    assert by_name(outcome)["hysteresis"].verdict == "failed"
    found = {one.quantity.name: one for one in outcome.findings}
    assert found["hysteresis_kpa"].value == pytest.approx(2.0)


def test_steps_upwards_alone_have_no_hysteresis():
    assert by_name(judged(steps=STEPS))["hysteresis"].verdict == "not checked"


def test_steps_without_zero_or_too_few_of_them_fail():
    assert by_name(judged(steps=(2.0, 4.0, 6.0)))["steps"].verdict == "failed"
    found = by_name(judged(steps=(0.0, 4.0)))
    assert found["steps"].verdict == "failed"
    assert found["slope"].verdict == "not checked"


def test_a_label_that_is_no_number_leaves_the_capture_out():
    captures = [step(known, known) for known in STEPS] + [step(0, 50.0, known_kpa="two")]
    assert by_name(artificial_teat_test(captures))["slope"].verdict == "passed"


def test_a_step_without_a_pressure_is_named():
    captures = [step(known, known) for known in STEPS[:4]]
    nothing = evidence(labels={"known_kpa": "8"}, problem="the wall in equilibrium contradicts the points")
    check = by_name(artificial_teat_test([*captures, nothing]))["pressure_found"]
    assert check.verdict == "failed"
    assert "8 kPa" in check.reason
    assert "contradicts the points" in check.reason


def test_a_sigma_of_the_known_pressure_counts():
    def sigma(**labels):
        outcome = artificial_teat_test([step(known, known, **labels) for known in STEPS])
        return {one.quantity.name: one for one in outcome.findings}["slope"].sigma

    assert sigma(known_sigma_kpa="2") > 5 * sigma()


@pytest.fixture(scope="module")
def solved_steps():
    """Steps of a wall on a teat, with its reference in another capture; known is the solved pressure."""
    liner = solved("reference-round")
    reference = still_fields(liner, seed=9)[0].timed.points
    captures = []
    for at, kpa in enumerate((0.0, 12.0, 20.0, 28.0)):
        vacuum = {
            "pulsation": {"kpa": 42.0 - kpa, "sigma_kpa": 0.1},
            "liner": {"kpa": 42.0, "sigma_kpa": 0.1},
        }
        inputs = {
            "reference": {"capture": "reference"},
            "material": material_of(liner, E_sigma_mpa=0.03 * liner.design["young_mpa"]),
            "vacuum": vacuum,
            "sought_kpa": 1.0,
            "average": 6,
        }
        known = float(liner.contact_kpa(kpa).mean())
        labels = {"liner": "A", "known_kpa": f"{known:.3f}"}
        fields = still_fields(liner, kpa, count=12, seed=at)
        captures.append(analysed(fields, liner.grid, inputs, labels=labels, reference=reference))
    return captures


def test_the_pressure_on_a_solved_wall_is_its_own(solved_steps):
    found = {one.quantity.name: one for one in artificial_teat_test(solved_steps).findings}
    slope, offset = found["slope"], found["offset_kpa"]
    assert slope.value == pytest.approx(1.0, abs=0.15)
    assert offset.value == pytest.approx(0.0, abs=max(3 * offset.sigma, 1.0))


def test_a_mean_of_many_fields_keeps_what_they_share():
    value, common = step(4.0, 4.0, common=0.3, sigma=0.05).mean_contact_kpa()
    assert isinstance(value, Estimate)
    assert common == pytest.approx(0.3, rel=0.05)
    assert common < value.sigma < np.hypot(0.3, 0.05)
