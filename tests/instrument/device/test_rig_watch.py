"""The light that says that the rig has moved, on fields of the simulated grabber."""

from dataclasses import replace

import numpy as np
import pytest

from core.chain.fake_scene import take_scene
from grabberd.core.chain.measure import measure_fields
from grabberd.core.geometry import Rig, project_all, rotation_angles, rotation_matrix
from grabberd.core.reconstruction import ImageNoise, ViewBlobs, intersect
from grabberd.core.reconstruction.drift_check import MarkState, RigVerdict, ViewMarks
from grabberd.instrument.device.field_watch import RigWatch

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


def with_marks(fit, left, right=MarkState.AT_REST, size_px=0.0, marks=4):
    return fit.with_marks((ViewMarks(left, marks, size_px, 0.02), ViewMarks(right, 4, 0.0, 0.0))).verdict


def test_what_the_marks_show_decides_where_the_parallaxes_show_nothing(liner):
    fits = watched(liner, 0.0)[-1]
    assert with_marks(fits, MarkState.CORRECTED, size_px=0.8) is RigVerdict.CORRECTED
    assert with_marks(fits, MarkState.CORRECTED, size_px=5.0) is RigVerdict.DOUBTFUL
    assert with_marks(fits, MarkState.AT_REST, MarkState.CONTRADICTORY) is RigVerdict.DOUBTFUL
    assert with_marks(fits, MarkState.MOVING) is RigVerdict.DOUBTFUL
    assert with_marks(fits, MarkState.AT_REST) is RigVerdict.FITS
    assert fits.with_marks(None) is fits


def test_marks_at_rest_show_that_a_rig_fits_without_an_object_and_never_hide_a_movement(liner):
    unknown = replace(watched(liner, 0.0)[-1], verdict=RigVerdict.UNKNOWN)
    assert with_marks(unknown, MarkState.AT_REST) is RigVerdict.FITS
    assert with_marks(unknown, MarkState.HIDDEN) is RigVerdict.UNKNOWN
    assert with_marks(watched(liner, 3.0)[-1], MarkState.AT_REST) is RigVerdict.MOVED


def test_what_two_marks_alone_correct_is_doubtful_until_parallaxes_confirm_it(liner):
    fits = watched(liner, 0.0)[-1]
    unknown = replace(fits, verdict=RigVerdict.UNKNOWN)
    for marks, without_parallaxes in ((2, RigVerdict.DOUBTFUL), (3, RigVerdict.CORRECTED)):
        corrected = {"left": MarkState.CORRECTED, "size_px": 0.5, "marks": marks}
        assert with_marks(unknown, **corrected) is without_parallaxes
        assert with_marks(fits, **corrected) is RigVerdict.CORRECTED


def test_the_parallax_taken_off_both_views_leaves_points_where_the_movement_of_one_has_put_them(liner):
    rig, model = Rig.of(liner.setup.calibration), liner.setup.object_model
    images = project_all(rig, model.xyz_mm).transpose(1, 2, 0)
    across = np.array([0.0, 0.5])

    def off_mm(left_px, right_px):
        views = (
            ViewBlobs(image + moved, np.full(image.shape, 0.1))
            for image, moved in zip(images, (left_px, right_px), strict=True)
        )
        return intersect(rig, model.target, *views, ImageNoise(0.1, 1, 1.0)).xyz_mm - model.xyz_mm

    moved, halved = off_mm(across, 0 * across), off_mm(across / 2, across / 2)
    assert np.linalg.norm(moved.mean(axis=0)) > 0.04
    assert halved.mean(axis=0) == pytest.approx(moved.mean(axis=0), abs=0.004)
