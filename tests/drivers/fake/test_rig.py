"""Where camera and mirrors stand."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from grabberd_fake import FakeOptions
from grabberd_fake.optics import View, build_views, knocked
from grabberd_fake.world import World

PERFECT = {
    "mirror_tilt_mrad": 0,
    "mirror_shift_mm": 0,
    "camera_tilt_mrad": 0,
    "camera_shift_mm": 0,
    "mirror_error_px": 0,
}
SYMMETRIC = {"x0_px": 359.5, "y0_px": 287.5, "radial": [0, 0, 0], "decentering": [0, 0]}


def views_of(**rig: Any) -> tuple[View, View]:
    return build_views(FakeOptions.read({"rig": rig}))


def perfect(reflections: int, **rig: Any) -> tuple[View, View]:
    options = {"rig": {**PERFECT, "reflections": reflections, **rig}, "camera": SYMMETRIC}
    return build_views(FakeOptions.read(options))


@pytest.mark.parametrize("reflections", [1, 2])
@pytest.mark.parametrize(("base", "distance"), [(128.0, 240.0), (90.0, 300.0)])
def test_the_nominal_rig_has_its_base_and_distance(reflections: int, base: float, distance: float) -> None:
    left, right = perfect(reflections, base_mm=base, distance_mm=distance)
    assert_allclose(left.center_mm(), [0, -base / 2, distance], atol=1e-9)
    assert_allclose(right.center_mm(), [0, base / 2, distance], atol=1e-9)


@pytest.mark.parametrize("reflections", [1, 2])
def test_the_middle_of_each_half_looks_at_the_origin(reflections: int) -> None:
    for view, middle in zip(perfect(reflections), (179.5, 539.5), strict=True):
        assert_allclose(view.ideal_image(np.zeros((1, 3))), [[middle, 287.0]], atol=1e-6)


@pytest.mark.parametrize("reflections", [1, 2])
def test_an_odd_number_of_mirrors_makes_a_left_handed_view(reflections: int) -> None:
    for view in views_of(reflections=reflections):
        assert len(view.mirrors) == reflections
        assert_allclose(np.linalg.det(view.axes()), (-1) ** reflections)


@pytest.mark.parametrize(("reflections", "rightwards"), [(2, 1), (1, -1)])
def test_x_runs_down_the_picture_and_y_to_the_right_unless_mirrored(
    reflections: int, rightwards: int
) -> None:
    for view in views_of(reflections=reflections):
        origin, along_x, along_y = view.image(np.array([[0.0, 0, 0], [10, 0, 0], [0, 10, 0]]))
        assert along_x[1] - origin[1] == pytest.approx(10 / 248 * 8 / 0.0083, rel=0.05)
        assert abs(along_x[0] - origin[0]) < 2
        assert (along_y[0] - origin[0]) * rightwards == pytest.approx(10 * 0.966 / 248 * 8 / 0.0086, rel=0.05)


@pytest.mark.parametrize("reflections", [1, 2])
def test_light_meets_the_outer_mirror_before_the_inner_one_and_the_camera_last(reflections: int) -> None:
    for view in perfect(reflections):
        place, towards = np.zeros(3), view.center_mm()
        for number, mirror in enumerate(view.mirrors):
            direction = towards - place
            along = (mirror.distance_mm - mirror.normal @ place) / (mirror.normal @ direction)
            assert 0 < along < 1
            place = place + along * direction
            towards = mirror.reflect(towards)
            assert (abs(place[1]) > 25) == (number == 0)
        assert_allclose(towards, view.camera.center_mm, atol=1e-9)
        assert view.camera.center_mm[2] > place[2]


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("reflections", [1, 2])
def test_a_misaligned_rig_stays_within_ten_per_cent_of_its_nominal_geometry(
    seed: int, reflections: int
) -> None:
    left, right = views_of(seed=seed, reflections=reflections)
    base = right.center_mm() - left.center_mm()
    assert base[1] == pytest.approx(128, rel=0.05)
    for view in (left, right):
        assert view.center_mm()[2] == pytest.approx(240, rel=0.05)
        assert np.abs(view.image(np.zeros((1, 3)))[0] - [view.first_column + 179.5, 287]).max() < 36


def test_the_two_views_of_one_rig_differ_and_so_do_rigs_of_other_seeds() -> None:
    left, right = views_of(seed=1)
    assert abs(left.center_mm()[1] + right.center_mm()[1]) > 0.01
    assert not np.allclose(left.center_mm(), views_of(seed=2)[0].center_mm(), atol=0.01)
    assert_allclose(left.center_mm(), views_of(seed=1)[0].center_mm(), atol=0)


def test_the_local_error_has_its_size_and_no_mean_over_each_half() -> None:
    for view in views_of(mirror_error_px=0.4):
        x, y = np.meshgrid(np.arange(view.first_column, view.first_column + 360, 5.0), np.arange(0, 576, 5.0))
        error = view.displacement(np.column_stack([x.ravel(), y.ravel()]))
        assert_allclose(error.std(axis=0), 0.4, rtol=0.02)
        assert_allclose(error.mean(axis=0), 0, atol=0.01)


def test_the_local_error_is_smooth_and_another_in_each_view() -> None:
    left, right = views_of(mirror_error_px=0.06)
    line = np.column_stack([np.arange(0, 360.0), np.full(360, 200.0)])
    error = left.displacement(line)
    assert np.abs(np.diff(error, axis=0)).max() < 0.06 * 0.35
    assert np.abs(error - right.displacement(line + np.array([360, 0]))).max() > 0.03


def test_without_a_local_error_the_image_is_the_ideal_one() -> None:
    view = views_of(mirror_error_px=0)[0]
    points = np.array([[0.0, 1.0, 2.0], [30.0, -9.0, 4.0]])
    assert_allclose(view.image(points), view.ideal_image(points), atol=0)


ORIGIN = np.zeros((1, 3))


def test_a_knocked_camera_shifts_the_images_of_both_views_alike() -> None:
    before = perfect(2)
    after = knocked(before, "camera", (1.0, 0.0, 0.0))
    for view, moved in zip(before, after, strict=True):
        shift = moved.image(ORIGIN) - view.image(ORIGIN)
        # 1 mrad of 8 mm is .96 lines of .0083 mm, and a little more away from the axis.
        assert_allclose(np.abs(shift), [[0.0, 0.964]], atol=0.02)
        assert_allclose(np.sign(shift[0, 1]), np.sign(after[0].image(ORIGIN) - before[0].image(ORIGIN))[0, 1])


def test_a_knocked_mirror_moves_its_own_view_by_twice_its_turn_and_the_other_not_at_all() -> None:
    before = perfect(2)
    left, right = knocked(before, "left", (0.0, 0.5, 0.0))
    assert right is before[1]
    shift = left.image(ORIGIN) - before[0].image(ORIGIN)
    assert abs(shift[0, 0]) > 0.3
    assert abs(shift[0, 1]) < 0.02


def test_marks_and_knocks_are_in_the_picture_and_not_in_the_truth() -> None:
    mark = {"id": 900, "x_mm": 60, "y_mm": 36, "z_mm": 0}
    knock = {"kind": "knock", "at_field": 2, "what": "camera", "x_mrad": 2.0}
    options = {"scene": "blank", "rig": {"marks": [mark]}, "picture": {"noise": 0, "jitter_px": 0}}
    world = World(FakeOptions.read({**options, "faults": [knock]}))
    pictures = np.empty((3, 288, 720), np.uint8)
    for field, picture in enumerate(pictures):
        world.picture(field, picture)
    rows = np.arange(0, 288)
    lines = [
        float((one[60:].sum(axis=1) @ rows[60:]) / one[60:].sum()) for one in pictures.astype(float) - 20
    ]
    assert abs(lines[2] - lines[0]) > 0.5
    assert len(world.truth(0).ids) == 0
