"""Mean images of pictures that no code of this program made: their σ is that of their errors."""

from dataclasses import replace

import numpy as np
import pytest
from tests.core.chain.averaging import NOMINAL
from tests.core.chain.leaning_scene import Discs, LeaningScene, Mirrors
from tests.core.chain.pinhole_pictures import Optics
from tests.core.shipped_models import PAPER, shipped_model

from grabberd.core.chain.accuracy import requantised
from grabberd.core.chain.calibration.frame_capture import locate
from grabberd.core.measurement import LocationSettings

SEEDS = (977, 978)
"""No constant was chosen with these; one has a single reflection a view."""
FIELDS = 24


def scene(seed):
    frame = shipped_model(PAPER)
    frame = replace(
        frame, xyz_mm=frame.xyz_mm + np.random.default_rng(seed).uniform(-0.1, 0.1, (len(frame), 3))
    )
    return frame, LeaningScene(Discs.facing(frame.xyz_mm), Mirrors(seed, 0.0, optics=Optics.drawn(seed)))


@pytest.fixture(scope="module")
def captures():
    return [(*one, list(one[1].fields(FIELDS, seed))) for seed in SEEDS for one in [scene(seed)]]


@pytest.mark.parametrize(("bits", "doubled"), [(8, False), (1, False), (1, True)])
def test_the_sigma_of_the_means_is_that_of_their_errors(captures, bits, doubled):
    square = []
    for frame, pictures, grey in captures:
        fields = grey if bits == 8 else requantised(grey, bits, doubled=doubled)
        images = locate(fields, NOMINAL, frame, LocationSettings()).images
        for view, mean in enumerate(images):
            true = pictures.true_px[:, view]
            nearest = np.linalg.norm(mean.xy_px[:, np.newaxis] - true, axis=2).argmin(axis=1)
            off = mean.xy_px - true[nearest]
            square.append(((off - np.median(off, axis=0)) / mean.sigma_px) ** 2)
    by_axis = np.concatenate(square).mean(axis=0)
    assert len(np.concatenate(square)) > 0.95 * 2 * 2 * 108
    assert by_axis.min() > 0.6
    assert by_axis.max() < 1.6
    assert 0.7 < by_axis.mean() < 1.4
