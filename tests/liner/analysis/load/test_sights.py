"""Sights of points and of rays put together."""

import numpy as np
import pytest

from grabberd_liner.analysis.load.targets import Sights

PLACES = np.array([[1.0, 2.0, 3.0], [np.nan, np.nan, np.nan], [4.0, 5.0, 6.0]])
COVARIANCES = np.tile(np.diag([1.0, 4.0, 9.0]), (3, 1, 1))


def test_a_point_gives_three_sights_and_one_that_is_not_seen_none():
    sights = Sights.of_points(PLACES, COVARIANCES)
    assert sights.target.tolist() == [0, 0, 0, 2, 2, 2]
    assert sights.value.tolist() == [1, 2, 3, 4, 5, 6]
    assert np.diagonal(sights.covariance).tolist() == [1, 4, 9, 1, 4, 9]


def test_joined_sights_do_not_correlate():
    points = Sights.of_points(PLACES, COVARIANCES)
    ray = Sights(np.array([1]), np.array([[0.0, 0.6, 0.8]]), np.array([7.0]), np.array([[2.0]]))
    both = points.joined(ray)
    assert len(both) == 7
    assert np.array_equal(both.covariance[:6, :6], points.covariance)
    assert both.covariance[6, 6] == 2.0
    assert not both.covariance[6, :6].any()


def test_a_shared_covariance_correlates_sights_as_it_does_their_places():
    random = np.random.default_rng(0)
    root = random.normal(size=(9, 9))
    ray = Sights(np.array([1]), np.array([[0.0, 0.6, 0.8]]), np.array([7.0]), np.array([[2.0]]))
    sights = Sights.of_points(PLACES, COVARIANCES).joined(ray)
    moved = root @ random.normal(size=(9, 200_000))
    of_sights = np.einsum("mi,min->mn", sights.direction, moved.reshape(3, 3, -1)[sights.target])
    added = sights.shared(root @ root.T).covariance - sights.covariance
    assert np.abs(np.cov(of_sights) - added).max() < 0.02 * np.abs(added).max()


@pytest.mark.parametrize(
    "ray", [None, Sights(np.array([1]), np.array([[0.0, 0.6, 0.8]]), np.array([7.0]), np.array([[2.0]]))]
)
def test_places_are_turned_into_sights_alike_whether_they_are_picked_or_projected(ray):
    points = Sights.of_points(PLACES, COVARIANCES)
    sights = points.joined(ray) if ray else points
    places = np.random.default_rng(0).normal(size=(5, 9))
    seen = sights.of_places(places)
    assert np.allclose(seen, places @ sights.directions(3).toarray().T, atol=1e-15)
    assert not np.shares_memory(seen, places)


def test_a_sight_along_an_axis_the_other_way_is_no_place_that_can_be_picked():
    against = Sights(np.array([0]), np.array([[0.0, 0.0, -1.0]]), np.array([7.0]), np.array([[2.0]]))
    assert against.of_places(np.arange(6.0).reshape(1, 6)).tolist() == [[-2.0]]
