"""The camera and its mirrors."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from grabberd_fake import FakeOptions
from grabberd_fake.__main__ import calibration_document
from grabberd_fake.optics import Array, Camera, Mirror, build_views
from grabberd_fake.options import CameraOptions

PLAIN = CameraOptions(x0_px=360.0, y0_px=288.0, radial=(0.0, 0.0, 0.0), decentering=(0.0, 0.0))
small = st.floats(-50, 50, allow_nan=False)


def seen_by(camera: Camera, xyz_mm: Array) -> Array:
    """Sensor pixels of points (N, 3) in the object's frame."""
    return camera.to_pixels(camera.axes @ (xyz_mm - camera.center_mm).T)


def inside_the_volume(count: int = 200) -> Array:
    return np.random.default_rng(5).uniform([-60, -30, -20], [60, 30, 20], (count, 3))


@given(st.tuples(small, small, small), st.tuples(small, small, small), small)
def test_reflecting_twice_leads_back(
    point: tuple[float, ...], normal: tuple[float, ...], away: float
) -> None:
    direction = np.array(normal) + np.array([0.0, 0.0, 200.0])
    mirror = Mirror.through(np.array([away, 0.0, 0.0]), direction)
    assert_allclose(mirror.reflect(mirror.reflect(np.array(point))), point, atol=1e-9)


def test_a_mirror_leaves_its_own_points_where_they_are() -> None:
    mirror = Mirror.through(np.array([1.0, 2.0, 3.0]), np.array([0.0, 3.0, 4.0]))
    assert_allclose(
        mirror.reflect(np.array([[7.0, 2.0, 3.0], [0.0, 6.0, 0.0]])),
        [[7.0, 2.0, 3.0], [0.0, 6.0, 0.0]],
        atol=1e-12,
    )


def test_a_pinhole_shows_the_right_of_its_x_axis_to_the_right_and_the_top_of_its_y_axis_above() -> None:
    camera = Camera(PLAIN, np.zeros(3), np.eye(3))
    image = seen_by(camera, np.array([[0.0, 0.0, -100.0], [10.0, 0.0, -100.0], [0.0, 10.0, -100.0]]))
    assert_allclose(image, [[360, 288], [360 + 0.8 / 0.0086, 288], [360, 288 - 0.8 / 0.0083]])


def test_what_is_behind_the_camera_has_no_image() -> None:
    camera = Camera(PLAIN, np.zeros(3), np.eye(3))
    assert np.isnan(seen_by(camera, np.array([[1.0, 1.0, 5.0], [0.0, 0.0, 0.0]]))).all()


def test_barrel_distortion_draws_the_corners_inwards() -> None:
    barrel = CameraOptions(x0_px=360.0, y0_px=288.0, radial=(-7e-4, 0.0, 0.0), decentering=(0.0, 0.0))
    corner = np.array([[35.0, 0.0, -100.0]])
    plain, drawn = (seen_by(Camera(o, np.zeros(3), np.eye(3)), corner)[0, 0] - 360 for o in (PLAIN, barrel))
    assert_allclose(drawn, plain * (1 - 7e-4 * 2.8**2))


def test_decentering_adds_three_times_as_much_along_as_across() -> None:
    lens = CameraOptions(x0_px=360.0, y0_px=288.0, radial=(0.0, 0.0, 0.0), decentering=(1e-4, 0.0))
    points = np.array([[25.0, 0.0, -100.0], [0.0, 25.0, -100.0]])
    drawn, plain = (seen_by(Camera(o, np.zeros(3), np.eye(3)), points) for o in (lens, PLAIN))
    moved = drawn - plain
    assert_allclose(moved[:, 0] * 0.0086, [3e-4 * 4, 1e-4 * 4], atol=1e-12)


def virtual_projection(view: dict[str, object], xyz_mm: Array) -> Array:
    """The functional model as the reference states it, written down here once more."""
    omega, phi, kappa = (float(view[f"{name}_rad"]) for name in ("omega", "phi", "kappa"))  # type: ignore[arg-type]
    about_x = [[1, 0, 0], [0, np.cos(omega), np.sin(omega)], [0, -np.sin(omega), np.cos(omega)]]
    about_y = [[np.cos(phi), 0, -np.sin(phi)], [0, 1, 0], [np.sin(phi), 0, np.cos(phi)]]
    about_z = [[np.cos(kappa), np.sin(kappa), 0], [-np.sin(kappa), np.cos(kappa), 0], [0, 0, 1]]
    turn = np.diag([view["handedness"], 1, 1]) @ np.array(about_z) @ np.array(about_y) @ np.array(about_x)
    x, y, z = turn @ (xyz_mm - [view["X0_mm"], view["Y0_mm"], view["Z0_mm"]]).T
    x, y = -view["f_mm"] * x / z, -view["f_mm"] * y / z  # type: ignore[operator]
    b = [0.0, *view["b"]]  # type: ignore[misc]
    r2 = x * x + y * y
    radial = b[3] * r2 + b[4] * r2**2 + b[5] * r2**3
    dx = -b[1] * x + b[2] * y + x * radial + b[6] * (r2 + 2 * x * x) + 2 * b[7] * x * y - b[8] * x * y * y
    dy = b[1] * y + b[2] * x + y * radial + 2 * b[6] * x * y + b[7] * (r2 + 2 * y * y) - b[9] * x * x * y
    return np.column_stack(
        [view["x0_px"] + (x + dx) / view["pixel_x_mm"], view["y0_px"] - (y + dy) / view["pixel_y_mm"]]
    )


@pytest.mark.parametrize("reflections", [1, 2])
@pytest.mark.parametrize("integration", [True, False])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_the_calibration_of_the_virtual_cameras_agrees_with_reflected_rays(
    reflections: int, integration: bool, seed: int
) -> None:
    options = FakeOptions.read(
        {"rig": {"reflections": reflections, "seed": seed}, "picture": {"field_integration": integration}}
    )
    views = calibration_document(options)["views"]
    points = inside_the_volume()
    for view in build_views(options):
        assert_allclose(view.ideal_image(points), virtual_projection(views[view.name], points), atol=1e-9)
        assert views[view.name]["handedness"] == (-1 if reflections == 1 else 1)


def test_the_picture_is_that_of_points_reflected_one_mirror_after_another() -> None:
    for view in build_views(FakeOptions()):
        points = inside_the_volume()
        sensor = seen_by(view.camera, view.reflected(points))
        assert_allclose(view.ideal_image(points), sensor + np.array([0.0, -0.5]), atol=1e-9)


def test_field_integration_puts_every_target_half_a_line_higher() -> None:
    fields, lines = (
        build_views(FakeOptions.read({"picture": {"field_integration": on}}))[0] for on in (True, False)
    )
    points = inside_the_volume()
    assert_allclose(lines.ideal_image(points) - fields.ideal_image(points), np.tile([0.0, 0.5], (200, 1)))


def test_a_view_holds_its_own_half_only() -> None:
    left, right = build_views(FakeOptions())
    places = np.array(
        [[-0.6, 9], [-0.4, 9], [359.4, 9], [359.6, 9], [719.4, 9], [719.6, 9], [9, -1], [9, 576], [np.nan, 9]]
    )
    assert left.holds(places).tolist() == [False, True, True, False, False, False, False, False, False]
    assert right.holds(places).tolist() == [False, False, False, True, True, False, False, False, False]
