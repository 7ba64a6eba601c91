"""The open wall, and targets on it that one view alone sees, against walls that were solved as solids."""

from dataclasses import replace

import numpy as np
import pytest

from grabberd_liner.analysis.load.mounting import Mounting
from liner.analysis.walls import outermost_alone, rig, solved_six

SIGMA_MM = np.array([0.02, 0.02, 0.05])


def mounting(liner, points):
    return Mounting.of(liner.grid, liner.zones()[0].material, points, rig())


def within_face(mounted, places_mm):
    """(N, 2) how far targets are glued from where they are, along the liner and round it."""
    targets, radius_mm = mounted.targets, mounted.half.tube.radius_mm
    round_mm = radius_mm * np.arctan2(places_mm[:, 1], places_mm[:, 2])
    return np.column_stack([targets.x_mm - places_mm[:, 0], targets.s_mm - round_mm])


@pytest.fixture(scope="module", params=["reference-round", "tapered-round"])
def drawn(request):
    """Errors of targets in many reference states with noise, and what σ says of them."""
    liner = solved_six(request.param)
    places_mm = liner.places_mm(0.0)
    exact = mounting(liner, outermost_alone(liner, places_mm, 1e-6 * SIGMA_MM, np.random.default_rng(9)))
    mounts = [
        mounting(liner, outermost_alone(liner, places_mm, SIGMA_MM, np.random.default_rng(seed)))
        for seed in range(12)
    ]
    return liner, exact, mounts


def test_targets_of_one_view_are_glued_where_they_are(drawn):
    liner, exact, _ = drawn
    off = within_face(exact, liner.places_mm(0.0)).reshape(-1, 6, 2)
    # Along the liner, all of a row have been moved as far as a tapered wall slides until it is at rest.
    off[..., 0] -= off[:, 2:4, 0].mean(axis=1, keepdims=True)
    assert np.abs(off[:, [0, 5]]).max() < 0.03


def test_sigma_of_where_they_are_glued_holds(drawn):
    liner, exact, mounts = drawn
    count = len(liner.grid)
    sigma = np.sqrt(np.diagonal(mounts[0].shared_mm2).reshape(count, 3))
    off = np.stack([one.targets.x_mm - exact.targets.x_mm for one in mounts])
    ratio = (off / sigma[:, 0])[:, ~liner.inner]
    assert 0.7 < np.mean(ratio**2) < 1.3


def test_a_target_that_no_view_sees_in_the_reference_state_is_uncertain_by_its_glueing(drawn):
    liner, _, _ = drawn
    points = outermost_alone(liner, liner.places_mm(0.0), SIGMA_MM, np.random.default_rng(0))
    unseen = mounting(liner, replace(points, single=None))
    sigma = np.sqrt(np.diagonal(unseen.shared_mm2).reshape(-1, 3))
    assert sigma[~liner.inner, 0] == pytest.approx(0.3)
    assert sigma[liner.inner, 0] == pytest.approx(SIGMA_MM[0])
