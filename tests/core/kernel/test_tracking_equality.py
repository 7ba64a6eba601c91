"""The compiled kernel and numpy find the same targets, and the same points to 1e-9."""

from dataclasses import fields, replace

import numpy as np
import pytest

from core.geometry.rigs import calibration
from core.reconstruction import many
from core.reconstruction.liners import model, see
from core.reconstruction.tracking.test_tracker import deflection_mm, wall
from grabberd.core.geometry import LocalField, Rig, project_all
from grabberd.core.geometry.calibration import image_model
from grabberd.core.kernel import KERNEL
from grabberd.core.reconstruction import ImageNoise, ObjectModel, Tracker, ViewBlobs
from grabberd.core.reconstruction.correspondence.correspondence import Correspondence
from grabberd.core.reconstruction.points import Miss

pytestmark = pytest.mark.skipif(
    not KERNEL,
    reason="THERE IS NO COMPILED KERNEL HERE: nothing shows that it equals numpy (see docs/decisions)",
)

MODEL = model()
SIGMA = np.tile([0.01, 0.5, 0.5, 1e-3, 1e-3, 1e-4, 0.1, 0.1, 0.1, *[1e-4] * 2, *[1e-5] * 7], 2)


def bumpy(seed):
    rng = np.random.default_rng(seed)
    shift, sigma = rng.normal(0, 0.1, (41, 50, 2)), rng.uniform(0.01, 0.1, (41, 50, 2))
    return LocalField.through((-0.5, -0.5), 15.0, shift, sigma)


RIGS = {
    "certain": Rig.of(calibration()),
    "mirrored": Rig.of(calibration(-1)),
    "uncertain": Rig.of(calibration(covariance=np.diag(SIGMA**2))),
    "with local fields": Rig.of(
        replace(calibration(covariance=np.diag(SIGMA**2)), local_fields=(bumpy(1), None))
    ),
    "with local fields whose errors correlate": Rig.of(
        replace(calibration(), local_fields=(bumpy(1), bumpy(2)), details=image_model((-0.6, 0.9)))
    ),
}


def trackers(rig):
    """With the kernel, and without."""
    noise = ImageNoise.of(rig, MODEL, 0.12, 2)
    both = Tracker(rig, MODEL, noise), Tracker(rig, MODEL, noise)
    both[1].correspondence = Correspondence(rig, MODEL, noise, kernel=None)
    return both


def scenes(count, seed, calibrated, common):
    """A pulsation, seen with noise, missing targets and false blobs."""
    rng = np.random.default_rng(seed)
    for field in range(count):
        seen = see(*wall(deflection_mm(field)), rng, calibrated, noise=1.2, missing=0.15, false=0.2)
        if not common:
            yield seen.left, seen.right
            continue
        yield tuple(
            replace(blobs, common_px=rng.uniform(0.02, 0.08, len(blobs)), common_reach_px=3.0)
            for blobs in (seen.left, seen.right)
        )


def assert_same(first, second):
    for one in fields(first):
        ours, theirs = getattr(first, one.name), getattr(second, one.name)
        if ours is None:  # images of a single view, which a tracker does not seek
            assert theirs is None
            continue
        if one.name == "sighting":
            assert_same_account(ours, theirs)
            continue
        assert np.allclose(ours, theirs, rtol=1e-9, atol=1e-9), one.name


