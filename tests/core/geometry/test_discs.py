"""The middle of a disc's picture, beside closed forms that share nothing with it, and a lens of OpenCV's."""

import cv2
import numpy as np
import pytest
from tests.core.chain.pinhole_pictures import Camera, Optics

from grabberd.core.geometry import Discs, Rig, View, linearise, project_all

PIXEL_MM, FOCAL_MM, AWAY_MM, DIAMETER_MM = 0.009, 8.0, 240.0, 1.5
"""A pixel is .27 mm on the object."""


def view(handedness=1, **angles):
    turn = {"omega_rad": 0.0, "phi_rad": 0.0, "kappa_rad": 0.0, **angles}
    place = {"X0_mm": 0.0, "Y0_mm": 0.0, "Z0_mm": AWAY_MM}
    half = {"first_column": 0, "end_column": 720, "pixel_x_mm": PIXEL_MM, "pixel_y_mm": PIXEL_MM}
    middle = {"f_mm": FOCAL_MM, "x0_px": 360.0, "y0_px": 288.0}
    return View(name="left", handedness=handedness, **half, **middle, **turn, **place)


def offsets(rig, xyz, normal):
    """(N, 2) in a rig of one view."""
    _, slopes = linearise(rig, xyz)
    return Discs(normal, DIAMETER_MM).offsets_px(rig, xyz, slopes)[:, 0].T


def middle_by_conics(rig, centre, normal):
    """(2,) middle of a disc's picture: the circle as a dual conic, carried into the picture whole."""
    first = np.cross(normal, (0.3, -0.5, 0.8))
    first /= np.linalg.norm(first)
    one = rig.views[0]
    camera = np.diag([1.0, -1.0, -1.0]) @ one.axes
    lens = np.array([[FOCAL_MM / PIXEL_MM, 0, one.x0_px], [0, FOCAL_MM / PIXEL_MM, one.y0_px], [0, 0, 1.0]])
    plane = np.column_stack([first, np.cross(normal, first), centre - one.center_mm])
    homography = lens @ camera @ plane
    dual = homography @ np.diag([DIAMETER_MM**2 / 4, DIAMETER_MM**2 / 4, -1.0]) @ homography.T
    return dual[:2, 2] / dual[2, 2]


@pytest.mark.parametrize("handedness", [1, -1])
def test_it_is_the_centre_of_the_circles_projected_conic(handedness):
    rng = np.random.default_rng(3)
    rig = Rig.of_views([view(handedness, omega_rad=0.2, phi_rad=-0.3, kappa_rad=1.1)])
    xyz = rng.uniform(-30, 30, (50, 3))
    normal = rng.normal(size=(50, 3))
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    exact = [middle_by_conics(rig, *one) for one in zip(xyz, normal, strict=True)]
    assert np.ptp(offsets(rig, xyz, normal)) > 0.003
    middles = project_all(rig, xyz)[:, 0].T + offsets(rig, xyz, normal)
    np.testing.assert_allclose(middles, exact, atol=2e-7)


def leaning(tilt_deg):
    tilt = np.deg2rad(tilt_deg)
    return np.column_stack([np.sin(tilt), 0.0 * tilt, np.cos(tilt)])


def test_on_the_axis_it_is_greatest_at_45_degrees_of_tilt_and_then_43_ten_thousandths_of_a_pixel():
    tilt_deg = np.arange(0.0, 86.0)
    offset = np.linalg.norm(offsets(Rig.of_views([view()]), np.zeros((86, 3)), leaning(tilt_deg)), axis=1)
    assert tilt_deg[offset.argmax()] == 45.0
    assert offset.max() == pytest.approx(0.00434, abs=5e-5)
    assert offset[0] == 0.0


def test_it_grows_to_six_thousandths_at_20_degrees_off_the_axis():
    xyz = np.tile([AWAY_MM * np.tan(np.deg2rad(20)), 0.0, 0.0], (171, 1))
    offset = offsets(Rig.of_views([view()]), xyz, leaning(np.arange(-85.0, 86.0)))
    assert np.linalg.norm(offset, axis=1).max() == pytest.approx(0.0060, abs=5e-4)


def test_either_side_of_a_disc_gives_the_same():
    rig, normal = Rig.of_views([view()]), leaning(np.array([30.0]))
    np.testing.assert_array_equal(
        offsets(rig, np.zeros((1, 3)), normal), offsets(rig, np.zeros((1, 3)), -normal)
    )


def test_what_a_lens_bends_across_a_disc_is_less_than_half_a_thousandth_of_a_pixel():
    """The rim of a disc by OpenCV's own lens; its middle beside that of the same disc without one."""
    beyond = []
    for seed in range(4):
        bent = Camera("left", optics=Optics.drawn(seed))
        straight = Camera("left", optics=Optics.drawn(seed))
        straight.lens = np.zeros(5)
        for centre in np.mgrid[-45:46:30, -20:21:20].reshape(2, -1).T:
            xyz = np.array([*centre, 0.0])
            moved = [_middle(one, xyz) - one.project(xyz[np.newaxis])[0] for one in (bent, straight)]
            beyond.append(moved[0] - moved[1])
    assert 1e-4 < np.abs(beyond).max() < 5e-4


def _middle(camera, xyz):
    angle = np.linspace(0, 2 * np.pi, 360, endpoint=False)
    rim = xyz + DIAMETER_MM / 2 * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    seen = (camera.project(rim) - camera.project(xyz[np.newaxis])).astype(np.float64)
    moments = cv2.moments((1000.0 * seen).astype(np.float32))
    middle = np.array([moments["m10"], moments["m01"]]) / moments["m00"] / 1000.0
    return middle + camera.project(xyz[np.newaxis])[0]
