from dataclasses import replace

import numpy as np
import pytest

from core.calibration.networks import TRUE, frame, network
from core.geometry.rigs import calibration
from grabberd.core.calibration.adjustment.adjustment import adjust
from grabberd.core.calibration.adjustment.network import Unknowns
from grabberd.core.calibration.adjustment.starting_values import with_glass
from grabberd.core.geometry import PARAMETERS, Plate, project, project_through

UPRIGHT = Plate(3.0, 1.52)
TILTED = Plate(5.0, 1.52, (0.0, np.sin(np.radians(20)), np.cos(np.radians(20))))
ELSEWHERE = np.random.default_rng(1).uniform(-1, 1, (200, 3)) * [45, 20, 12]


def rms(values):
    return float(np.sqrt(np.mean(np.square(values))))


def calibrated_through(plate, free):
    """An exact calibration through a plate that the model knows nothing of."""
    pictures = np.concatenate([project_through(plate, view, frame()) for view in TRUE])
    return adjust(replace(network(seed=None), xy_px=pictures), Unknowns.of(TRUE, free))


@pytest.mark.parametrize(
    ("plate", "free", "residual_px"),
    [
        (UPRIGHT, PARAMETERS, 0.0005),
        (TILTED, PARAMETERS, 0.003),
        (UPRIGHT, PARAMETERS[:9], 0.015),
        (TILTED, PARAMETERS[:9], 0.06),
    ],
)
def test_a_calibration_made_through_glass_absorbs_it(plate, free, residual_px):
    adjusted = calibrated_through(plate, free)
    assert residual_px / 4 < rms(adjusted.residual_px) < residual_px
    missed = [
        project_through(plate, true, ELSEWHERE) - project(found, ELSEWHERE)
        for true, found in zip(TRUE, adjusted.views, strict=True)
    ]
    assert rms(missed) < 1.2 * residual_px


@pytest.mark.parametrize("handedness", [1, -1])
def test_a_calibration_carried_over_to_glass_sees_through_it(handedness):
    bare = calibration(handedness)
    through = with_glass(bare, UPRIGHT, frame())
    for before, after in zip(bare.views, through.views, strict=True):
        seen = project_through(UPRIGHT, before, ELSEWHERE)
        assert rms(seen - project(before, ELSEWHERE)) > 0.5
        assert rms(seen - project(after, ELSEWHERE)) < 0.001


def test_a_calibration_carried_over_fits_the_glass_and_nothing_else():
    through = with_glass(calibration(), UPRIGHT, frame())
    through.check_fits(720, 576, {"thickness_mm": 3.0, "refractive_index": 1.52})
    assert through.left.handedness == calibration().left.handedness