def assert_same_account(ours, theirs):
    """Why targets were not found, and where they were sought."""
    assert np.array_equal(ours.misses, theirs.misses)
    assert np.allclose(ours.predicted_px, theirs.predicted_px, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("name", RIGS)
@pytest.mark.parametrize("common", [False, True])
def test_through_a_pulsation(name, common):
    compiled, numpy_alone = trackers(RIGS[name])
    ours, theirs = compiled.start(), numpy_alone.start()
    calibrated, found = calibration(-1 if name == "mirrored" else 1), 0
    for left, right in scenes(25, 3, calibrated, common):
        ours, points = compiled.step(ours, left, right, 0.02)
        theirs, expected = numpy_alone.step(theirs, left, right, 0.02)
        assert_same(points, expected)
        assert_same(ours, theirs)
        found += len(points)
    assert found > 25 * 40


def test_of_nobody():
    compiled, numpy_alone = trackers(RIGS["certain"])
    nothing = next(scenes(1, 0, calibration(), False))[0].select(np.zeros(0, np.intp))
    places, sigma = MODEL.xyz_mm, np.full(len(MODEL), 0.5)
    ours = compiled.correspondence.near(places, sigma, nothing, nothing)
    theirs = numpy_alone.correspondence.near(places, sigma, nothing, nothing)
    assert len(ours) == len(theirs) == 0
    assert not ours.expected.displacement_mm.any()
    assert np.array_equal(ours.settled[0], MODEL.xyz_mm)
    assert np.allclose(ours.expected.sigma_mm, theirs.expected.sigma_mm)


def test_where_targets_are_behind_the_cameras_or_may_be_anywhere():
    compiled, numpy_alone = trackers(RIGS["certain"])
    left, right = next(scenes(1, 5, calibration(), False))
    places, sigma = MODEL.xyz_mm.copy(), np.full(len(MODEL), 40.0)
    places[::3, 2] += 900.0
    ours = compiled.correspondence.near(places, sigma, left, right)
    theirs = numpy_alone.correspondence.near(places, sigma, left, right)
    assert np.array_equal(ours.target, theirs.target)
    assert_same(ours.points, theirs.points)
    assert_same_account(ours, theirs)


def test_of_pairs_that_meet_whether_they_agree_or_not():
    compiled, numpy_alone = trackers(RIGS["certain"])
    left, right = next(scenes(1, 5, calibration(), False))
    places, sigma = MODEL.xyz_mm, np.full(len(MODEL), 0.8)
    target, xyz_mm = compiled.correspondence.meeting(places, sigma, left, right)
    expected, expected_mm = numpy_alone.correspondence.meeting(places, sigma, left, right)
    assert np.array_equal(target, expected)
    assert np.allclose(xyz_mm, expected_mm, rtol=1e-9, atol=1e-9)
    assert len(target) > 40


@pytest.mark.parametrize("count", [600, 1500])
def test_of_many_targets(count):
    grid = many.grid(count)
    rig, rng = RIGS["uncertain"], np.random.default_rng(count)
    noise = ImageNoise.of(rig, grid, 0.12, 2)
    both = Correspondence(rig, grid, noise), Correspondence(rig, grid, noise, kernel=None)
    predicted, sigma = grid.xyz_mm, np.full(count, 0.2)
    for depth_mm in (0.3, 0.6, 0.9):
        places = many.bent(grid, depth_mm)
        sights = [many.see(places, view, rng) for view in (0, 1)]
        ours, theirs = (one.near(predicted, sigma, *(sight.blobs for sight in sights)) for one in both)
        assert np.array_equal(ours.target, theirs.target)
        assert_same(ours.points, theirs.points)
        assert_same_account(ours, theirs)
        assert np.allclose(ours.expected.displacement_mm, theirs.expected.displacement_mm, atol=1e-9)
        predicted = ours.settled[0]
        assert len(ours) > 0.6 * count


@pytest.mark.parametrize("columns", [7, 9, 14])
@pytest.mark.parametrize("radius_mm", [6.0, 14.5, 60.0])
def test_who_cannot_be_seen(columns, radius_mm):
    """Walls that turn away, fold over themselves and crowd their targets, with blobs for all of them."""
    rig, rng = RIGS["certain"], np.random.default_rng(columns)
    known = round_a_wall(columns, radius_mm)
    noise, seen = ImageNoise.of(rig, known, 0.12, 2), set()
    judges = [Correspondence(rig, known, noise), Correspondence(rig, known, noise, kernel=None)]
    for bend_mm in (0.0, 3.0, 9.0):
        places = known.xyz_mm + bend_mm * np.sin(known.column)[:, np.newaxis] * rng.normal(size=3)
        image = project_all(rig, places)
        blobs = [ViewBlobs(image[:, k].T, np.full((len(known), 2), 0.1)) for k in (0, 1)]
        ours, theirs = (judge.near(places, np.full(len(known), 0.8), *blobs) for judge in judges)
        assert np.array_equal(ours.misses, theirs.misses)
        assert np.array_equal(ours.target, theirs.target)
        seen |= set(ours.misses.tolist())
    assert Miss.TURNED_AWAY in seen or radius_mm == 60.0


def round_a_wall(columns, radius_mm):
    row, column = (each.ravel().astype(np.int32) for each in np.indices((6, columns)))
    angle = 6.5 / radius_mm * (column - (columns - 1) / 2)
    places = np.column_stack([6.5 * (row - 2.5), radius_mm * np.sin(angle), radius_mm * (np.cos(angle) - 1)])
    return ObjectModel("wall", np.arange(len(row), dtype=np.int32), places, row, column, 1.5, 0.3)
