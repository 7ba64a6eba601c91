from dataclasses import replace

import numpy as np
import pytest

from core.calibration.networks import THREE, TRUE, frame, network, tied
from grabberd.core.calibration.adjustment.adjustment import adjust, intersect_network
from grabberd.core.calibration.validity import volume_sigma
from grabberd.core.geometry import LocalField

ADJUSTED = adjust(network(), tied())


def test_the_grid_fills_the_frame_in_planes_of_z():
    volume = volume_sigma(ADJUSTED, shape=(3, 5, 4))
    assert volume.xyz_mm.shape == (3, 5, 4, 3)
    places = volume.xyz_mm.reshape(-1, 3)
    assert np.allclose(places.min(axis=0), frame().min(axis=0))
    assert np.allclose(places.max(axis=0), frame().max(axis=0))
    assert np.ptp(volume.xyz_mm[1, :, :, 2]) == 0
    assert np.ptp(volume.xyz_mm[:, 2, :, 0]) == 0


def test_depth_is_the_worst_and_the_calibration_counts_least():
    volume = volume_sigma(ADJUSTED)
    sigma, share = volume.sigma_mm, volume.calibration_sigma_mm
    assert (sigma[..., 2] > sigma[..., 0]).all()
    assert (share < sigma).all()
    assert np.median(share[..., 2]) < 0.5 * np.median(sigma[..., 2])


def test_the_calibration_is_known_best_in_the_middle():
    share = volume_sigma(ADJUSTED, shape=(3, 11, 9)).calibration_sigma_mm[1, :, :, 2]
    assert share[5, 4] < share[0, 0]
    assert share[5, 4] < share[-1, -1]


def test_the_predicted_sigma_is_that_of_repeated_calibrations_and_measurements():
    volume = volume_sigma(ADJUSTED, sigma_px=(0.05, 0.05), shape=(2, 3, 2))
    places = volume.xyz_mm.reshape(-1, 3)
    errors = []
    for seed in range(80):
        views = adjust(network(seed=seed), tied()).views
        seen = network(places=places, seed=1000 + seed).starting_from(views)
        errors.append(intersect_network(replace(seen, target_mm=places)) - places)
    measured = np.sqrt(np.mean(np.square(errors), axis=(0, 1)))
    predicted = np.sqrt(np.mean(volume.sigma_mm**2, axis=(0, 1, 2)))
    assert measured == pytest.approx(predicted, rel=0.12)


def test_pointing_in_x_and_y_may_differ():
    even, odd = (volume_sigma(ADJUSTED, sigma_px=sigma) for sigma in ((0.05, 0.05), (0.1, 0.05)))
    ratio = np.sqrt(odd.pointing_mm2[..., 2, 2] / even.pointing_mm2[..., 2, 2])
    assert np.median(ratio) == pytest.approx(2.0, abs=0.1)


def test_what_fewer_than_two_views_see_has_no_sigma():
    wide = replace(ADJUSTED, xyz_mm=ADJUSTED.xyz_mm * [1.0, 4.0, 1.0])
    sigma = volume_sigma(wide, shape=(1, 3, 9)).sigma_mm
    assert np.isnan(sigma[:, :, [0, -1]]).all()
    assert np.isfinite(sigma[:, 1, 4]).all()


def test_a_third_view_helps():
    three = volume_sigma(adjust(network(THREE), tied(THREE)), sigma_px=(0.05, 0.05))
    two = volume_sigma(ADJUSTED, sigma_px=(0.05, 0.05))
    assert np.nanmedian(three.sigma_mm[..., 2]) < np.nanmedian(two.sigma_mm[..., 2])


def test_the_sigma_of_the_pictures_is_taken_from_the_calibration():
    same = ADJUSTED.sigma0 * 0.05
    own, given = volume_sigma(ADJUSTED), volume_sigma(ADJUSTED, (same, same))
    assert np.allclose(own.pointing_mm2, given.pointing_mm2, equal_nan=True)
    assert TRUE[0].name == "left"


def test_what_the_local_fields_leave_is_part_of_the_calibrations_share():
    flat = np.full((41, 50, 2), 0.05)
    local_field = LocalField.through((-0.5, -0.5), 15.0, 0 * flat, flat)
    plain = volume_sigma(ADJUSTED, sigma_px=(0.05, 0.05))
    both = volume_sigma(ADJUSTED, sigma_px=(0.05, 0.05), local_fields=(local_field, local_field))
    assert np.allclose(both.calibration_mm2, plain.calibration_mm2 + plain.pointing_mm2, equal_nan=True)
