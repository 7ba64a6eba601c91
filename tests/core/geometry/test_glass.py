import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from core.geometry.rigs import aimed, places, views
from grabberd.core.geometry import Plate, project, project_through, seen_through
from grabberd.errors import InputError

GLASS = Plate(3.0, 1.52)
PLATES = st.builds(
    Plate,
    st.floats(0.1, 8.0),
    st.floats(1.0, 1.9),
    st.tuples(st.floats(-0.3, 0.3), st.floats(-0.3, 0.3), st.floats(0.5, 2.0)),
)


def refracted(direction, normal, ratio):
    """Snell's law for a unit direction and a unit normal that points against it."""
    cosine = -direction @ normal
    sine2 = ratio**2 * (1 - cosine**2)
    return ratio * direction + (ratio * cosine - np.sqrt(1 - sine2)) * normal


def traced(plate, start, direction, above_mm):
    """The ray's point and direction behind the plate, whose upper face is at `above_mm` along its normal."""
    normal = plate.unit
    entry = start + direction * ((above_mm - start @ normal) / (direction @ normal))
    inside = refracted(direction, normal, 1 / plate.refractive_index)
    leaves = entry + inside * (-plate.thickness_mm / (inside @ normal))
    return leaves, refracted(inside, normal, plate.refractive_index)


def distance_from_ray(place, start, direction):
    return np.linalg.norm(np.cross(place - start, direction))


@given(plate=PLATES, view=views(), xyz=places(), above_mm=st.floats(30, 120))
def test_a_ray_traced_after_snell_from_where_a_place_seems_to_be_meets_the_place(plate, view, xyz, above_mm):
    center = view.center_mm
    for place, seeming in zip(xyz, seen_through(plate, center, xyz), strict=True):
        toward = (seeming - center) / np.linalg.norm(seeming - center)
        leaves, direction = traced(plate, center, toward, above_mm)
        assert distance_from_ray(place, leaves, direction) < 1e-8


def test_straight_through_a_plate_a_place_seems_nearer_by_t_times_1_minus_1_over_n():
    seeming = seen_through(GLASS, np.array([0.0, 0.0, 240.0]), np.zeros((1, 3)))
    assert seeming[0] == pytest.approx([0, 0, 3 * (1 - 1 / 1.52)])


@given(xyz=places())
def test_a_plate_of_the_mediums_own_index_is_not_there(xyz):
    view = aimed("right")
    xy = project(view, xyz)
    assert project_through(Plate(5.0, 1.0), view, xyz) == pytest.approx(xy, abs=1e-9)


@given(xyz=places())
def test_the_normals_sign_and_length_do_not_matter(xyz):
    view = aimed("left")
    one, other = Plate(3.0, 1.52, (0.1, 0.2, 1.0)), Plate(3.0, 1.52, (-0.2, -0.4, -2.0))
    assert project_through(one, view, xyz) == pytest.approx(project_through(other, view, xyz), abs=1e-9)


def test_a_plate_put_in_shifts_the_picture_by_more_than_a_pixel():
    corners = np.array([[x, y, 0.0] for x in (-50, 50) for y in (-25, 25)])
    view = aimed("left")
    moved = project_through(GLASS, view, corners) - project(view, corners)
    assert 1.0 < np.linalg.norm(moved, axis=1).mean() < 2.0


@pytest.mark.parametrize("wrong", [(0.0, 1.5), (-1.0, 1.5), (3.0, 0.9), (3.0, 1.5, (0.0, 0.0, 0.0))])
def test_what_is_no_plate_is_refused(wrong):
    with pytest.raises(InputError, match="invalid plate"):
        Plate(*wrong)
