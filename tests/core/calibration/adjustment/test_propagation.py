from dataclasses import replace

import numpy as np
import pytest

from core.calibration.networks import THREE, TRUE, frame, network
from grabberd.core.calibration.adjustment.adjustment import adjust, intersect_network, propagate
from grabberd.core.calibration.adjustment.network import Unknowns
from grabberd.core.geometry import Calibration, Rig
from grabberd.core.reconstruction import ImageNoise, ViewBlobs, intersect
from grabberd.errors import MeasurementError

SMALL = frame(5, 4)
COVARIANCE = adjust(network(), Unknowns.of(TRUE, tied=True)).parameter_covariance


def test_pictures_of_any_number_of_views_give_the_places_back():
    for views in (TRUE, THREE):
        given = replace(network(views, SMALL, seed=None), target_mm=SMALL + 1.5)
        assert np.abs(intersect_network(given) - SMALL).max() < 1e-5


def test_two_views_give_what_the_measurement_gives():
    given = network(places=SMALL)
    calibration = Calibration("c", "2026-01-02T03:04:05+00:00", "a test", 720, 576, *TRUE, COVARIANCE)
    blobs = [
        ViewBlobs(given.xy_px[given.view == side], given.sigma_px[given.view == side]) for side in (0, 1)
    ]
    ids = np.arange(1, len(SMALL) + 1, dtype=np.int32)
    points = intersect(Rig.of(calibration), ids, *blobs, ImageNoise(0.0, 2, 2.9))
    ours = propagate(replace(given, target_mm=points.xyz_mm), COVARIANCE)
    assert np.abs(intersect_network(given) - points.xyz_mm).max() < 1e-4
    assert np.allclose(ours.pointing_mm2, points.covariance_mm2, rtol=1e-3, atol=1e-8)
    assert np.allclose(ours.calibration_mm2, points.calibration_covariance_mm2, rtol=1e-3, atol=1e-8)


def test_the_influence_is_the_derivative_of_the_places():
    given = network(places=SMALL, seed=None)
    influence = propagate(given, COVARIANCE).influence
    step = 1e-3
    moved = replace(TRUE[1], f_mm=TRUE[1].f_mm + step)
    shift = (intersect_network(given.starting_from((TRUE[0], moved))) - SMALL) / step
    assert np.allclose(influence[:, :, 18], shift, rtol=1e-2, atol=1e-2)


def test_more_views_make_it_better():
    two, three = (
        propagate(network(views, SMALL), np.zeros((18 * len(views),) * 2)).pointing_mm2
        for views in (TRUE, THREE)
    )
    assert (np.linalg.eigvalsh(two - three) > -1e-12).all()
    assert (two[:, 2, 2] > three[:, 2, 2]).all()


def test_a_target_in_one_view_has_no_place():
    lonely = network(places=SMALL).select(np.arange(40) != 7)
    with pytest.raises(MeasurementError, match="targets 7 have too few image points"):
        intersect_network(lonely)
    with pytest.raises(MeasurementError, match="targets 7"):
        propagate(lonely, COVARIANCE)
