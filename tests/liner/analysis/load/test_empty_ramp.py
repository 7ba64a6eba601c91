"""The liner's own values from a ramp, against walls that were solved as solids, with σ and refusals."""

from dataclasses import replace

import numpy as np
import pytest

from grabberd.errors import AnalysisError
from grabberd_liner.analysis.load.empty_ramp import liner_values
from grabberd_liner.analysis.load.wall_model import TubePrior
from liner.analysis.ramps import empty, guessed, open_liner, ramp, solved_kpa

E_T3 = np.array([1.0, 3.0, 0.0])
"""Powers of E, t and F0 in the bending stiffness."""
LEVELS_KPA = (0.0, 4.5, 6.1875, 6.5625, 7.125, 7.875, 9.0)
"""Of the thin liner, which buckles at 5.6 kPa and whose walls touch at 8.2."""


@pytest.fixture(scope="module")
def thin():
    """A ramp with a liner that is off in all three values, and what is true."""
    liner = empty("thin")
    kpa = np.array(LEVELS_KPA)
    assert np.isin(kpa, np.round(solved_kpa(liner), 4)).all()
    material = guessed(liner, young=0.87, thickness=1.04, pretension=1.2)
    levels = ramp(liner, kpa, own_kpa=0.1)
    # As in every real ramp, the folding wall hides targets.
    levels[4] = levels[4]._replace(points=levels[4].points.select(np.arange(3, len(liner.grid))))
    found = liner_values(liner.grid, material, open_liner(liner), levels, 0.05)
    return liner, material, found


def off(thin):
    """Errors of ln E, ln t, ln F0."""
    liner, _, found = thin
    true = [liner.design[name] for name in ("young_mpa", "wall_mm", "pretension_n")]
    return np.log(np.array([found.E_mpa, found.wall_mm, found.F0_n]) / true)


def test_the_bending_stiffness_is_that_of_the_solved_wall_to_4_percent(thin):
    assert E_T3 @ off(thin) == pytest.approx(0.0, abs=0.04)


def test_sigma_says_how_far_the_values_are_off(thin):
    _, _, found = thin
    ratio = off(thin) / found.sigma
    assert np.abs(ratio).max() < 2.5
    assert 0.01 < found.sigma[0] < 0.06


def test_the_stiffness_is_better_known_than_its_parts(thin):
    _, _, found = thin
    assert found.stiffness_n_mm.sigma / found.stiffness_n_mm.value < found.sigma[0]
    assert found.stiffness_n_mm.value == pytest.approx(found.E_mpa * found.wall_mm**3 / 9)


def test_the_gauge_and_the_rubber_s_law_are_common_to_ramps(thin):
    _, _, found = thin
    assert (found.common_sigma[:3] < found.sigma).all()
    assert found.common_sigma[0] > 0.03  # that of the law alone
    own = np.diagonal(found.own)
    assert (own > 0).all()
    assert np.hypot(found.common_sigma[:3], np.sqrt(own)) == pytest.approx(found.sigma)


def test_each_level_that_is_not_fitted_says_why(thin):
    _, _, found = thin
    assert found.unused[0] == "not buckled enough to tell"
    assert found.unused[-1] == "opposite walls touch"
    assert [not reason for reason in found.unused].count(True) == len(found.used) == 4


def test_the_pressure_differences_are_found_along(thin):
    _, _, found = thin
    away = found.difference_kpa.value - np.array(LEVELS_KPA)[list(found.used)]
    assert np.abs(away / found.difference_kpa.sigma).max() < 3


def test_a_wall_that_fits_has_a_small_misfit(thin):
    assert 0.5 < thin[2].misfit < 1.2


def test_the_material_of_the_other_captures_has_the_values_and_what_relates_them(thin):
    _, material, found = thin
    taken = found.material(material)
    assert (taken.E_mpa, taken.wall_mm, taken.F0_n) == (found.E_mpa, found.wall_mm, found.F0_n)
    assert TubePrior.of(taken).covariance == pytest.approx(found.covariance)
    assert taken.radius_mm + taken.wall_mm / 2 == pytest.approx(material.radius_mm + material.wall_mm / 2)
    assert taken.ends_mm == material.ends_mm


def refused(levels, **material):
    liner = empty("thin")
    return liner_values(liner.grid, guessed(liner, **material), open_liner(liner), levels, 0.05)


def test_a_ramp_that_does_not_buckle_the_liner_is_refused():
    with pytest.raises(AnalysisError, match=r"the ramp does not buckle the liner: up to 4\.51 kPa"):
        refused(ramp(empty("thin"), np.array([0.0, 3.0, 4.5])))


def test_too_few_levels_between_buckling_and_touch_are_refused():
    levels = ramp(empty("thin"), np.array([0.0, 4.5, 6.5625, 7.125, 9.0]))
    with pytest.raises(
        AnalysisError, match="only 2 of 5 levels lie between buckling and touch, 4 are needed"
    ):
        refused(levels)


def test_no_levels_are_refused():
    with pytest.raises(AnalysisError, match="the ramp has no levels"):
        refused([])


def test_a_pretension_of_nothing_is_refused():
    with pytest.raises(AnalysisError, match="pretension of the liner is given as 0"):
        refused([], pretension=0.0)


def test_a_wall_that_something_presses_on_is_refused():
    liner = empty("thin")
    levels = ramp(liner, np.array(LEVELS_KPA[:-1]), own_kpa=0.02)
    bumped = [
        level._replace(points=replace(level.points, xyz_mm=_bumped(level.points.xyz_mm)))
        for level in levels[1:]
    ]
    with pytest.raises(AnalysisError, match=r"contradict each other|no equilibrium near"):
        refused([levels[0], *bumped])


def _bumped(places_mm):
    places_mm = places_mm.copy()
    places_mm[::2, 2] += 0.12
    return places_mm
