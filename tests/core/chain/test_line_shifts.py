"""Solving for the shifts of the lines makes points better, and their covariance stays true."""

from dataclasses import replace

import numpy as np
import pytest

from core.chain.fake_scene import take_scene
from grabberd.core.chain.measure import measure_fields
from grabberd.core.measurement import LocationSettings

WAYS = [(8, "field"), (1, "field")]


@pytest.fixture(scope="module")
def scene():
    """The accuracy object before the default rig with ideal mirrors: 2 % noise, jitter .12 px."""
    return take_scene(16, scene="accuracy_object", rig={"mirror_error_px": 0.0})


@pytest.fixture(scope="module")
def errors(scene):
    """Of each way, with the shifts solved for and without: errors in mm (N, 3), and covariances (N, 3, 3)."""
    return {(way, solved): errors_of(scene, way, solved) for way in WAYS for solved in (True, False)}


def errors_of(scene, way, solved):
    setup = replace(scene.setup, location=LocationSettings(line_shifts=solved))
    true = dict(zip(zip(scene.truth.n, scene.truth.target, strict=True), scene.truth.xyz_mm, strict=True))
    error, covariance = [], []
    for one in measure_fields(scene.packed(*way), setup):
        error += [xyz - true[one.n, t] for t, xyz in zip(one.points.target, one.points.xyz_mm, strict=True)]
        covariance.append(one.points.covariance_mm2)
    return np.array(error), np.concatenate(covariance)


def rmse_mm(error):
    return np.sqrt((error**2).mean(axis=0).sum())


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("solved", [True, False])
def test_the_error_in_units_of_the_covariance_is_that_of_three_coordinates(errors, way, solved):
    error, covariance = errors[way, solved]
    chi2 = np.einsum("ni,nij,nj->n", error, np.linalg.inv(covariance), error)
    assert 2.3 < chi2.mean() < 3.7


def test_eight_bits_come_under_a_thirtieth_of_a_millimetre(errors):
    with_shifts, without = (rmse_mm(errors[(8, "field"), solved][0]) for solved in (True, False))
    assert with_shifts < 0.033
    assert with_shifts < 0.8 * without


def test_one_bit_gains_a_little(errors):
    with_shifts, without = (rmse_mm(errors[(1, "field"), solved][0]) for solved in (True, False))
    assert with_shifts < without
