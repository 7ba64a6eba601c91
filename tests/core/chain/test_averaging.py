"""The mean of many static fields is as accurate as it says, though discs lean and mirrors are uneven."""

from functools import cache
from typing import NamedTuple

import numpy as np
import pytest
from tests.core.chain.averaging import (
    ACROSS,
    DOWN,
    at_exact_places,
    averaged,
    calibrated,
    chi2,
    liner,
    rms_mm,
)
from tests.core.chain.leaning_scene import BACKGROUND, CONTRAST, FIELD_NS, LeaningScene, Mirrors
from tests.core.chain.pinhole_pictures import Optics

from grabberd.core.field import Field, NumberedField, quantise
from grabberd.core.measurement import LocationSettings, measure

AXES = DOWN, ACROSS
SEED = 102
SET_ASIDE = (301, 302, 303, 304)
"""Rigs that no constant was chosen with; `tests/proofs/bench/averaging.py` prints each of their numbers."""


class OverRigs(NamedTuple):
    """Root mean squares and mean χ² over rigs and both of the liner's axes."""

    single_mm: float
    single_chi2: float
    mean_mm: float
    chi2: float
    exact_mm: float
    exact_chi2: float


@cache
def over_rigs(uneven_px):
    rigs = {seed: calibrated(seed, uneven_px) for seed in SET_ASIDE}
    found = [averaged(*rig, axis, seed) for seed, rig in rigs.items() for axis in AXES]
    assert not any(one.missed for one in found)
    exact = [at_exact_places(*rig) for rig in rigs.values()]
    return OverRigs(
        root_mean_square(one.single_mm for one in found),
        np.mean([one.single_chi2 for one in found]),
        root_mean_square(one.mean_mm for one in found),
        np.mean([one.chi2 for one in found]),
        root_mean_square(rms_mm(error) for error, _ in exact),
        np.mean([chi2(*one) for one in exact]),
    )


def root_mean_square(values):
    return np.sqrt(np.mean(np.square(list(values))))


@pytest.mark.slow
def test_behind_even_mirrors_the_mean_of_32_fields_is_known_to_a_hundredth_of_a_millimetre():
    found = over_rigs(0.0)
    assert found.mean_mm < 0.010
    assert 0.8 < found.chi2 < 1.2


@pytest.mark.slow
def test_behind_uneven_mirrors_it_is_hardly_worse():
    found = over_rigs(0.02)
    assert found.mean_mm < 0.011
    assert 0.8 < found.chi2 < 1.3


@pytest.mark.slow
@pytest.mark.parametrize("uneven_px", [0.0, 0.02])
def test_single_fields_are_as_good_as_they_say(uneven_px):
    found = over_rigs(uneven_px)
    assert found.single_mm < 0.036
    assert 0.8 < found.single_chi2 < 1.2


@pytest.mark.slow
def test_a_calibration_behind_uneven_mirrors_is_known_to_a_hundredth_of_a_millimetre():
    found = over_rigs(0.02)
    assert found.exact_mm < 0.010
    assert 0.8 < found.exact_chi2 < 1.3


RIGS = 903, 904
"""Of two reflections a view, and of one."""


@cache
def made(seed):
    """Errors at exact places, and the calibration's covariances, of a rig with a lens of its own."""
    return at_exact_places(*calibrated(seed, 0.02, fields=12, optics=Optics.drawn(seed)))


def test_discs_do_not_shift_what_their_calibration_frame_calibrates():
    """Middles taken for centres moved everything by .004 mm along Z; the certificate's draw leaves .0005."""
    assert np.abs([made(seed)[0].mean(axis=0)[2] for seed in RIGS]).max() < 0.0015


def test_the_calibrations_sigma_is_that_of_its_errors_along_each_axis():
    """Errors of the certificate are those of both views: independent, Z would have twice its σ."""
    errors, covariances = (np.concatenate(both) for both in zip(*map(made, RIGS), strict=True))
    share = (errors**2).mean(axis=0) / np.diagonal(covariances, axis1=1, axis2=2).mean(axis=0)
    assert (share > 0.6).all()
    assert (share < 1.6).all()


def test_grey_values_lead_to_the_middle_of_an_ellipse():
    """Threshold, blur, pixels and lines of one parity shift a disc's picture by nothing in the mean."""
    mirrors = Mirrors(SEED, 0.0)
    scene = LeaningScene(liner(DOWN, SEED), mirrors)
    places = np.concatenate([_places(scene, parity, shifts=True) for parity in (0, 1)])
    middles = np.concatenate([_middles(camera, scene) for camera in mirrors.cameras])
    off = places[:, np.newaxis] - middles
    nearest = np.hypot(*off.transpose(2, 0, 1)).argmin(axis=1)
    off = off[np.arange(len(places)), nearest]
    off = off[np.hypot(*off.T) < 1.0]
    assert len(off) > 250
    assert np.abs(off.mean(axis=0)).max() < 0.001


def _middles(camera, scene):
    """(N, 2) middles of the ellipses, from their rims' polygons."""
    rims = camera.project(scene.discs.rims_mm.reshape(-1, 3)).reshape(len(scene.discs.xyz_mm), -1, 2)
    x, y = rims[..., 0], rims[..., 1]
    cross = x * np.roll(y, -1, axis=1) - np.roll(x, -1, axis=1) * y
    both = rims + np.roll(rims, -1, axis=1)
    return (both * cross[..., np.newaxis]).sum(axis=1) / (3 * cross.sum(axis=1))[:, np.newaxis]


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
