"""Sights of points and of rays put together."""

import numpy as np

from grabberd.analysis.load.mounted.sights import Sights

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
