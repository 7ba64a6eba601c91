"""The compiled kernel and numpy identify the same targets, from the same hypotheses to 1e-9."""

from dataclasses import replace

import numpy as np
import pytest

from core.geometry.rigs import calibration
from core.kernel.test_tracking_equality import MODEL, RIGS, assert_same
from core.reconstruction.liners import see, wall
from grabberd.core.kernel import KERNEL
from grabberd.core.reconstruction import CorrespondenceSettings, ImageNoise
from grabberd.core.reconstruction.correspondence.agreement import Agreement, Hypotheses, hypotheses
from grabberd.core.reconstruction.correspondence.compiled_search import Identification
from grabberd.core.reconstruction.correspondence.correspondence import Correspondence

pytestmark = pytest.mark.skipif(
    not KERNEL,
    reason="THERE IS NO COMPILED KERNEL HERE: nothing shows that it equals numpy (see docs/decisions)",
)
SCENES = 40
"""Random scenes of each rig, and as many sets of random hypotheses."""


def both_of(rig, settings=None):
    """With the kernel, and without."""
    noise = ImageNoise.of(rig, MODEL, 0.12, 2)
    compiled = Correspondence(rig, MODEL, noise, settings)
    return compiled, Correspondence(rig, MODEL, noise, settings, kernel=None)


def scenes(calibrated, seed, count=SCENES):
    """Open to closed, from clean pictures to ones that miss a third and show half as many false blobs."""
    rng = np.random.default_rng(seed)
    for number in range(count):
        how = {"noise": rng.uniform(0.1, 2.0), "missing": rng.uniform(0, 0.35), "false": rng.uniform(0, 0.5)}
        seen = see(*wall(round(rng.uniform(0.0, 10.0), 1)), rng, calibrated, **how)
        views = seen.left, seen.right
        if number % 2:
            views = tuple(
                replace(one, common_px=rng.uniform(0.02, 0.08, len(one)), common_reach_px=3.0)
                for one in views
            )
        yield views


def assert_same_sighting(ours, theirs):
    for name in ("target", "left", "right"):
        assert np.array_equal(getattr(ours, name), getattr(theirs, name)), name
    assert_same(ours.points, theirs.points)
    assert np.allclose(ours.expected.displacement_mm, theirs.expected.displacement_mm, atol=1e-9)
    assert np.allclose(ours.expected.sigma_mm, theirs.expected.sigma_mm, atol=1e-7)


@pytest.mark.parametrize("name", RIGS)
def test_of_random_scenes(name):
    compiled, numpy_alone = both_of(RIGS[name])
    found = []
    for left, right in scenes(calibration(-1 if name == "mirrored" else 1), len(name)):
        ours, theirs = compiled.identify(left, right), numpy_alone.identify(left, right)
        assert_same_sighting(ours, theirs)
        found.append(len(ours))
    assert np.median(found) > 40


@pytest.mark.parametrize(
    "changes",
    [{"gate": 2.0}, {"gate": 8.0, "margin": 0.5}, {"trust": 0.5, "stretch": 0.1}, {"farthest_mm": 20.0}],
)
def test_under_other_limits(changes):
    compiled, numpy_alone = both_of(RIGS["certain"], CorrespondenceSettings(**changes))
    for left, right in scenes(calibration(), 7, 12):
        assert_same_sighting(compiled.identify(left, right), numpy_alone.identify(left, right))


def test_of_hypotheses():
    settings, noise = CorrespondenceSettings(), ImageNoise.of(RIGS["uncertain"], MODEL, 0.12, 2)
    compiled = Identification(KERNEL, RIGS["uncertain"], Agreement(MODEL, settings), noise)
    for left, right in scenes(calibration(), 11, 12):
        ours = compiled.hypotheses(left, right)
        theirs = hypotheses(RIGS["uncertain"], MODEL, (left, right), noise, settings)
        for name in ("target", "left", "right"):
            assert np.array_equal(getattr(ours, name), getattr(theirs, name)), name
        assert np.allclose(ours.displacement_mm, theirs.displacement_mm, rtol=1e-9, atol=1e-9)
        assert np.allclose(ours.variance_mm2, theirs.variance_mm2, rtol=1e-9, atol=1e-9)


def contradicting(rng) -> Hypotheses:
    """Two bent walls a little apart that share blobs, and any number of false ones."""
    count, wild = len(MODEL), int(rng.integers(0, 600))
    bent = [wall(round(rng.uniform(0, 8), 1))[0] - MODEL.xyz_mm + rng.normal(0, 1.0, 3) for _ in range(2)]
    bent.append(rng.normal(0, 3.0, (wild, 3)))
    target = np.concatenate([np.arange(count), np.arange(count), rng.integers(0, count, wild)])
    left, right = (np.concatenate([target[:count], rng.integers(0, 150, count + wild)]) for _ in range(2))
    displacement_mm = np.concatenate(bent) + rng.normal(0, 0.1, (len(target), 3))
    variance_mm2 = rng.uniform(0.001, 0.5, (len(target), 3))
    kept = rng.permutation(len(target))[: rng.integers(1, len(target))]
    kept = kept[np.argsort(target[kept], kind="stable")]
    return Hypotheses(target, left, right, displacement_mm, variance_mm2).select(kept)


@pytest.mark.parametrize("stretch", [0.35, 0.08])
def test_of_the_largest_agreement_where_many_contradict_each_other(stretch):
    judge = Agreement(MODEL, CorrespondenceSettings(stretch=stretch))
    noise = ImageNoise.of(RIGS["certain"], MODEL, 0.12, 2)
    compiled = Identification(KERNEL, RIGS["certain"], judge, noise)
    rng, sizes, contradicted = np.random.default_rng(13), [], []
    for _ in range(SCENES):
        known = contradicting(rng)
        chosen, expected = compiled.largest(known, 150, 150)
        assert np.array_equal(chosen, judge.largest(known))
        sizes.append(len(chosen))
        if len(starts := judge._starts(known)):
            grown = judge._grown(known, starts[:1], np.ones(len(known), np.bool_))
            contradicted.append(len(grown) - len(judge.consistent(known, grown)[0]))
        if len(chosen):
            stay, theirs = judge.consistent(known, chosen)
            assert np.array_equal(stay, chosen)
            assert np.allclose(expected.displacement_mm, theirs.displacement_mm, rtol=1e-9, atol=1e-9)
            assert np.allclose(expected.sigma_mm, theirs.sigma_mm, rtol=1e-9, atol=1e-7)
    assert max(sizes) > 60
    assert max(contradicted) > 0


def test_of_nobody():
    compiled, numpy_alone = both_of(RIGS["certain"])
    left, right = next(scenes(calibration(), 3, 1))
    nothing = left.select(np.zeros(0, np.intp))
    for pair in ((nothing, nothing), (left, nothing), (nothing, right)):
        ours, theirs = compiled.identify(*pair), numpy_alone.identify(*pair)
        assert len(ours) == len(theirs) == 0


def test_of_more_hypotheses_than_there_is_room_for():
    compiled, numpy_alone = both_of(RIGS["certain"], CorrespondenceSettings(farthest_mm=60.0))
    left, right = next(scenes(calibration(), 5, 1))
    known = compiled.identification.hypotheses(left, right)
    assert len(known) > 2048
    assert_same_sighting(compiled.identify(left, right), numpy_alone.identify(left, right))
