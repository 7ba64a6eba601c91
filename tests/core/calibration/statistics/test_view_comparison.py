from dataclasses import replace

import numpy as np
import pytest

from core.calibration.networks import THREE, TRUE, network, tied
from grabberd.core.calibration.adjustment.adjustment import adjust
from grabberd.core.calibration.adjustment.network import LENS, Unknowns
from grabberd.core.calibration.significance import compare


def test_one_lens_shows_no_difference():
    found = compare(adjust(network(), Unknowns.of(TRUE)))
    assert [one.parameter for one in found] == ["f_mm", "x0_px", "y0_px", *(f"b{i}" for i in range(1, 10))]
    assert min(one.p for one in found) > 0.001


def test_a_difference_is_found_with_its_sigma():
    other = (TRUE[0], replace(TRUE[1], b=(0.008, *TRUE[1].b[1:])))
    adjusted = adjust(network(other), tied())
    difference = next(one for one in compare(adjusted) if one.parameter == "b1")
    assert difference.difference == pytest.approx(-0.005, abs=4 * difference.sigma)
    assert difference.difference == difference.first - difference.second
    assert abs(difference.z) > 5
    assert difference.p < 1e-5


def test_the_sigma_counts_the_correlation_and_its_z_is_standard_normal():
    free = ("kappa_rad", "f_mm", "X0_mm", "Y0_mm", "Z0_mm")
    known = np.array([0.2, 0.2, 0.2])
    z = []
    for seed in range(80):
        adjusted = adjust(network(target_sigma_mm=known, seed=seed), Unknowns.of(TRUE, free))
        z.append(compare(adjusted)[0].z)
    assert np.std(z) == pytest.approx(1.0, abs=0.25)


def test_a_term_dropped_in_one_view_is_compared_with_zero_and_its_own_sigma():
    adjusted = adjust(network(), tied().without(["right.b5"]))
    index = adjusted.unknowns.names.index("left.b5")
    difference = next(one for one in compare(adjusted) if one.parameter == "b5")
    assert difference.sigma == pytest.approx(adjusted.sigma[index])


def test_shared_and_held_parameters_are_not_compared():
    adjusted = adjust(network(), Unknowns.of(TRUE, ("f_mm", "b1", "b3", "kappa_rad"), shared=("f_mm", "b3")))
    assert [one.parameter for one in compare(adjusted)] == ["b1"]
    assert set(LENS) >= {"f_mm", "b3"}


def test_any_two_of_more_views_are_compared():
    adjusted = adjust(network(THREE), tied(THREE))
    first, last = compare(adjusted, 0, 2)[0], compare(adjusted, 2, 0)[0]
    assert first.difference == -last.difference
    assert first.second == adjusted.views[2].f_mm
