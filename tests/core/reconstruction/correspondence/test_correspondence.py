import numpy as np
import pytest

from core.geometry.rigs import calibration
from core.reconstruction.liners import model, see, wall
from grabberd.core.geometry import Rig
from grabberd.core.reconstruction import Correspondence, ImageNoise, ViewBlobs

MODEL = model()


def correspondence(handedness=1) -> Correspondence:
    rig = Rig.of(calibration(handedness))
    return Correspondence(rig, MODEL, ImageNoise.of(rig, MODEL, 0.0, 2))


JUDGE = correspondence()


def scene(deflection_mm, seed=0, **changes):
    return see(*wall(deflection_mm), np.random.default_rng(seed), **changes)


def verdict(seen, found):
    """How many are right, how many a false blob took the place of, how many are somebody else's."""
    left, right = seen.left_is[found.left], seen.right_is[found.right]
    correct = (left == found.target) & (right == found.target)
    false = ~correct & ((left == found.target) | (left < 0)) & ((right == found.target) | (right < 0))
    return correct.sum(), false.sum(), len(found) - correct.sum() - false.sum()


@pytest.mark.parametrize("handedness", [1, -1])
@pytest.mark.parametrize("deflection_mm", [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
def test_every_target_is_identified_in_any_phase(deflection_mm, handedness):
    rig = calibration(handedness)
    seen = scene(deflection_mm, rig=rig, noise=0.1, missing=0.0, false=0.0)
    found = correspondence(handedness).identify(seen.left, seen.right)
    assert set(found.target.tolist()) == seen.visible
    assert verdict(seen, found) == (len(seen.visible), 0, 0)


def test_nearly_all_are_identified_and_none_wrongly_with_noise_missing_targets_and_false_blobs():
    visible, verdicts = 0, np.zeros(3, int)
    for seed in range(40):
        seen = scene((0.0, 2.0, 4.0, 6.0)[seed % 4], seed)
        found = JUDGE.identify(seen.left, seen.right)
        visible += len(seen.visible)
        verdicts += verdict(seen, found)
        near = np.abs(found.points.xyz_mm - seen.xyz[found.target])
        assert near.max() < 2.5
    correct, false, wrong = verdicts
    assert correct >= 0.99 * visible
    assert false <= 0.002 * visible
    assert wrong == 0


def test_much_clutter_makes_it_leave_out_more_but_not_guess():
    for seed in range(5):
        seen = scene(4.0, seed, missing=0.3, false=0.3)
        correct, _, wrong = verdict(seen, JUDGE.identify(seen.left, seen.right))
        assert wrong == 0
        assert correct >= 0.9 * len(seen.visible)


def test_points_carry_the_ids_of_the_object_model():
    seen = scene(2.0)
    found = JUDGE.identify(seen.left, seen.right)
    assert np.array_equal(found.points.target, MODEL.target[found.target])
    assert (np.diff(found.points.target) > 0).all()
    assert np.array_equal(found.points.image_px[:, 0], seen.left.xy_px[found.left])


def test_a_blob_is_used_once():
    seen = scene(5.0, 3, false=0.5)
    found = JUDGE.identify(seen.left, seen.right)
    for used in (found.left, found.right):
        assert len(set(used.tolist())) == len(found)


def test_the_order_of_the_blobs_does_not_matter():
    seen = scene(5.0, 4)
    first = JUDGE.identify(seen.left, seen.right)
    second = JUDGE.identify(seen.left.select(np.arange(len(seen.left))[::-1]), seen.right)
    assert np.array_equal(first.target, second.target)
    assert np.allclose(first.points.xyz_mm, second.points.xyz_mm, atol=1e-9)


def test_the_same_blobs_give_the_same_points_bit_for_bit():
    seen = scene(5.0, 5)
    first, second = (correspondence().identify(seen.left, seen.right).points for _ in range(2))
    assert first.xyz_mm.tobytes() == second.xyz_mm.tobytes()
    assert first.covariance_mm2.tobytes() == second.covariance_mm2.tobytes()


def test_an_object_that_stands_aside_as_a_whole_is_identified():
    xyz, normals = wall(3.0)
    seen = see(xyz + np.array([0.5, -1.5, 2.0]), normals, np.random.default_rng(6))
    correct, _, wrong = verdict(seen, JUDGE.identify(seen.left, seen.right))
    assert wrong == 0
    assert correct >= 0.98 * len(seen.visible)


@pytest.mark.parametrize("dark", ["left", "right", "both"])
def test_a_dark_view_identifies_nobody(dark):
    seen = scene(0.0)
    nothing = ViewBlobs(np.empty((0, 2)), np.empty((0, 2)))
    left = nothing if dark in {"left", "both"} else seen.left
    right = nothing if dark in {"right", "both"} else seen.right
    assert len(JUDGE.identify(left, right)) == 0


def test_blobs_that_are_no_targets_identify_next_to_nobody():
    rng = np.random.default_rng(7)
    sigma = np.full((100, 2), 0.2)
    left = ViewBlobs(rng.uniform([100, 60], [260, 520], (100, 2)), sigma)
    right = ViewBlobs(rng.uniform([460, 60], [620, 520], (100, 2)), sigma)
    assert len(JUDGE.identify(left, right)) < 12


def test_targets_are_found_near_where_they_must_be():
    seen = scene(4.0, 8)
    found = JUDGE.near(seen.xyz + 0.3, np.full(108, 0.5), seen.left, seen.right)
    correct, false, wrong = verdict(seen, found)
    assert wrong == 0
    assert correct + false >= 0.98 * len(seen.visible)


def test_two_rays_that_do_not_meet_are_no_target():
    seen = scene(4.0, 9, noise=0.1, missing=0.0, false=0.0)
    spoiled = seen.right.xy_px.copy()
    spoiled[seen.right_is == 50, 1] += 2.0
    found = JUDGE.near(seen.xyz, np.full(108, 1.0), seen.left, ViewBlobs(spoiled, seen.right.sigma_px))
    assert set(found.target.tolist()) == seen.visible - {50}
