"""Pictures of discs."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from grabberd_fake import FakeOptions
from grabberd_fake.optics import Array, Ellipses, Targets, build_views, disc_images, facing, smeared

LEFT, RIGHT = build_views(FakeOptions.read({"rig": {"mirror_error_px": 0}}))


def tilted(count: int = 60) -> Targets:
    rng = np.random.default_rng(3)
    normal = rng.normal(0, 0.4, (count, 3)) + np.array([0, 0, 1])
    places = rng.uniform([-50, -20, -10], [50, 20, 10], (count, 3))
    return Targets(places, normal / np.linalg.norm(normal, axis=1, keepdims=True))


def rim(targets: Targets, radius_mm: float, count: int = 720) -> Array:
    """(N, count, 3) points of the discs' boundaries, from the definition of a circle in space."""
    angle = np.arange(count) * (2 * np.pi / count)
    first = np.cross(targets.normal, [0.0, 1.0, 0.0])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(targets.normal, first)
    around = (
        np.cos(angle)[:, np.newaxis] * first[:, np.newaxis]
        + np.sin(angle)[:, np.newaxis] * second[:, np.newaxis]
    )
    return targets.xyz_mm[:, np.newaxis] + radius_mm * around


@pytest.mark.parametrize("view", [LEFT, RIGHT], ids=["left", "right"])
def test_an_ellipse_is_the_picture_of_the_discs_boundary(view: object) -> None:
    targets = tilted()
    images = disc_images(view, targets, 1.5)  # type: ignore[arg-type]
    boundary = view.ideal_image(rim(targets, 0.75).reshape(-1, 3)).reshape(60, -1, 2)  # type: ignore[attr-defined]
    frames = np.stack([images.a, images.b], axis=2)
    along = np.linalg.solve(frames, (boundary - images.center[:, np.newaxis]).transpose(0, 2, 1))
    assert_allclose(np.hypot(along[:, 0], along[:, 1]), 1, atol=1.5e-3)


def test_the_centre_is_the_centroid_of_the_picture_not_the_picture_of_the_centre() -> None:
    targets = tilted()
    images = disc_images(LEFT, targets, 5.0)
    outline = LEFT.ideal_image(rim(targets, 2.5).reshape(-1, 3)).reshape(60, -1, 2)
    x, y = outline[:, :, 0], outline[:, :, 1]
    cross = x * np.roll(y, -1, 1) - np.roll(x, -1, 1) * y
    area6 = 3 * cross.sum(axis=1)
    centroid = np.stack([((v + np.roll(v, -1, 1)) * cross).sum(axis=1) / area6 for v in (x, y)], axis=1)
    assert_allclose(images.center, centroid, atol=1.5e-3)
    assert np.abs(LEFT.ideal_image(targets.xyz_mm) - centroid).max() > 0.03


def test_a_disc_seen_face_on_at_the_reference_distance_is_about_five_pixels_wide() -> None:
    towards = LEFT.center_mm() / np.linalg.norm(LEFT.center_mm())
    images = disc_images(LEFT, Targets(np.zeros((1, 3)), towards[np.newaxis]), 1.5)
    width, height = 2 * np.hypot(images.a, images.b)[0]
    assert 5.2 < width < 6.2
    assert 5.4 < height < 6.4


def test_the_mirrors_local_error_moves_the_picture() -> None:
    uneven = build_views(FakeOptions.read({"rig": {"mirror_error_px": 0.5}}))[0]
    targets = tilted()
    moved = disc_images(uneven, targets, 1.5).center - disc_images(LEFT, targets, 1.5).center
    assert_allclose(moved, uneven.displacement(disc_images(LEFT, targets, 1.5).center), atol=1e-12)
    assert 0.3 < moved.std() < 0.7


def test_a_target_is_seen_up_to_the_grazing_limit_and_not_from_behind() -> None:
    towards = LEFT.center_mm() / np.linalg.norm(LEFT.center_mm())
    aside = np.cross(towards, [1.0, 0.0, 0.0])
    angles = np.radians([0, 64.9, 65.1, 120, 180])
    normal = np.multiply.outer(np.cos(angles), towards) + np.multiply.outer(np.sin(angles), aside)
    assert facing(LEFT, Targets(np.zeros((5, 3)), normal), 65.0).tolist() == [True, True, False, False, False]


def test_nothing_has_no_pictures() -> None:
    assert len(disc_images(LEFT, Targets(np.empty((0, 3)), np.empty((0, 3))), 1.5)) == 0


def ellipses(count: int = 3) -> Ellipses:
    one = np.ones((count, 2))
    return Ellipses(np.arange(2.0 * count).reshape(count, 2), one, one * [1, -1], np.ones(count))


def test_what_hardly_moves_is_drawn_once() -> None:
    still = ellipses()
    assert smeared(still, np.full((3, 2), -0.05), np.full((3, 2), 0.05), 0.25) is still


def test_what_moves_is_drawn_as_often_as_its_way_needs_and_keeps_its_light() -> None:
    start, end = np.array([[0.0, 0], [-0.5, 0], [0, 0]]), np.array([[0.0, 0], [0.5, 0], [0, 0.1]])
    copies = smeared(ellipses(), start, end, 0.25)
    assert len(copies) == 1 + 4 + 1
    assert_allclose(copies.weight, [1, 0.25, 0.25, 0.25, 0.25, 1])
    assert_allclose(copies.center[1:5, 0], 2 + np.array([-0.375, -0.125, 0.125, 0.375]))


def test_a_way_that_accelerates_is_a_parabola() -> None:
    start, end = np.full((1, 2), -1.0), np.full((1, 2), 3.0)
    copies = smeared(ellipses(1), start, end, 0.01)
    time = np.linspace(-1, 1, len(copies) * 2 + 1)[1::2]
    assert_allclose(copies.center[:, 0], 2 * time + time**2, atol=1e-12)
