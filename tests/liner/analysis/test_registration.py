"""Matching finds by how much a synthetic view has to be moved, and says when there is nothing to match."""

import numpy as np
import pytest

from core.geometry.rigs import calibration
from grabberd.core.field import Field
from grabberd.errors import AnalysisError
from grabberd_liner.analysis.camera import Camera, Raster
from grabberd_liner.analysis.synthetic import agreement, synthetic_view
from liner.analysis.exact import PITCH_MM, exact_surface
from liner.analysis.shapes import sheet

LEFT, RIGHT = Camera.both(calibration())
PARITY = 1
LINES = range(PARITY, 576, 2)


def raised(by_mm):
    def shape(u, v):
        jets = sheet(u, v)
        jets[:, 0, 2] += by_mm
        return jets

    return exact_surface(shape)


def picture(camera, moved_px=(0.0, 0.0), gain=1.0, noise=0.0, contrast=150.0):
    """Soft discs on the plane z = 0 at every target, taken by a camera whose pixels are moved."""
    raster = Raster(range(720), LINES)
    center, direction = camera.view.center_mm, camera.directions(raster.pixels() - moved_px)
    crossing = center - center[2] / direction[:, 2:] * direction
    away = (crossing[:, :2] + [0.5 * PITCH_MM, 0.5 * PITCH_MM] + PITCH_MM / 2) % PITCH_MM - PITCH_MM / 2
    disc = np.exp(-((away**2).sum(axis=1) / 1.1**2))
    grey = gain * (20 + contrast * disc) + noise * np.random.default_rng(4).normal(size=len(disc))
    return Field.intact(np.clip(np.round(grey), 0, 255).astype(np.uint8).reshape(raster.shape), PARITY)


def fit(surface, field):
    view = synthetic_view(surface, RIGHT, Raster(RIGHT.columns, LINES), LEFT, picture(LEFT))
    return agreement(surface, view, field)


def test_where_surface_and_cameras_are_right_nothing_is_moved():
    found = fit(exact_surface(sheet), picture(RIGHT))
    assert len(found.places) == 48
    assert np.abs(found.mean_px.value).max() < 0.005
    assert found.rms_grey < 3
    assert found.correlation > 0.995


@pytest.mark.parametrize("moved_px", [(0.4, 0.0), (-1.6, 0.7), (2.5, -2.0)])
def test_a_picture_that_has_moved_is_found_moved_by_that_much(moved_px):
    found = fit(exact_surface(sheet), picture(RIGHT, moved_px))
    assert np.abs(found.mean_px.value - moved_px).max() < 0.01
    assert np.abs(found.shift_px.value - moved_px).max() < 0.06


def test_other_light_does_not_move_it():
    found = fit(exact_surface(sheet), picture(RIGHT, gain=0.6))
    assert np.abs(found.mean_px.value).max() < 0.005
    assert found.rms_grey > 10


def test_a_surface_too_low_is_noticed_and_by_how_much():
    found = fit(raised(-0.5), picture(RIGHT))
    moved = (RIGHT.pixels(np.zeros((1, 3))) - RIGHT.pixels(np.array([[0, 0, -0.5]])))[0]
    seen = (LEFT.pixels(np.zeros((1, 3))) - LEFT.pixels(np.array([[0, 0, -0.5]])))[0]
    assert found.mean_px.value[0] == pytest.approx(moved[0] - seen[0], rel=0.05)
    assert abs(found.mean_px.value[0]) > 30 * found.mean_px.sigma[0]


def test_sigma_is_by_how_much_noise_scatters_the_shifts():
    found = fit(exact_surface(sheet), picture(RIGHT, noise=6.0))
    scatter = found.shift_px.value.std(axis=0)
    assert np.all(np.abs(np.log(scatter / np.sqrt((found.shift_px.sigma**2).mean(axis=0)))) < 0.4)
    assert (np.abs(found.mean_px.value) < 4 * found.mean_px.sigma).all()


def test_an_empty_picture_matches_nothing_and_says_so():
    blank = Field.intact(np.full((288, 720), 20, np.uint8), PARITY)
    with pytest.raises(AnalysisError, match="could be matched"):
        fit(exact_surface(sheet), blank)
