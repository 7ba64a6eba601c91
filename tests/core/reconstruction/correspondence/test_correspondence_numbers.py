"""The numbers that correspondence and tracking have to reach: one and a half times the paper's pointing noise
(.255, .34 px), the wall moving up to two millimetres a field, in each view a tenth of the targets missing and
a twentieth of the blobs false.
"""

import numpy as np
import pytest

from core.geometry.rigs import calibration
from core.reconstruction.liners import SIGMA_PX, model, see, wall
from grabberd.core.geometry import Rig
from grabberd.core.reconstruction import ImageNoise, Tracker

FIELD_S = 0.02
FIELDS = 60
MODEL = model()
RIG = Rig.of(calibration())
TRACKER = Tracker(RIG, MODEL, ImageNoise.of(RIG, MODEL, 0.12, 2))
CLOSING = [6.0 * (0.5 - 0.5 * np.cos(np.pi * min(k / 4.7, 1.0))) for k in range(6)]
SMOOTHLY = (0.0, 0.0, *CLOSING, 6.0, 6.0, *CLOSING[::-1])
"""Six millimetres along a cosine, two of them in its fastest field."""
TO_AND_FRO = (0.0, 2.0, 4.0, 6.0, 4.0, 2.0)
"""Two millimetres in every field, turning round at once, as no wall can."""


def counted(depths_mm, seed):
    """What became of the targets that both views showed: visible, right, stray blob, another target's."""
    rng, track, counts = np.random.default_rng(seed), TRACKER.start(), np.zeros(4, int)
    for field in range(FIELDS):
        seen = see(*wall(depths_mm[field % len(depths_mm)]), rng, noise=1.5, missing=0.1, false=0.05)
        track, points = TRACKER.step(track, seen.left, seen.right, FIELD_S)
        counts += verdict(seen, points)
    return counts


def verdict(seen, points):
    of_left, of_right = (
        {tuple(place): index for place, index in zip(blobs.xy_px, identity, strict=True)}
        for blobs, identity in ((seen.left, seen.left_is), (seen.right, seen.right_is))
    )
    real = np.array([(of_left[tuple(left)], of_right[tuple(right)]) for left, right in points.image_px])
    said = points.target[:, np.newaxis] - 1
    right = (real == said).all(axis=1)
    stray = ((real == said) | (real == -1)).all(axis=1) & ~right
    return len(seen.visible), right.sum(), stray.sum(), len(points) - right.sum() - stray.sum()


def test_the_noise_is_one_and_a_half_times_the_papers():
    assert np.allclose(1.5 * SIGMA_PX, (0.255, 0.3375))


@pytest.mark.slow
@pytest.mark.parametrize("depths_mm", [SMOOTHLY, TO_AND_FRO], ids=["smoothly", "to and fro"])
def test_nearly_all_are_found_and_none_takes_anothers_place(depths_mm):
    visible, right, stray, wrong = sum(counted(depths_mm, seed) for seed in range(6))
    assert visible > 20_000
    assert right >= 0.99 * visible
    assert stray <= 0.002 * visible
    assert wrong == 0


@pytest.mark.slow
def test_a_wall_that_stops_dead_at_two_millimetres_a_field_loses_nearly_none():
    stopping = (0.0, 0.0, 0.0, 2.0, 4.0, 6.0, 6.0, 6.0, 4.0, 2.0)
    visible, right, _, wrong = sum(counted(stopping, seed) for seed in range(4))
    assert right >= 0.99 * visible
    assert wrong <= 2e-4 * visible
