"""Objects of hundreds to thousands of targets are followed as surely as those of a hundred."""

import numpy as np
import pytest

from core.geometry.rigs import calibration
from core.reconstruction.many import bent, grid, see
from grabberd.core.geometry import Rig
from grabberd.core.reconstruction import ImageNoise
from grabberd.core.reconstruction.correspondence.correspondence import Correspondence

RIG = Rig.of(calibration())


@pytest.mark.parametrize(("count", "false"), [(54, 0.02), (216, 0.02), (432, 0.02), (864, 0), (2000, 0)])
def test_of_those_seen_in_both_views_99_in_100_are_found_and_none_is_wrong(count, false):
    """Where targets are three millimetres apart and less, a false blob may well lie where one is missing."""
    model, rng = grid(count), np.random.default_rng(count)
    correspondence = Correspondence(RIG, model, ImageNoise.of(RIG, model, 0.12, 2))
    right = seen = wrong = 0
    for field in range(3):
        places = bent(model, 1.0 + 0.1 * field)
        left, other = (see(places, view, rng, false=false) for view in (0, 1))
        predicted = places + rng.normal(0, 0.1, 3)
        sighting = correspondence.near(predicted, np.full(count, 0.1), left.blobs, other.blobs)
        own = (left.of[sighting.left] == sighting.target) & (other.of[sighting.right] == sighting.target)
        right, wrong = right + int(own.sum()), wrong + int((~own).sum())
        seen += len(np.intersect1d(left.of[left.of >= 0], other.of))
    assert right >= 0.99 * seen
    assert wrong == 0
