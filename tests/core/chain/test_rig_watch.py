"""The light that says that the rig has moved, on fields of the simulated grabber."""

from dataclasses import replace

import numpy as np
import pytest

from core.chain.fake_scene import take_scene
from grabberd.core.chain.measure import measure_fields
from grabberd.core.chain.rig_watch import RigWatch
from grabberd.core.geometry import rotation_angles, rotation_matrix
from grabberd.core.reconstruction.drift_check import RigVerdict

PX_RAD = 0.0084 / 8.0


@pytest.fixture(scope="module")
def liner():
    return take_scene(101)


def turned(setup, px):
    """A setup whose calibration has the left images so many pixels higher than the rig shows them."""
    left = setup.calibration.left
    whole = rotation_matrix(px * PX_RAD, 0.0, 0.0) @ rotation_matrix(
        left.omega_rad, left.phi_rad, left.kappa_rad
    )
    angles = dict(zip(("omega_rad", "phi_rad", "kappa_rad"), rotation_angles(whole), strict=True))
    return replace(setup, calibration=replace(setup.calibration, left=replace(left, **angles)))


def watched(scene, px):
    setup = turned(scene.setup, px)
    watch = RigWatch(setup)
    return [watch.see(one) for one in measure_fields(scene.packed(1, "doubled"), setup)]


def test_once_a_second_it_is_said_what_the_last_seconds_show(liner):
    fits = watched(liner, 0.0)
    assert [n for n, fit in enumerate(fits) if fit] == [50, 100]
    assert fits[-1].verdict is RigVerdict.FITS
    assert fits[-1].fields == 10


@pytest.mark.parametrize("rate_hz", [25, 59.94, 120])
def test_it_is_said_once_a_second_at_any_rate(liner, rate_hz):
    watch = RigWatch(liner.setup)
    (first,) = measure_fields([next(liner.packed(1, "doubled"))], liner.setup)
    times_ns = [round(n * 1e9 / rate_hz) for n in range(round(3.5 * rate_hz))]
    told = [at_ns for at_ns in times_ns if watch.see(first._replace(time_ns=at_ns))]
    assert [at_ns / 1e9 for at_ns in told] == pytest.approx([1.0, 2.0, 3.0], abs=0.2)


@pytest.mark.parametrize("px", [0.5, 3.0])
def test_a_mirror_that_has_moved_is_seen_even_where_no_target_is_identified_any_more(liner, px):
    fit = watched(liner, px)[-1]
    assert fit.verdict is RigVerdict.MOVED
    assert fit.shift_px == pytest.approx(px, abs=0.15 + 0.1 * px)


def test_a_mirror_that_has_moved_far_leaves_targets_that_fit_nothing(liner):
    assert watched(liner, 40.0)[-1].verdict is RigVerdict.UNMATCHED


def test_a_dark_picture_says_nothing_of_the_rig(liner):
    watch = RigWatch(liner.setup)
    nothing = np.zeros(0, np.intp)
    for one in measure_fields(liner.packed(1, "doubled"), liner.setup):
        watch.see(one._replace(blobs=one.blobs.select(nothing), points=one.points.select(nothing)))
    assert watch.fit().verdict is RigVerdict.UNKNOWN


@pytest.mark.slow
@pytest.mark.parametrize("picture", [{}, {"noise": 0.1, "jitter_px": 0.3}])
@pytest.mark.parametrize("scene", ["liner", "accuracy_object"])
def test_rigs_that_have_not_moved_raise_no_alarm(scene, picture):
    for seed in range(2, 5):
        taken = take_scene(51, scene=scene, seed=seed, rig={"seed": seed}, picture=picture)
        assert watched(taken, 0.0)[-1].verdict is RigVerdict.FITS
