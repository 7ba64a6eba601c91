"""Which targets a view cannot show follows from the wall that they form: round, folded or edge on."""

from dataclasses import replace

import numpy as np
import pytest

from core.geometry.rigs import calibration
from grabberd.core.geometry import Rig, project_all
from grabberd.core.reconstruction import Correspondence, ImageNoise, ObjectModel
from grabberd.core.reconstruction.correspondence.facing import TURNED_AWAY_DEG, Facing
from grabberd.core.reconstruction.points import Miss, ViewBlobs

RIG = Rig.of(calibration())
CENTER_MM = RIG.center_mm[:, :, 0]
ROWS, PITCH_MM, RADIUS_PX = 4, 6.5, 2.8


def model(section):
    """Rows along X of targets at (C, 2) Y and Z."""
    columns = len(section)
    row, column = (each.ravel().astype(np.int32) for each in np.indices((ROWS, columns)))
    places = np.column_stack([PITCH_MM * (row - (ROWS - 1) / 2), section[column]])
    return ObjectModel("wall", np.arange(len(row), dtype=np.int32), places, row, column, 1.5, 0.3)


def circle(columns, radius_mm=14.5):
    angle = PITCH_MM / radius_mm * (np.arange(columns) - (columns - 1) / 2)
    return radius_mm * np.column_stack([np.sin(angle), np.cos(angle) - 0.5])


def unseen(known, radius_px=RADIUS_PX):
    return Facing(RIG, known, radius_px).unseen(known.xyz_mm, project_all(RIG, known.xyz_mm))


@pytest.mark.parametrize("columns", range(6, 15))
def test_of_a_round_wall_those_are_turned_away_whose_radius_points_aside(columns):
    known = model(circle(columns))
    sight = CENTER_MM[:, np.newaxis] - known.xyz_mm
    radial = known.xyz_mm * (0, 1, 1) + (0, 0, 14.5 / 2)
    cosine = (sight * radial).sum(axis=2) / np.linalg.norm(sight, axis=2) / 14.5
    clear = np.abs(np.rad2deg(np.arccos(cosine)) - TURNED_AWAY_DEG) > 5.0  # the edge's normal is a parabola's
    turned = cosine < np.cos(np.deg2rad(TURNED_AWAY_DEG))
    found = unseen(known)
    assert (found == Miss.TURNED_AWAY)[clear].tolist() == turned[clear].tolist()
    assert not (found == Miss.HIDDEN).any()


def test_the_side_does_not_depend_on_how_rows_and_columns_are_numbered():
    known = model(circle(9))
    other = replace(known, column=np.int32(8) - known.column)
    assert np.array_equal(unseen(known), unseen(other))


def test_what_lies_in_a_fold_behind_the_wall_is_hidden_and_the_front_is_not():
    """An S: the flap in front, the way back under it, and what it covers, which faces again."""
    front = [[y, 10.0] for y in (-13.0, -6.5, 0.0, 6.5, 13.0)]
    return_way = [[y, 5.0] for y in (13.0, 6.5, 0.0)]
    behind = [[y, 0.0] for y in (0.0, 6.5, 13.0, 19.5, 26.0)]
    found = unseen(model(np.array([*front, *return_way, *behind]))).reshape(2, ROWS, 13)
    assert (found[:, :, :4] == Miss.FOUND).all()
    assert (found[:, :, 6] == Miss.TURNED_AWAY).all()
    assert (found[:, :, 9] == Miss.HIDDEN).all()
    assert (found[:, :, 12] == Miss.FOUND).all()


def test_neighbours_whose_images_touch_are_merged_in_that_view_alone():
    """A plane wall seen from its edge by the right view: turned, but not away."""
    angle = np.deg2rad(-60.0)
    section = PITCH_MM * np.outer(np.arange(-2, 3), [np.cos(angle), np.sin(angle)])
    left, right = unseen(model(section), radius_px=8.0)
    assert (left == Miss.FOUND).all() != (right == Miss.FOUND).all()
    assert {*left.tolist(), *right.tolist()} == {Miss.FOUND, Miss.MERGED}


def test_a_narrow_image_beside_one_that_is_turned_away_is_crowded():
    seen = unseen(model(circle(8, radius_mm=17.0)))
    crowded = (seen == Miss.CROWDED).reshape(2, ROWS, 8).any(axis=1)
    assert np.array_equal(crowded[0], crowded[1, ::-1])
    assert not crowded[:, 2:6].any()


def test_a_row_alone_has_no_normal_and_may_face_anywhere():
    known = model(circle(9))
    row = known.row == 0
    columns = {name: getattr(known, name)[row] for name in ("target", "xyz_mm", "row", "column")}
    assert (unseen(replace(known, **columns)) != Miss.TURNED_AWAY).all()


@pytest.mark.parametrize("kernel", [True, False])
def test_a_target_that_faces_away_is_not_given_its_neighbours_blob(kernel):
    """The last column faces away from the left view; its neighbour's blob lies where it is predicted."""
    known = model(circle(8))
    noise = ImageNoise.of(RIG, known, 0.12, 2)
    judge = Correspondence(RIG, known, noise, **({} if kernel else {"kernel": None}))
    image = project_all(RIG, known.xyz_mm)
    last, beside = known.column == 7, known.column == 6
    shown = [image[:, 0, ~last].T.copy(), image[:, 1].T]
    shown[0][beside[~last]] = image[:, 0, last].T
    blobs = [ViewBlobs(xy, np.full_like(xy, 0.1), np.full(len(xy), 0.05), 3.0) for xy in shown]
    sighting = judge.near(known.xyz_mm, np.full(len(known), 0.3), *blobs)
    assert not last[sighting.target].any()
    assert (sighting.misses[last] == Miss.TURNED_AWAY).all()
