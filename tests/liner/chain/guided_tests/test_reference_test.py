"""The test of the mounted liner: its shape against profile and object model, on walls solved as solids."""

from dataclasses import replace

import numpy as np
import pytest

from grabberd_liner.analysis.pulsation.movement import TimedPoints
from grabberd_liner.chain.analysis.wall_state import FieldPoints
from grabberd_liner.chain.guided_tests.reference_test import mounting_stretch, reference_test
from liner.analysis.ramps import empty
from liner.analysis.walls import SolvedLiner, solved_six
from liner.chain.guided_tests.evidence import FIELD_S, analysed, by_name, material_of, still_fields

AT_ATMOSPHERE = {name: {"kpa": 0.0, "sigma_kpa": 0.1} for name in ("pulsation", "liner")}


def judged(liner, fields=None, labels=None, **changed):
    inputs = {
        "reference": {"field": 0},
        "material": material_of(liner, **changed),
        "vacuum": AT_ATMOSPHERE,
        "sought_kpa": 1.0,
        "average": 12,
    }
    fields = fields or still_fields(liner)
    return reference_test(analysed(fields, liner.grid, inputs, labels={"liner": "A"} | (labels or {})))


@pytest.fixture(scope="module")
def mounted():
    return judged(solved_six("reference-empty"), labels={"unmounted_pitch_mm": "5.9"})


def moved(liner, move):
    """Fields whose points are moved by a function of their places."""
    fields = still_fields(liner)
    return [
        FieldPoints(
            one.n,
            TimedPoints(one.n * FIELD_S, replace(one.timed.points, xyz_mm=move(one.timed.points.xyz_mm))),
        )
        for one in fields
    ]


@pytest.mark.parametrize(
    "name",
    [
        "mounted_radius",
        "round",
        "row_pitch",
        "axial_place",
        "pressure_zero",
        "mounting_stretch",
        "seen_stretch",
    ],
)
def test_the_liner_of_the_profile_passes(mounted, name):
    check = by_name(mounted)[name]
    assert check.verdict == "passed", check


def test_radius_and_pitch_are_those_of_the_wall(mounted):
    liner = solved_six("reference-empty")
    found = {one.quantity.name: one for one in mounted.findings}
    true_mm = np.linalg.norm(liner.places_mm(0.0)[:, 1:], axis=1).mean()
    assert found["mounted_radius_mm"].value == pytest.approx(true_mm, abs=0.05)
    assert found["row_pitch_mm"].value == pytest.approx(6.5, abs=0.01)


def test_the_section_is_drawn_with_that_of_the_profile(mounted):
    section, expected = mounted.curves
    assert np.hypot(expected.x, expected.y) == pytest.approx(13.75)
    assert np.hypot(section.x, section.y).mean() == pytest.approx(13.75, abs=0.1)


def test_the_profile_of_another_liner_fails_by_its_radius():
    liner = empty("reference")
    check = by_name(judged(liner, radius_mm=liner.design["radius_mm"] + 0.6))["mounted_radius"]
    assert check.verdict == "failed"
    assert "label" in check.remedy


def test_a_liner_that_something_pinches_is_not_round():
    def pinch(xyz_mm):
        return xyz_mm * (1.0, 0.95, 1.05)

    liner = solved_six("reference-empty")
    assert by_name(judged(liner, moved(liner, pinch)))["round"].verdict == "failed"


def test_four_columns_do_not_tell_an_oval():
    assert by_name(judged(empty("reference")))["round"].verdict == "not checked"


def test_a_liner_mounted_longer_or_elsewhere_fails():
    def longer(xyz_mm):
        return xyz_mm * (1.03, 1.0, 1.0) + (3.0, 0.0, 0.0)

    liner = empty("reference")
    found = by_name(judged(liner, moved(liner, longer)))
    assert found["row_pitch"].verdict == found["axial_place"].verdict == "failed"


def test_a_mounting_force_that_no_liner_has_fails():
    found = by_name(judged(empty("reference"), F0_n=400.0, F0_sigma_n=10.0))
    assert found["mounting_stretch"].verdict == "failed"


def test_a_stretch_that_contradicts_the_force_fails():
    found = by_name(judged(empty("reference"), labels={"unmounted_pitch_mm": "4.0"}))
    assert found["seen_stretch"].verdict == "failed"
    assert by_name(judged(empty("reference")))["seen_stretch"].verdict == "not checked"


def test_the_stretch_is_that_of_the_neo_hookean_law():
    (zone,) = empty("reference").zones()
    material = zone.material
    stretch = float(mounting_stretch(material).value)
    stress = material.E_mpa / 3 * (stretch**2 - 1 / stretch)
    assert stress * 2 * np.pi * material.radius_mm * material.wall_mm == pytest.approx(material.F0_n)
    wider = replace(material, F0_n=material.F0_n + material.F0_sigma_n, E_sigma_mpa=0.0, wall_sigma_mm=0.0)
    alone = replace(material, E_sigma_mpa=0.0, wall_sigma_mm=0.0)
    change = float(mounting_stretch(wider).value) - stretch
    assert float(mounting_stretch(alone).sigma) == pytest.approx(change, rel=0.1)


def test_a_vacuum_that_is_left_fails_where_a_gauge_reads_it():
    liner = SolvedLiner("reference-empty")
    log = "\n".join(
        ["time_s,pulsation_vacuum_kpa,liner_vacuum_kpa", *(f"{k / 100},40,40" for k in range(-5, 60))]
    )
    vacuum = {"pulsation": "log", "liner": "log", "log": log, "offset": {"s": 0, "sigma_s": 0.001}}
    inputs = {"reference": {"field": 0}, "vacuum": vacuum}
    found = by_name(reference_test(analysed(still_fields(liner), liner.grid, inputs)))
    assert found["vacuum_zero"].verdict == "failed"
    assert by_name(judged(empty("reference")))["vacuum_zero"].verdict == "not checked"
