"""The wall's material: all of it is given from outside, and what no wall has is refused."""

import numpy as np
import pytest

from grabberd.errors import AnalysisError, InputError
from grabberd_liner.analysis.wall.material import (
    Material,
    Zone,
    neo_hookean_stretch,
    pre_stretch,
    varied,
    wall_at,
)

RUBBER = {
    "E_mpa": 3.0,
    "wall_mm": 2.5,
    "poisson": 0.5,
    "F0_n": 60.0,
    "radius_mm": 12.5,
    "target_mm": 0.1,
    "law": "neo_hookean",
}


def rubber(**other):
    return Material(**{**RUBBER, **other})


def test_nothing_has_a_silent_default():
    with pytest.raises(TypeError):
        Material(E_mpa=3.0)


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("wall_mm", 0.0, "wall_mm is 0, expected above 0"),
        ("E_mpa", -3.0, "E_mpa is -3, expected above 0"),
        ("poisson", 0.6, "poisson is 0.6, expected 0 to .5"),
        ("poisson", 0.4, "keeps the volume"),
        ("poisson", float("nan"), "poisson is nan"),
        ("F0_n", -1.0, "F0_n is -1, expected from 0"),
        ("law", "hooke", "known are neo_hookean, linear"),
        ("wall_mm", 26.0, "thicker than a liner of this radius"),
        ("radius_mm", float("inf"), "radius_mm is inf"),
        ("E_sigma_mpa", -0.1, "E_sigma_mpa is -0.1"),
    ],
)
def test_what_no_wall_has_is_refused_by_name(name, value, said):
    with pytest.raises(InputError, match="material cannot be used") as caught:
        rubber(**{name: value})
    assert said in caught.value.message
    assert caught.value.hint


def test_all_problems_are_named_at_once():
    with pytest.raises(InputError, match=r"E_mpa.*wall_mm.*law"):
        rubber(E_mpa=0, wall_mm=-1, law="?")


def test_the_middle_surface_lies_half_a_wall_and_a_target_under_the_targets():
    assert rubber().depth_mm == pytest.approx(1.35)


def test_the_mounting_force_stretches_the_wall_until_it_carries_it():
    along, across = pre_stretch(rubber())
    tension = 3.0 / 3 * 2.5 * (along**2 - across**2)
    assert 1e3 * tension == pytest.approx(1e3 * 60 / (2 * np.pi * 12.5))
    assert across == pytest.approx(along**-0.5)
    assert pre_stretch(rubber(F0_n=0.0)) == pytest.approx((1.0, 1.0))


@pytest.mark.parametrize("load", [-0.5, 0.0, 1e-9, 0.3, 5.0, 1e3])
def test_a_bar_of_rubber_stretches_until_it_carries_its_load(load):
    stretch = neo_hookean_stretch(load)
    assert stretch**2 - 1 / stretch == pytest.approx(load, rel=1e-12, abs=1e-14)


def test_in_the_linear_law_it_stretches_by_force_over_stiffness():
    along, across = pre_stretch(rubber(law="linear", poisson=0.3))
    strain = 60 / (2 * np.pi * 12.5 * 3 * 2.5)
    assert (along, across) == pytest.approx((1 + strain, 1 - 0.3 * strain))


def test_each_place_has_the_material_of_its_zone():
    zones = [Zone.of_rows(0, 8, 6.5, rubber()), Zone.of_rows(9, 17, 6.5, rubber(E_mpa=2.0, wall_mm=3.0))]
    wall = wall_at(zones, np.array([0.0, 52.0, 58.5, 110.5]))
    assert wall.E_mpa == pytest.approx([3.0, 3.0, 2.0, 2.0])
    assert wall.depth_mm == pytest.approx([1.35, 1.35, 1.6, 1.6])
    assert wall.stiffness_n_mm[0] == pytest.approx(3.0 * 2.5**3 / 12 / 0.75)


def test_a_place_in_no_zone_or_in_two_is_refused():
    low, high = Zone(0.0, 50.0, rubber()), Zone(60.0, 100.0, rubber())
    with pytest.raises(AnalysisError, match=r"1 places lie in no zone .* u = 55\.0 to 55\.0 mm"):
        wall_at([low, high], np.array([20.0, 55.0]))
    with pytest.raises(AnalysisError, match="no zone"):
        wall_at([], np.array([20.0]))
    with pytest.raises(AnalysisError, match="more than one zone"):
        wall_at([low, low], np.array([20.0]))


def test_inputs_with_a_sigma_are_varied_by_it_and_those_without_are_not():
    zones = [Zone(0.0, 50.0, rubber(E_sigma_mpa=0.2)), Zone(50.0, 90.0, rubber())]
    assert [zone.material.E_mpa for zone in varied(zones, "E_mpa")] == pytest.approx([3.2, 3.0])
    assert varied(zones, "wall_mm") is None
