import numpy as np
import pytest

from core.geometry.rigs import calibration
from core.reconstruction.liners import model, see, wall
from grabberd.core.geometry import Rig, project
from grabberd.core.reconstruction import Correspondence, ImageNoise, Points, SingleViewSearch, ViewBlobs

MODEL = model()
RIG = Rig.of(calibration())
CORRESPONDENCE = Correspondence(RIG, MODEL, ImageNoise.of(RIG, MODEL, 0.0, 2))
SEARCH = SingleViewSearch(CORRESPONDENCE)


def scene(deflection_mm, seed=0, **changes):
    return see(*wall(deflection_mm), np.random.default_rng(seed), **changes)


def searched(seen):
    return SEARCH.images(CORRESPONDENCE.identify(seen.left, seen.right).points, seen.left, seen.right)


def alone(seen):
    """Targets with a blob in one view only, with that view."""
    left, right = set(seen.left_is.tolist()) - {-1}, set(seen.right_is.tolist()) - {-1}
    return dict.fromkeys(left - right, 0) | dict.fromkeys(right - left, 1)


def identity(seen, found):
    """Which target each image that was found is of; −1 for a false blob."""
    views = ((seen.left, seen.left_is), (seen.right, seen.right_is))
    of = []
    for view, image_px in zip(found.view, found.image_px, strict=True):
        blobs, is_ = views[view]
        of.append(is_[np.flatnonzero((blobs.xy_px == image_px).all(axis=1))[0]])
    return np.array(of, int)


@pytest.mark.parametrize("deflection_mm", [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
def test_the_outermost_columns_are_identified_in_the_one_view_that_sees_them(deflection_mm):
    seen = scene(deflection_mm, noise=0.1, missing=0.0, false=0.0)
    found = searched(seen)
    expected = alone(seen)
    assert len(expected) > 10
    assert {int(t) - 1: int(v) for t, v in zip(found.target, found.view, strict=True)} == expected
    assert (identity(seen, found) == found.target - 1).all()


def test_none_is_taken_for_another_with_noise_missing_targets_and_false_blobs():
    right = false = wrong = there = 0
    for seed in range(40):
        seen = scene((0.0, 2.0, 4.0, 6.0)[seed % 4], seed)
        found = searched(seen)
        of = identity(seen, found)
        right += (of == found.target - 1).sum()
        false += (of < 0).sum()
        wrong += ((of >= 0) & (of != found.target - 1)).sum()
        there += len(alone(seen))
    assert wrong == 0
    assert false <= 0.01 * right
    assert right >= 0.9 * there


def test_a_target_with_a_blob_in_both_views_but_no_point_is_left_out():
    seen = scene(0.0, noise=0.1, missing=0.0, false=0.0)
    points = CORRESPONDENCE.identify(seen.left, seen.right).points
    without = points.select(points.target != 50)
    assert 50 not in SEARCH.images(without, seen.left, seen.right).target


def test_images_carry_the_sigma_of_their_lines():
    places, _ = wall(0.0)
    seen = np.isin(np.arange(108) % 6, (1, 2, 3, 4))
    blobs = [
        ViewBlobs(project(view, places), np.full((108, 2), 0.1), np.full(108, 0.07), 3.0).select(seen)
        for view in RIG.views
    ]
    left = blobs[0].select(np.flatnonzero(seen) != 40)
    points = CORRESPONDENCE.identify(left, blobs[1]).points
    found = SEARCH.images(points, left, blobs[1])
    assert found.target.tolist() == [41]
    assert found.view.tolist() == [1]
    assert found.sigma_px == pytest.approx(np.array([[np.hypot(0.1, 0.07), 0.1]]))


def test_without_points_there_are_no_images():
    seen = scene(0.0)
    assert len(SEARCH.images(Points.none(), seen.left, seen.right)) == 0
