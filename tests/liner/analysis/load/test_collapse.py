"""Touch and buckling of the empty liner, against walls that were solved as solids, with σ and refusals."""

import numpy as np
import pytest

from grabberd.errors import AnalysisError
from grabberd_fake.wall_states import buckling_kpa, touch_kpa
from grabberd_liner.analysis.load.collapse import collapse
from liner.analysis.ramps import empty, guessed, open_liner, ramp
from liner.analysis.walls import SolvedLiner, solved_six

DESIGNS = ("reference", "thin", "stiffening", "wide", "rubbing", "tapered")
LEVELS = 120


def found(design, last=1.02, seed=0, own_kpa=0.1, common_kpa=0.0, levels=LEVELS, thickness=1.0):
    return found_of(empty(design), last, seed, own_kpa, common_kpa, levels, thickness)


def found_of(
    liner: SolvedLiner, last=1.02, seed=0, own_kpa=0.1, common_kpa=0.0, levels=LEVELS, thickness=1.0
):
    kpa = np.linspace(0.0, last * touch_kpa(liner.states), levels)
    levels = ramp(liner, kpa, seed, own_kpa, common_kpa)
    return collapse(liner.grid, guessed(liner, thickness=thickness), open_liner(liner), levels, common_kpa)


@pytest.fixture(scope="module")
def all_designs():
    return [(empty(design).states, found(design, own_kpa=0.05)) for design in DESIGNS]


def test_the_walls_touch_where_those_of_the_solved_liner_do(all_designs):
    for states, one in all_designs:
        assert one.touch_kpa.value == pytest.approx(touch_kpa(states), abs=0.2)


def test_the_liner_buckles_where_the_solved_one_does(all_designs):
    for states, one in all_designs:
        assert one.buckling_kpa.value == pytest.approx(buckling_kpa(states), abs=0.25)


@pytest.mark.parametrize("design", ["reference", "wide", "stiffening", "thin"])
@pytest.mark.parametrize("last", [1.02, 1.5])
def test_targets_beside_the_fold_move_neither_touch_nor_buckling(design, last):
    """Six columns reach round to where the wall folds."""
    liner = solved_six(f"{design}-empty")
    one = found_of(liner, last, own_kpa=0.05)
    assert one.touch_kpa.value == pytest.approx(touch_kpa(liner.states), abs=0.25)
    assert one.buckling_kpa.value == pytest.approx(buckling_kpa(liner.states), abs=0.3)


def test_sigma_says_how_far_they_are_off():
    states = empty("thin").states
    many = [found("thin", seed=seed) for seed in range(8)]
    touch = [(one.touch_kpa.value - touch_kpa(states)) / one.touch_kpa.sigma for one in many]
    buckling = [(one.buckling_kpa.value - buckling_kpa(states)) / one.buckling_kpa.sigma for one in many]
    assert 0.2 < np.mean(np.square(touch)) < 2.0
    assert 0.2 < np.mean(np.square(buckling)) < 2.0


def test_the_gauge_s_own_error_is_not_averaged_out():
    one = found("thin", common_kpa=0.5)
    assert one.touch_kpa.sigma > one.touch_common_kpa > 0.5  # with the wall's thickness
    assert one.buckling_kpa.sigma > one.buckling_common_kpa == 0.5


def test_a_thicker_wall_touches_earlier():
    thin, thick = (float(found("thin", thickness=factor).touch_kpa.value) for factor in (1.0, 1.1))
    assert thick < thin


def test_a_ramp_that_ends_before_touch_is_refused():
    with pytest.raises(AnalysisError, match=r"still \d+\.\d mm apart"):
        found("thin", last=0.85)


def test_a_ramp_that_does_not_come_near_touch_is_refused():
    with pytest.raises(AnalysisError, match="the touch of opposite walls cannot be read: 0 levels"):
        found("thin", last=0.6)


def test_a_ramp_in_a_few_steps_is_refused():
    with pytest.raises(AnalysisError, match="cannot be read"):
        found("thin", levels=8)


def test_a_ramp_that_goes_on_far_beyond_touch_says_the_same():
    """There other rows come as low as the one that touched first."""
    liner = empty("thin")
    true_kpa = touch_kpa(liner.states)
    assert found("thin", last=1.8, levels=2 * LEVELS).touch_kpa.value == pytest.approx(true_kpa, abs=0.3)
