"""The committed tables: made from today's designs, in balance, and as closed forms say."""

import numpy as np
import pytest
from tools.liner_wall.__main__ import FROM_MPA, STEP_MPA, TO_MPA
from tools.liner_wall.designs import Case, Design, cases, mounting_stretch
from tools.liner_wall.path import _LARGEST_SHIFT_MM
from tools.liner_wall.teat import Teat

from grabberd_fake.wall_states import WallStates, buckling_kpa, touch_kpa, wall_names, wall_states

CASES = [case for case in cases() if case.name != "reference-round-towards"]
EMPTY = [case for case in CASES if case.teat is None]
by_name = pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
by_empty = pytest.mark.parametrize("case", EMPTY, ids=lambda case: case.name)


def ring_stiffness_kpa(case: Case) -> float:
    """D/R³ of a section that is free to stretch along, which is what a long tube buckles with."""
    design = case.design
    return 1000 * design.young_mpa / 9 * (design.wall_mm / design.radius_mm) ** 3


def mean_radius_mm(states: WallStates, state: int) -> float:
    """Of the outer face in the middle of the length: Simpson's rule round it."""
    middle = len(states.x_mm) // 2
    weights = np.ones(len(states.theta))
    weights[1:-1:2], weights[2:-1:2] = 4, 2
    radii = np.hypot(*states.outer_states_mm[state, middle, :, 1:].T)
    return float(np.average(radii, weights=weights))


def test_every_case_has_its_table_and_every_table_its_case() -> None:
    assert wall_names() == sorted(case.name for case in CASES)


@by_name
def test_recipe_of_the_table_is_that_of_the_case(case: Case) -> None:
    about = wall_states(case.name).about
    assert Design(**about["design"]) == case.design
    assert (Teat(**about["teat"]) if about["teat"] else None) == case.teat


@by_name
def test_states_reach_over_all_pressures_in_steps_that_can_be_interpolated(case: Case) -> None:
    states = wall_states(case.name)
    assert states.outer_kpa[[0, -1]] == pytest.approx([1000 * FROM_MPA, 1000 * TO_MPA])
    steps = np.diff(states.outer_kpa)
    assert steps.min() > 0
    assert steps.max() <= 1000 * STEP_MPA + 1e-9
    moved_mm = np.abs(np.diff(states.outer_states_mm, axis=0)).max()
    assert moved_mm < _LARGEST_SHIFT_MM + 0.01
    assert not states.snapped.any(), "between two states a snapped wall would be at none"


@by_name
def test_wall_closes_all_the_way_and_nowhere_opens_again(case: Case) -> None:
    states = wall_states(case.name)
    heights = states.outer_states_mm[states.outer_kpa >= 0, :, 0, 2]
    assert np.diff(heights, axis=0).max() < 0.05, "walls that have met are squeezed a little wider elsewhere"
    load = states.force_states_n_per_mm[states.outer_kpa >= 0]
    assert np.diff(load, axis=0).min() > -0.01


@by_name
def test_contact_pushes_only(case: Case) -> None:
    states = wall_states(case.name)
    assert states.contact_states_kpa.min() >= 0
    assert states.force_states_n_per_mm.min() >= 0


@by_name
def test_held_ends_keep_their_places(case: Case) -> None:
    ends = wall_states(case.name).outer_states_mm[:, [0, -1]]
    assert np.ptp(ends, axis=0).max() < 1e-6


@by_name
def test_round_wall_widens_like_a_thick_cylinder_of_stretched_rubber(case: Case) -> None:
    # Lamé, incompressible, in plane strain; rubber stretched by λ along resists hoop strain with µ/λ.
    design, states = case.design, wall_states(case.name)
    stretch = mounting_stretch(design)
    stiffened = 1 + 2 * design.stiffening * (stretch**2 + 2 / stretch - 3)
    shear_kpa = 1000 * design.young_mpa / 3 * stiffened / stretch
    a, b = (design.radius_mm + side * design.wall_mm / 2 for side in (-1, 1))
    blown, open_ = (int(np.searchsorted(states.outer_kpa, kpa)) for kpa in (-3.0, 0.0))
    widened = mean_radius_mm(states, blown) - mean_radius_mm(states, open_)
    assert widened == pytest.approx(3 * a**2 * b / (2 * shear_kpa * (b**2 - a**2)), rel=0.06)


@by_empty
def test_held_ends_and_pretension_let_it_buckle_later_than_a_ring(case: Case) -> None:
    assert 1.05 < buckling_kpa(wall_states(case.name)) / (3 * ring_stiffness_kpa(case)) < 1.6


@by_empty
def test_held_ends_and_pretension_let_its_walls_meet_later_than_a_rings(case: Case) -> None:
    assert 1.0 < touch_kpa(wall_states(case.name)) / (5.24687 * ring_stiffness_kpa(case)) < 1.25


@pytest.mark.parametrize("design", sorted({case.design.name for case in CASES}))
def test_teat_keeps_the_wall_farther_open_than_no_teat(design: str) -> None:
    empty, teats = wall_states(f"{design}-empty"), [f"{design}-{t}" for t in ("round", "blunt", "pointed")]
    for name in teats:
        on_teat = wall_states(name)
        beside = on_teat.x_mm < 0
        above_mm = on_teat.outer_mm(42.0)[beside, 0, 2] - empty.outer_mm(42.0)[beside, 0, 2]
        assert above_mm.min() > -0.05
        assert above_mm.max() > 3
