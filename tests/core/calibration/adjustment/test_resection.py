"""One view from known targets, with prior knowledge of all its parameters."""

from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from core.geometry.rigs import aimed, views
from grabberd.core.calibration.adjustment.starting_values import resect
from grabberd.core.geometry import View, project

RNG = np.random.default_rng(7)
PLACES = np.column_stack([RNG.uniform(-55, 55, 60), RNG.uniform(-26, 26, 60), RNG.uniform(-8, 8, 60)])


def moved(view: View, share: float) -> View:
    values = view.vector()
    values[:9] += share * np.array([0.3, 8.0, -8.0, 0.1, -0.1, 0.1, 10.0, -10.0, 15.0])
    return replace(view.with_vector(values), b=(0.0,) * 9)


@settings(max_examples=25)
@given(views(), st.floats(-1, 1))
def test_targets_are_seen_again_where_they_were_seen(view, share):
    found = resect(moved(view, share), PLACES, project(view, PLACES), 0.3)
    assert found.distance_px.max() < 0.3
    assert found.view.handedness == view.handedness


def test_an_outlier_draws_little():
    view = aimed("left")
    seen = project(view, PLACES)
    seen[5] += (6.0, -5.0)
    found = resect(moved(view, 0.5), PLACES, seen, 0.3)
    assert found.distance_px[5] > 7.0
    assert np.delete(found.distance_px, 5).max() < 0.3


def test_a_planar_frame_gives_a_view_too():
    view, flat = aimed("right"), PLACES * (1.0, 1.0, 0.0)
    found = resect(moved(view, 0.5), flat, project(view, flat), 0.3)
    assert found.distance_px.max() < 0.1


def test_no_targets_leave_the_start_as_it_is():
    start = aimed("left")
    found = resect(start, np.empty((0, 3)), np.empty((0, 2)), 0.3)
    np.testing.assert_array_equal(found.view.vector(), start.vector())


def test_the_prior_holds_what_the_targets_do_not_determine():
    """Three targets say nothing of the lens."""
    view, prior = aimed("left"), moved(aimed("left"), 0.3)
    found = resect(prior, PLACES[:3], project(view, PLACES[:3]), 0.3)
    assert abs(found.view.f_mm - prior.f_mm) < 0.3
    assert found.distance_px.max() < 0.2


def test_a_target_behind_the_camera_is_infinitely_far_off():
    behind = np.vstack([PLACES, [0.0, 0.0, 500.0]])
    seen = np.vstack([project(aimed("left"), PLACES), [100.0, 100.0]])
    found = resect(moved(aimed("left"), 0.3), behind, seen, 0.3)
    assert np.isinf(found.distance_px[-1])
    assert found.distance_px[:-1].max() < 0.1
