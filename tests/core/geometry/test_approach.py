import numpy as np
from hypothesis import given

from core.geometry.rigs import aimed, places
from grabberd.core.geometry import approach, project, rays

LEFT = np.array([0.0, -10.0, 0.0])
RIGHT = np.array([0.0, 10.0, 0.0])


@given(places())
def test_the_rays_of_one_point_meet_in_it(xyz):
    left, right = aimed("left"), aimed("right", handedness=-1)
    met = approach(*rays(left, project(left, xyz)), *rays(right, project(right, xyz)))
    assert np.abs(met.distance_mm).max() < 1e-9
    assert np.abs(met.middle_mm - xyz).max() < 1e-8


def test_rays_that_pass_each_other_are_as_far_apart_as_their_shortest_connection():
    along_x, along_z = np.array([[1.0, 0.0, 0.0]]), np.array([[0.0, 0.0, 1.0]])
    passed = approach(LEFT, along_x, RIGHT, along_z)
    assert abs(passed.distance_mm[0]) == 20.0
    assert np.array_equal(passed.middle_mm[0], [0.0, 0.0, 0.0])


def test_the_side_of_passing_has_a_sign():
    along_x, along_z = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
    assert (
        approach(LEFT, along_x, RIGHT, along_z).distance_mm
        == -approach(RIGHT, along_x, LEFT, along_z).distance_mm
    )


def test_parallel_rays_have_no_meeting_place():
    met = approach(LEFT, np.array([[0.0, 0.0, 1.0]]), RIGHT, np.array([[0.0, 0.0, 1.0]]))
    assert np.isnan(met.distance_mm).all()
    assert np.isnan(met.middle_mm).all()


def test_every_ray_of_one_view_can_be_compared_with_every_ray_of_the_other():
    left, right = aimed("left"), aimed("right")
    xyz = np.array([[x, 0.0, 0.0] for x in (-30.0, 0.0, 30.0)])
    left_center, from_left = rays(left, project(left, xyz))
    right_center, from_right = rays(right, project(right, xyz[:2]))
    met = approach(left_center, from_left[:, np.newaxis], right_center, from_right[np.newaxis])
    assert met.distance_mm.shape == (3, 2)
    assert met.middle_mm.shape == (3, 2, 3)
    near = np.abs(met.distance_mm) < 1.0
    assert np.array_equal(near, [[True, False], [False, True], [False, False]])
