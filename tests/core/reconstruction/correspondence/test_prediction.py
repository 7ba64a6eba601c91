from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from core.geometry.rigs import calibration
from grabberd.core.geometry import Rig, project
from grabberd.core.reconstruction.correspondence.correspondence import Prediction, _of_all, _of_those_beside
from grabberd.core.reconstruction.points import Miss

RIG = Rig.of(calibration())
PLACES = np.array([[-20.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 6.5, 0.0]])


def predict(sigma_mm=0.5, places=PLACES, sigma_px=0.2):
    return Prediction.of(RIG, places, np.full(len(places), sigma_mm), sigma_px, gate=3.0)


def images(view=0, places=PLACES):
    return project(calibration().views[view], places)


def test_targets_are_expected_where_they_project_to():
    for view in (0, 1):
        assert np.allclose(predict().image_px[:, view].T, images(view))


def test_the_reach_is_the_gate_times_place_and_pointing_together():
    per_mm = np.linalg.norm(images(0, PLACES[1:2] + np.eye(3) * 1e-3) - images(0, PLACES[1:2]), axis=0) / 1e-3
    expected = 3.0 * np.hypot(0.5 * per_mm, 0.2)
    assert np.allclose(predict().reach_px[:, 0, 1], expected, rtol=1e-3)


def test_each_target_gets_the_blob_at_its_place_whatever_their_order():
    assert predict().nearest(0, images()[[2, 0, 1]]).tolist() == [1, 2, 0]


def test_a_blob_out_of_reach_is_nobodys():
    blobs = images() + np.array([[0.0, 0.0], [0.0, 40.0], [0.0, 0.0]])
    assert predict().nearest(0, blobs).tolist() == [0, -1, 2]


def test_a_blob_serves_one_target_and_the_other_is_told_so():
    predicted = predict(sigma_mm=4.0)
    of_left = predicted.nearest(0, images()[[0, 2]])
    assert of_left.tolist() == [0, -2, 1]
    assert predicted.misses(of_left, np.arange(3)).tolist() == [Miss.FOUND, Miss.TAKEN, Miss.FOUND]


def with_unseen(left, right):
    return replace(predict(sigma_mm=4.0), unseen=np.array([left, right]))


def test_a_target_that_is_turned_away_gets_no_blob_however_near():
    predicted = with_unseen([Miss.FOUND, Miss.TURNED_AWAY, Miss.FOUND], [Miss.FOUND] * 3)
    of_left = predicted.nearest(0, images()[[0, 2]])
    assert of_left.tolist() == [0, -1, 1]
    assert predicted.misses(of_left, np.arange(3)).tolist() == [Miss.FOUND, Miss.TURNED_AWAY, Miss.FOUND]


def test_a_merged_target_keeps_others_from_its_blob_and_gets_none():
    predicted = with_unseen([Miss.FOUND] * 3, [Miss.FOUND, Miss.FOUND, Miss.MERGED])
    of_right = predicted.nearest(1, images(1)[[0, 2]])
    assert of_right.tolist() == [0, -2, 1]
    assert predicted.misses(np.arange(3), of_right).tolist() == [Miss.FOUND, Miss.TAKEN, Miss.MERGED]


def test_a_false_blob_farther_off_does_not_matter():
    blobs = np.vstack([images()[0] + [2.0, 2.0], images()])
    assert predict().nearest(0, blobs).tolist() == [1, 2, 3]


def test_without_blobs_nobody_gets_one():
    assert predict().nearest(1, np.empty((0, 2))).tolist() == [-1, -1, -1]


def test_a_target_behind_the_cameras_gets_none():
    behind = np.vstack([PLACES, [0.0, 0.0, 500.0]])
    assert predict(places=behind).nearest(0, images()).tolist() == [0, 1, 2, -1]


@given(st.integers(0, 2**31), st.integers(1, 60), st.integers(1, 60), st.sampled_from([0.5, 8.0, 60.0, 1e4]))
def test_who_is_near_is_found_as_if_all_had_been_looked_at(seed, targets, blobs, reach_px):
    rng = np.random.default_rng(seed)
    image = rng.uniform(0, [[720], [576]], (2, targets))
    image[:, rng.random(targets) < 0.1] = np.inf
    xy = rng.uniform(-50, [770, 626], (blobs, 2))
    xy[: min(blobs, targets) // 2] = image.T[: min(blobs, targets) // 2] + 0.1
    xy = np.where(np.isfinite(xy), np.round(xy), 0.0)
    reach = reach_px * rng.uniform(0.5, 1.0, (2, targets))
    found = _of_those_beside(image, reach, xy.T).tolist()
    assert found == _of_all(image, reach, xy.T).tolist()
