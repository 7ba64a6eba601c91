"""Which blob is which target of the calibration frame, without any click."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core.calibration.sights import FRAME, NOMINAL, placed, roughly, see
from grabberd.core.calibration.identification.frame_identification import (
    IdentificationSettings,
    identify_frame,
)
from grabberd.core.geometry import project
from grabberd.core.reconstruction import ObjectModel
from grabberd.errors import AmbiguousView, MeasurementError

sign = st.sampled_from([1, -1])


def frame_of(xyz_mm) -> ObjectModel:
    """A calibration frame with other places; its rows and columns mean nothing."""
    count = len(xyz_mm)
    number = np.arange(count, dtype=np.int32)
    return ObjectModel("other", number, xyz_mm, number, np.zeros(count, np.int32), 1.5, 0.01)


def scene(seed, handedness=(1, 1), turned_deg=0.0, nominal=NOMINAL, **seeing):
    rng = np.random.default_rng(seed)
    views = placed(rng, handedness, turned_deg, nominal)
    return views, [see(rng, view, **seeing) for view in views]


def identify(sights, nominal=NOMINAL, frame=FRAME, settings=None):
    return identify_frame(nominal, frame, sights[0].xy_px, sights[1].xy_px, settings)


def assert_right(identification, sights):
    """No target is wrong, none is missing; a false blob may pass where it lies on a missing target."""
    for found, sight in zip(identification, sights, strict=True):
        real = sight.target >= 0
        wrong = real & (found.target >= 0) & (found.target != sight.target)
        assert not wrong.any()
        assert (found.target[real] < 0).sum() <= 2
        assert (found.target[~real] >= 0).sum() <= 1
        assert found.rms_px < 0.3


@pytest.mark.slow
@settings(max_examples=4, derandomize=True)
@given(st.integers(0, 10**6), sign, sign, st.sampled_from([0, 90, 180, 270]))
def test_every_target_is_found_whatever_the_rig_and_however_the_frame_stands(seed, left, right, turned):
    _, sights = scene(seed, (left, right), turned)
    nominal = roughly(np.random.default_rng(seed))
    found = identify(sights, nominal)
    assert_right(found, sights)
    assert found.handedness == (left, right)


def test_the_views_found_see_the_targets_where_they_are_seen():
    views, sights = scene(1, (1, -1))
    found = identify(sights)
    for view, side, sight in zip(views, (found.left, found.right), sights, strict=True):
        off = np.linalg.norm(project(side.view, FRAME.xyz_mm) - project(view, FRAME.xyz_mm), axis=1)
        assert np.median(off) < 0.2
        assert side.residual_px.shape == sight.xy_px.shape
        np.testing.assert_array_equal(np.isnan(side.residual_px[:, 0]), side.target < 0)
        np.testing.assert_array_equal(side.unmatched, np.flatnonzero(side.target < 0))
    assert (found.views[0].handedness, found.views[1].handedness) == (1, -1)


def test_the_winner_is_described_and_compared_with_the_runner_up():
    _, sights = scene(2, (-1, -1), turned_deg=180)
    left = identify(sights).left
    assert "handedness -1" in left.description
    assert "blobs explained to 0." in left.description
    assert left.margin > 200
    assert left.runner_up_targets < 0.8 * len(FRAME)
    assert left.rms_px < left.runner_up_rms_px


def test_half_of_the_frame_is_enough_where_its_depths_differ():
    _, sights = scene(3)
    sights = [sight.within(150, 420) for sight in sights]
    assert_right(identify(sights), sights)


def test_a_frame_without_any_grid_is_identified_too():
    rng = np.random.default_rng(4)
    frame = frame_of(rng.uniform(-1, 1, (60, 3)) * (50.0, 25.0, 10.0))
    _, sights = scene(4, frame=frame)
    found = identify(sights, frame=frame)
    for side, sight in zip((found.left, found.right), sights, strict=True):
        real = (sight.target >= 0) & (side.target >= 0)
        np.testing.assert_array_equal(side.target[real], sight.target[real])
        assert real.sum() > 0.85 * (sight.target >= 0).sum()


def test_a_planar_frame_of_which_the_ends_are_not_seen_is_ambiguous():
    flat = frame_of(FRAME.xyz_mm * (1.0, 1.0, 0.0))
    _, sights = scene(5, frame=flat)
    with pytest.raises(
        AmbiguousView, match=r"does not tell how .* stands: turned by 0 degrees or turned by 180"
    ) as raised:
        identify([sight.within(150, 420) for sight in sights], frame=flat)
    assert "looks the same" in raised.value.hint
    assert "more depth" in raised.value.hint
    assert raised.value.asks
    assert raised.value.turns == {}


@pytest.mark.slow
def test_another_calibration_frame_than_the_files_is_refused():
    rng = np.random.default_rng(6)
    other = np.column_stack([FRAME.xyz_mm[:, :2], rng.permutation(FRAME.xyz_mm[:, 2])])
    _, sights = scene(6)
    with pytest.raises(
        MeasurementError, match=r"does not show the calibration frame other: of its \d+ blobs"
    ):
        identify(sights, frame=frame_of(other))


def test_a_base_that_is_far_from_nominal_is_refused():
    _, sights = scene(7)
    narrow = replace(NOMINAL, base_mm=85.0, convergence_deg=20.0)
    with pytest.raises(MeasurementError, match=r"base comes out as 1\d\d mm, but the nominal rig has 85 mm"):
        identify(sights, narrow)


@pytest.mark.slow
@pytest.mark.parametrize("handedness", [1, -1])
def test_swapped_views_are_called_swapped(handedness):
    crossed = replace(NOMINAL, base_mm=-NOMINAL.base_mm)
    _, sights = scene(8, (handedness, handedness), nominal=crossed)
    with pytest.raises(MeasurementError, match="the views are swapped"):
        identify(sights)


@pytest.mark.slow
def test_exchanged_columns_are_swapped_views():
    _, sights = scene(9)
    exchanged = replace(NOMINAL, left=NOMINAL.right, right=NOMINAL.left)
    with pytest.raises(MeasurementError, match="the views are swapped"):
        identify(sights[::-1], exchanged)


def test_a_handedness_that_the_picture_contradicts_is_refused():
    _, sights = scene(10, (1, 1))
    with pytest.raises(
        MeasurementError, match=r"shows the right view mirrored: of handedness \+1, \+1 .* where \+1, -1"
    ):
        identify(sights, settings=IdentificationSettings(handedness=(1, -1)))


def test_a_stated_handedness_that_is_right_changes_nothing():
    _, sights = scene(11, (1, -1))
    found = identify(sights, settings=IdentificationSettings(handedness=(1, -1)))
    assert_right(found, sights)


def test_a_dark_view_is_named():
    _, sights = scene(12)
    with pytest.raises(MeasurementError, match="the right view is dark: it shows no blobs"):
        identify([sights[0], sights[1].first(0)])


def test_too_few_blobs_are_counted():
    _, sights = scene(13)
    with pytest.raises(MeasurementError, match="the left view shows 9 blobs, at least 12 are needed"):
        identify([sights[0].first(9), sights[1]])


@pytest.mark.slow
def test_blobs_at_random_are_no_calibration_frame():
    rng = np.random.default_rng(14)
    left, right = rng.uniform((0, 0), (359, 575), (90, 2)), rng.uniform((360, 0), (719, 575), (90, 2))
    with pytest.raises(MeasurementError, match="the left view"):
        identify_frame(NOMINAL, FRAME, left, right)
