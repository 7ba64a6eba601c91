import numpy as np

from core.geometry.rigs import calibration
from core.reconstruction.liners import model, see, wall
from grabberd.core.geometry import Rig
from grabberd.core.reconstruction import ImageNoise
from grabberd.core.reconstruction.correspondence.agreement import CorrespondenceSettings, hypotheses

RIG, MODEL = Rig.of(calibration()), model()
NOISE = ImageNoise.of(RIG, MODEL, 0.0, 2)


def scene(deflection_mm, seed=0, **changes):
    return see(*wall(deflection_mm), np.random.default_rng(seed), **changes)


def known(seen, gate=3.7, farthest_mm=9.0):
    return hypotheses(
        RIG, MODEL, (seen.left, seen.right), NOISE, CorrespondenceSettings(gate=gate, farthest_mm=farthest_mm)
    )


def test_every_visible_target_is_among_its_own_hypotheses():
    seen = scene(6.0, noise=0.1, false=0.0)
    found = known(seen)
    right_ones = (seen.left_is[found.left] == found.target) & (seen.right_is[found.right] == found.target)
    assert set(found.target[right_ones].tolist()) == seen.visible


def test_on_a_grid_the_rays_alone_allow_more_than_one_blob():
    found = known(scene(0.0, noise=0.1, missing=0.0, false=0.0))
    assert len(found) > 2 * len(set(found.target.tolist()))


def test_hypotheses_say_how_far_the_target_would_be_from_its_nominal_place():
    seen = scene(5.0, noise=0.001, missing=0.0, false=0.0)
    found = known(seen, gate=100.0)
    own = (seen.left_is[found.left] == found.target) & (seen.right_is[found.right] == found.target)
    displacement = (seen.xyz - MODEL.xyz_mm)[found.target[own]]
    assert np.abs(found.displacement_mm[own] - displacement).max() < 0.01
    assert (np.linalg.norm(found.displacement_mm, axis=1) <= 9.0).all()


def test_they_come_by_ascending_target_with_a_variance_that_is_largest_in_depth():
    found = known(scene(3.0))
    assert (np.diff(found.target) >= 0).all()
    assert (found.variance_mm2.argmax(axis=1) == 2).all()


def test_a_narrower_gate_or_a_stiffer_object_leaves_fewer():
    seen = scene(3.0)
    assert len(known(seen, gate=1.0)) < len(known(seen))
    assert len(known(seen, farthest_mm=2.0)) < len(known(seen))


def test_a_mask_chooses_hypotheses():
    found = known(scene(3.0))
    few = found.select(found.target == 50)
    assert set(few.target.tolist()) == {50}
    assert len(few.displacement_mm) == len(few) > 0
