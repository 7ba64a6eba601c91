"""The test of the empty liner by a ramp, on walls solved as solids: each check passes and fails."""

from dataclasses import replace

import numpy as np
import pytest

from grabberd_fake.wall_states import buckling_kpa, touch_kpa
from grabberd_liner.analysis.estimate import Estimate
from grabberd_liner.analysis.pulsation.movement import TimedPoints
from grabberd_liner.chain.analysis.tables import tables
from grabberd_liner.chain.analysis.wall_series import RampCourse
from grabberd_liner.chain.analysis.wall_state import FieldPoints
from grabberd_liner.chain.guided_tests.outcome import worst
from grabberd_liner.chain.guided_tests.ramp_test import ramp_test
from liner.analysis.ramps import empty
from liner.analysis.walls import solved
from liner.chain.guided_tests.evidence import analysed, by_name, evidence, material_of, profile

LINER_KPA, RATE_KPA_PER_S = 42.0, 1.0
RAMP_KPA = np.concatenate([np.linspace(0.0, 5.4, 6), np.linspace(5.6, 8.4, 30)])


def inputs(kpa, **changed):
    """Inputs of a ramp with the empty liner "thin", whose vacuum is a log."""
    duration_s = max(kpa) / RATE_KPA_PER_S
    log = "time_s,pulsation_vacuum_kpa\n" + "\n".join(
        f"{time_s:.3f},{LINER_KPA - max(time_s, 0.0) * RATE_KPA_PER_S:.3f}"
        for time_s in np.arange(-1.0, duration_s + 1.0, 0.01)
    )
    vacuum = {
        "pulsation": "log",
        "liner": {"kpa": LINER_KPA, "sigma_kpa": 0.05},
        "log": log,
        "offset": {"s": 0.0, "sigma_s": 0.001},
        "gauge_sigma_kpa": 0.05,
    }
    material = material_of(empty("thin"), **changed)
    plane = {"point_mm": [0, 0, 0], "normal": [0, 0, 1]}
    return {"teat": "none", "reference": {"field": 0}, "material": material, "vacuum": vacuum, "plane": plane}


def made(kpa=RAMP_KPA, wall="thin-empty", **changed):
    """Evidence of a ramp at these pressure differences."""
    liner = solved(wall)
    fields = [
        FieldPoints(n, TimedPoints(at / RATE_KPA_PER_S, liner.points(at, n))) for n, at in enumerate(kpa)
    ]
    given = inputs(kpa, **changed)
    known = profile(material=given["material"], obtained={"radius_mm": "drawing"})
    return analysed(fields, liner.grid, given, liner=known)


@pytest.fixture(scope="module")
def slow():
    return made()


def test_a_slow_ramp_of_the_liner_of_the_profile_passes(slow):
    outcome = ramp_test(slow)
    assert worst(outcome.checks) == "passed", [one for one in outcome.checks if one.verdict != "passed"]
    assert all(one.verdict == "passed" for one in outcome.checks)


def test_its_quantities_are_those_of_the_wall(slow):
    states = empty("thin").states
    found = {one.quantity.name: one for one in ramp_test(slow).findings}
    assert found["touch_kpa"].value == pytest.approx(touch_kpa(states), abs=0.25)
    assert found["buckling_kpa"].value == pytest.approx(buckling_kpa(states), abs=0.25)
    design = empty("thin").design
    true = design["young_mpa"] * design["wall_mm"] ** 3 / 9
    assert found["stiffness_n_mm"].value == pytest.approx(true, rel=0.05)


def test_it_offers_the_material_to_the_profile_and_says_how_it_was_obtained(slow):
    offer = ramp_test(slow).offer
    assert offer.after == 3
    assert offer.content["material"]["E_wall_correlation"] < 0
    assert offer.content["material"]["E_sigma_mpa"] < slow.material.E_sigma_mpa
    said = "ramp of 2026-03-01, capture 20260301T093000Z-barn"
    assert offer.content["obtained"] == {
        **dict.fromkeys(("E_mpa", "wall_mm", "F0_n"), said),
        "radius_mm": "drawing",
    }


