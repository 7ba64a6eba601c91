from dataclasses import replace

import numpy as np
import pytest

from core.calibration.networks import THREE, TRUE, frame, network, turned
from grabberd.core.calibration.adjustment.adjustment import adjust
from grabberd.core.calibration.adjustment.network import Unknowns
from grabberd.core.calibration.adjustment.starting_values import POSE, pose, with_starting_values
from grabberd.core.geometry import PARAMETERS, project, rotation_matrix
from grabberd.errors import MeasurementError

PLACES = frame(6, 5)
FLAT = np.array([[0.0, 40.0, 0.0], [40.0, 40.0, 0.0], [0.0, 0.0, 0.0], [40.0, 0.0, 0.0]])


def blank(view):
    """A view of which only the interior is known, roughly."""
    plain = view.with_vector(np.array([1.05 * view.f_mm, 359.5, 287.5, *np.zeros(15)]))
    return plain.with_axes(np.diag([view.handedness, 1.0, 1.0]))


def lost(views=THREE, known=range(6), seed=1):
    """A network of which only image points and the positions of a few targets are known."""
    sigma_mm = np.full(PLACES.shape, np.inf)
    sigma_mm[list(known)] = 0.0
    given = network(views, PLACES, target_sigma_mm=sigma_mm, seed=seed, start=[blank(one) for one in views])
    return replace(given, target_mm=np.where(np.isinf(sigma_mm), 0.0, PLACES))


@pytest.mark.parametrize("seed", range(4))
def test_nothing_but_image_points_and_a_few_known_targets_leads_to_the_truth(seed):
    views = tuple(replace(view, b=(0.0,) * 9) for view in THREE)
    given = lost(views, known=(0, 4, 7, 12, 17, 21, 25, 29), seed=seed)
    given = given.select(np.random.default_rng(seed).random(len(given)) > 0.1 * (given.view == 1))
    started = with_starting_values(given)
    for found, true in zip(started.views, views, strict=True):
        assert np.abs(project(found, PLACES) - project(true, PLACES)).max() < 40
    adjusted = adjust(started, Unknowns.of(views, (*PARAMETERS[:3], *POSE)))
    assert adjusted.sigma0 == pytest.approx(1.0, abs=0.35)
    assert np.abs(adjusted.xyz_mm - PLACES).max() < 1.0


def test_targets_found_by_some_views_help_to_find_the_next():
    views = (*TRUE, turned(TRUE[0], "upper", 0.4))
    given = lost(views, known=range(10))
    hidden = (given.view == 2) & (given.target < 8)  # the third view sees two known targets only
    started = with_starting_values(given.select(~hidden))
    assert np.linalg.norm(started.views[2].center_mm - views[2].center_mm) < 30


@pytest.mark.parametrize("handedness", [1, -1])
@pytest.mark.parametrize("places", [FLAT, PLACES[::4]], ids=["four in a plane", "many in space"])
def test_a_pose_is_found_whatever_the_orientation(handedness, places):
    rng = np.random.default_rng(2)
    for _ in range(20):
        turn = rotation_matrix(*rng.uniform(-0.8, 0.8, 2), rng.uniform(-3, 3))
        center = places.mean(axis=0) + turn.T @ [*rng.uniform(-15, 15, 2), 240.0]
        view = replace(TRUE[0], b=(0.0,) * 9).with_axes(np.diag([handedness, 1.0, 1.0]) @ turn)
        view = replace(view, X0_mm=center[0], Y0_mm=center[1], Z0_mm=center[2])
        start = replace(blank(view), f_mm=view.f_mm, x0_px=view.x0_px, y0_px=view.y0_px)
        found = pose(start, places, project(view, places))
        assert np.abs(found.axes - view.axes).max() < 1e-6
        assert np.abs(found.center_mm - view.center_mm).max() < 1e-4


def test_too_few_known_targets_are_refused_with_the_views_names():
    with pytest.raises(MeasurementError, match="no pose was found for views left, right, upper"):
        with_starting_values(lost(known=range(3)))
    with pytest.raises(MeasurementError, match="4 targets do not determine the pose of view left"):
        pose(TRUE[0], np.outer(np.arange(4.0), [10.0, 0.0, 0.0]), np.zeros((4, 2)))


def test_a_target_that_one_view_alone_sees_is_named():
    given = lost()
    with pytest.raises(MeasurementError, match="targets 20 are not seen from two directions"):
        with_starting_values(given.select((given.target != 20) | (given.view == 0)))
