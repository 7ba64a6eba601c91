"""The mean of many static fields is as accurate as it says, though discs lean and mirrors are uneven."""

import numpy as np
import pytest
from tests.processes.averaging import (
    ACROSS,
    DOWN,
    at_exact_places,
    averaged,
    calibrated,
    chi2,
    liner,
    rms_mm,
)
from tests.processes.leaning_scene import BACKGROUND, CONTRAST, FIELD_NS, LeaningScene, Mirrors

from grabberd.field import Field, NumberedField, quantise
from grabberd.measurement import LocationSettings, measure

SEED = 102
"""One of many: `tests/bench/averaging.py` has those that nothing was chosen with."""


@pytest.fixture(scope="module")
def rig():
    return calibrated(SEED, 0.0)


@pytest.mark.parametrize("axis", [DOWN, ACROSS])
def test_the_mean_of_32_fields_is_known_to_a_hundredth_of_a_millimetre(rig, axis):
    found = averaged(*rig, axis, SEED)
    assert found.mean_mm < 0.010
    assert 0.5 < found.chi2 < 1.5
    assert found.single_mm < 0.037
    assert 0.7 < found.single_chi2 < 1.4


def test_a_calibration_behind_slightly_uneven_mirrors_is_as_good_as_it_says():
    error, covariance = at_exact_places(*calibrated(SEED, 0.02))
    assert rms_mm(error) < 0.010
    assert 0.5 < chi2(error, covariance) < 1.5


def test_leaning_discs_move_no_line():
    """Without noise and jitter, what solving for the shifts does to a place stays in every mean."""
    scene = LeaningScene(liner(ACROSS, SEED), Mirrors(SEED))
    solved, unsolved = (
        np.concatenate([_places(scene, parity, shifts) for parity in (0, 1)]) for shifts in (True, False)
    )
    assert np.sqrt(((solved - unsolved) ** 2).mean(axis=0))[0] < 0.011


def _places(scene, parity, shifts):
    """(N, 2) blobs of a field without noise, by a measurement that expects it."""
    grey = np.rint(BACKGROUND + CONTRAST * scene.picture[parity::2]).astype(np.uint8)
    field = NumberedField(parity, parity * FIELD_NS, parity, quantise(Field.intact(grey, parity), 8, 50))
    settings = LocationSettings(noise_levels=3.6, line_jitter_known=True, line_shifts=shifts)
    return measure(field.packed, None, settings).xy_px
