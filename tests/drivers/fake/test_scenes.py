"""What stands before the camera."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from grabberd_fake import SCENES, FakeOptions
from grabberd_fake.world import Scene, accuracy_object, build_scene, calibration_frame

POINTS = [
    {"id": 9, "x_mm": 1, "y_mm": 2, "z_mm": 3},
    {"id": 4, "x_mm": 0, "y_mm": 0, "z_mm": 0, "nx": 0.6, "nz": 0.6},
]


def scene_of(name: str, **options: Any) -> Scene:
    return build_scene(FakeOptions.read({"scene": name, **options}))


@pytest.mark.parametrize("name", SCENES)
def test_every_scene_has_ascending_ids_and_a_place_in_the_grid_for_each(name: str) -> None:
    scene = scene_of(name)
    count = len(scene.ids)
    assert (np.diff(scene.ids) > 0).all()
    assert len(set(zip(scene.row.tolist(), scene.column.tolist(), strict=True))) == count
    for targets in (scene.targets(0), scene.nominal()):
        assert targets.xyz_mm.shape == targets.normal.shape == (count, 3)
        assert_allclose(np.linalg.norm(targets.normal, axis=1), 1, atol=1e-9)


def test_the_calibration_frame_has_108_targets_with_depth() -> None:
    places = calibration_frame().nominal().xyz_mm
    assert len(places) == 108
    assert places[:, 2].max() >= 7.5
    assert places[:, 2].min() <= -7.5
    assert_allclose(places[:, :2].mean(axis=0), 0, atol=1e-12)
    centred = places - places.mean(axis=0)
    assert np.linalg.svd(centred, compute_uv=False)[2] / np.sqrt(108) > 3


@pytest.mark.parametrize(("down", "along"), [(1, 0), (0, 1), (-1, 0), (0, -1), (1, 1), (1, -1)])
def test_the_calibration_frame_does_not_resemble_itself_one_pitch_on(down: int, along: int) -> None:
    height = calibration_frame().nominal().xyz_mm[:, 2].reshape(12, 9)
    moved = np.roll(height, (down, along), (0, 1))[
        max(down, 0) : 12 + min(down, 0), max(along, 0) : 9 + min(along, 0)
    ]
    still = height[max(down, 0) : 12 + min(down, 0), max(along, 0) : 9 + min(along, 0)]
    assert np.sqrt(((moved - still) ** 2).mean()) > 3


def test_neighbours_on_the_calibration_frame_stay_apart_in_both_views() -> None:
    grid = calibration_frame().nominal().xyz_mm.reshape(12, 9, 3)
    for side in (-1, 1):
        seen_y = grid[:, :, 1] + side * grid[:, :, 2] * 64 / 240
        assert np.diff(seen_y, axis=1).min() > 3.5


def test_the_accuracy_object_is_another_body_within_the_frames_volume() -> None:
    frame, body = calibration_frame().nominal().xyz_mm, accuracy_object().nominal()
    assert len(body.xyz_mm) == 60
    assert (np.abs(body.xyz_mm[:, :2]) < np.abs(frame[:, :2]).max(axis=0)).all()
    assert np.abs(body.xyz_mm[:, 2]).max() < 10
    nearest = np.linalg.norm(frame[:, np.newaxis] - body.xyz_mm, axis=2).min(axis=0)
    assert np.median(nearest) > 1.5
    assert body.normal[:, 2].min() > 0.8


def test_the_accuracy_objects_normals_are_those_of_its_surface() -> None:
    body = accuracy_object().nominal()
    x, y, _ = body.xyz_mm.T
    slope = -body.normal[:, :2] / body.normal[:, 2:]
    assert_allclose(slope, np.column_stack([-x / 200, y / 30]), atol=1e-5)


def test_ones_own_points_are_sorted_and_their_normals_made_units() -> None:
    scene = scene_of("points", points=POINTS)
    assert scene.ids.tolist() == [4, 9]
    assert_allclose(scene.targets(7).xyz_mm, [[0, 0, 0], [1, 2, 3]])
    assert_allclose(scene.targets(7).normal, [[0.5**0.5, 0, 0.5**0.5], [0, 0, 1]])


def test_a_blank_scene_has_nothing() -> None:
    assert len(scene_of("blank").ids) == 0


def test_only_liner_and_ellipse_move() -> None:
    assert [name for name in SCENES if scene_of(name).moves] == ["liner", "ellipse"]