def test_without_a_profile_nothing_is_offered(slow):
    assert ramp_test(slow._replace(liner=None)).offer is None


def test_the_distance_is_drawn_over_the_pressure_difference(slow):
    distance, *marks = ramp_test(slow).curves
    assert [one.name for one in marks] == ["buckling_kpa", "touch_kpa"]
    assert distance.x[0] == pytest.approx(0.0, abs=0.1)
    assert distance.y[0] > 10
    assert distance.y[-1] < 3


def with_course(analysis, part, sigma_kpa=0.0):
    """The analysis of a part of its fields, with that much more σ of the pressure difference."""
    course = analysis.empty.course
    kpa, sigma = (values[part] for values in course.difference_kpa)
    height_mm = Estimate(*(values[part] for values in course.height_mm))
    changed = RampCourse(Estimate(kpa, sigma + sigma_kpa), height_mm)
    return replace(analysis, time_s=analysis.time_s[part], empty=analysis.empty._replace(course=changed))


def test_a_ramp_that_is_too_fast_fails(slow):
    """The same states, passed in a fiftieth of the time."""

    fast = replace(
        slow.analysis,
        time_s=slow.analysis.time_s / 50,
        movement=slow.analysis.movement._replace(time_s=slow.analysis.movement.time_s / 50),
    )
    found = by_name(ramp_test(slow._replace(analysis=fast)))
    assert found["slow_enough"].verdict == "failed"
    assert found["slow_enough"].value == pytest.approx(50 * RATE_KPA_PER_S, rel=0.05)
    assert found["wall_slow_enough"].verdict == "failed"


def test_a_ramp_that_begins_with_a_closed_liner_fails(slow):
    later = with_course(slow.analysis, slice(8, None))
    assert by_name(ramp_test(slow._replace(analysis=later)))["starts_open"].verdict == "failed"


def test_few_fields_between_buckling_and_touch_fail(slow):
    few = with_course(slow.analysis, slice(None, None, 5))
    assert by_name(ramp_test(slow._replace(analysis=few)))["levels_between"].verdict == "failed"


def test_a_gauge_that_nobody_calibrated_fails(slow):
    vague = with_course(slow.analysis, slice(None), sigma_kpa=0.6)
    assert by_name(ramp_test(slow._replace(analysis=vague)))["gauge"].verdict == "failed"


def test_a_ramp_that_ends_before_touch_fails_with_the_distance():
    short = made(RAMP_KPA[RAMP_KPA < 7.0])
    found = by_name(ramp_test(short))
    assert found["reached_touch"].verdict == "failed"
    assert "touch" in found["reached_touch"].reason
    assert found["levels_between"].verdict == "not checked"


def test_a_profile_with_half_the_modulus_fails():
    found = by_name(ramp_test(made(E_mpa=1.5, E_sigma_mpa=0.15)))
    assert "failed" in {found["prior_E_mpa"].verdict, found["misfit"].verdict}


def test_a_profile_that_is_known_better_than_the_ramp_tells_agrees_within_what_both_leave_open():
    """σ of the modulus has the rubber's law in it, which no prior lessens: it may exceed the prior's."""
    found = by_name(ramp_test(made(E_mpa=2.44, E_sigma_mpa=0.06)))["prior_E_mpa"]
    assert found.sigma > 0.06
    assert found.verdict == "passed"


def test_a_teat_that_was_left_in_fails():
    """A liner that closes on a teat neither buckles nor touches as an empty one."""
    found = by_name(ramp_test(made(wall="thin-round")))
    assert found["reached_touch"].verdict == "failed"
    assert found["reached_touch"].remedy


def test_a_capture_that_was_not_analysed_is_not_checked():
    assert {one.verdict for one in ramp_test(evidence()).checks} == {"not checked"}


def test_the_table_ramp_is_the_source(slow):
    """No number of the test is found a second time."""
    row = tables(slow.analysis)["ramp"]
    found = {one.quantity.name: one.value for one in ramp_test(slow).findings}
    assert found["touch_kpa"] == row.column("touch_kpa")[0]
