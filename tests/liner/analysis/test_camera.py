"""A camera sees a place where its ray goes, local field included; free cameras look where they are told."""

import numpy as np
import pytest

from core.geometry.rigs import calibration
from grabberd.core.geometry import LocalField
from grabberd_liner.analysis.camera import Camera, viewing_axes

CALIBRATION = calibration()
PLACES = np.random.default_rng(2).uniform([-50, -12, -8], [50, 12, 8], (40, 3))


def bent():
    random = np.random.default_rng(3)
    return LocalField.through((0.0, 0.0), 90.0, random.normal(size=(8, 9, 2)), np.full((8, 9, 2), 0.02))


@pytest.mark.parametrize("field", [None, bent()])
def test_the_ray_through_a_places_picture_goes_through_the_place(field):
    camera = Camera(CALIBRATION.left, field)
    away = PLACES - camera.view.center_mm
    unit = away / np.linalg.norm(away, axis=1, keepdims=True)
    assert np.abs(camera.directions(camera.pixels(PLACES)) - unit).max() < 1e-7


def test_a_local_field_shifts_the_picture_by_what_it_has_there():
    field = bent()
    plain, shifted = Camera(CALIBRATION.left).pixels(PLACES), Camera(CALIBRATION.left, field).pixels(PLACES)
    assert np.abs(shifted - plain - field.at(shifted)).max() < 1e-4


def test_from_above_x_is_to_the_right_and_y_up():
    right, up, toward = viewing_axes(-90, 90)
    assert np.allclose([right, up, toward], np.eye(3))


def test_a_free_camera_shows_what_it_looks_at_in_its_middle_and_upright():
    middle = np.array([3.0, -2.0, 4.0])
    camera = Camera.looking_at(CALIBRATION.left, middle, -60, 35, 400, 300)
    _, up, _ = viewing_axes(-60, 35)
    centre, above = camera.pixels(np.stack([middle, middle + up]))
    assert np.allclose(centre, [199.5, 149.5])
    assert above[0] == pytest.approx(199.5)
    assert above[1] < 149


def test_a_free_camera_can_be_filled_with_what_it_looks_at():
    camera = Camera.looking_at(CALIBRATION.left, np.zeros(3), 20, 50, 400, 300).filling(PLACES, 400, 300)
    pixels = camera.pixels(PLACES)
    assert (pixels > 0).all()
    assert (pixels < [399, 299]).all()
    assert np.ptp(pixels / [400, 300], axis=0).max() == pytest.approx(0.9)
