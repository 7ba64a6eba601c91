"""Images of targets that one view alone sees, from fields of the simulated grabber, against its truth."""

import numpy as np
import pytest

from core.chain.fake_scene import take_scene
from grabberd.core.chain.measure import single_view_images
from grabberd.core.geometry import Rig, project_all

FIELDS = 60
WAYS = [(1, "doubled"), (1, "field"), (8, "field")]


@pytest.fixture(scope="module")
def liner():
    """The liner on a teat for more than a cycle, before ideal mirrors."""
    return take_scene(FIELDS, rig={"mirror_error_px": 0.0})


def found_in(scene, bits, lines):
    """(n, images, points) of every field."""
    points = {one.n: one.points for one in scene.measured(bits, lines)}
    images = single_view_images(scene.packed(bits, lines), points, scene.setup)
    return [(n, one, points[n]) for n, one in images]


def off_px(scene, n, images):
    """(N, 2) images less where the true targets appear."""
    rig = Rig.of(scene.setup.calibration)
    of_field = scene.truth.n == n
    places = scene.truth.xyz_mm[of_field][np.searchsorted(scene.truth.target[of_field], images.target)]
    return images.image_px - project_all(rig, places)[:, images.view, np.arange(len(images))].T


@pytest.mark.parametrize(("bits", "lines"), WAYS)
def test_what_one_view_alone_sees_is_found_under_its_own_id(liner, bits, lines):
    seen = found_in(liner, bits, lines)
    worst = max(np.abs(off_px(liner, n, images)).max() for n, images, _ in seen)
    assert worst < 1.5
    hidden = sum((~liner.truth.expected[liner.truth.n == n]).sum() for n, _, _ in seen)
    assert sum(len(images) for _, images, _ in seen) > 0.95 * hidden


@pytest.mark.parametrize(("bits", "lines"), WAYS)
def test_sigma_says_how_far_an_image_is_off(liner, bits, lines):
    seen = found_in(liner, bits, lines)
    ratio = np.concatenate([off_px(liner, n, images) / images.sigma_px for n, images, _ in seen])
    assert 0.6 < np.mean(ratio**2) < 1.5


def test_no_target_has_both_a_point_and_a_single_image(liner):
    for _, images, points in found_in(liner, 8, "field"):
        assert not np.isin(images.target, points.target).any()


def test_a_field_without_points_is_left_out(liner):
    points = {one.n: one.points for one in liner.measured(8, "field")}
    del points[3]
    found = dict(single_view_images(liner.packed(8, "field"), points, liner.setup))
    assert set(found) == set(range(FIELDS)) - {3}
