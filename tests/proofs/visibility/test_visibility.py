"""Closing walls of six to nine columns: what both views show is found, and nothing else is taken for it."""

import numpy as np
import pytest

from proofs.visibility.closing_wall import Closing
from proofs.visibility.judging import Film, Judged, visible
from proofs.visibility.wall_pictures import eyes

ROWS, FIELDS = 9, range(4, 15)
"""Fields in which the wall closes, within two of them, and is identified anew."""
SCENES = (
    Closing(6, 0.035, 21, stroke_mm=5.0, turned_deg=90.0),
    Closing(7, 0.035, 22),
    Closing(8, 0.035, 23, stroke_mm=5.0, turned_deg=60.0, waist=0.2, exposure_ms=4.0),
    Closing(9, 0.035, 24, stroke_mm=6.0, turned_deg=45.0),
)


@pytest.fixture(scope="module", params=SCENES, ids=lambda scene: f"{scene.columns} columns")
def film(request):
    return Film(request.param, FIELDS)


@pytest.mark.parametrize("bits", [8, 1])
def test_what_both_views_show_is_found_and_no_blob_is_anothers(film, bits):
    judged = film.judged(bits)
    assert (judged.wrong, judged.robbed) == (0, 0)
    assert judged.visible >= 250
    assert judged.share >= 0.999
    assert 0.75 <= judged.chi2 <= 1.25  # a few hundred points of one scene


def test_the_coverage_says_of_every_target_whether_it_was_expected_and_why_not(film):
    _, tally = film.measured()
    coverage = tally.result()
    assert (coverage.expected + coverage.unexpected.sum(axis=1) == len(FIELDS)).all()
    assert coverage.share >= 0.999


def test_of_seven_columns_those_behind_are_told_to_be_turned_away():
    _, tally = Film(SCENES[1], range(3)).measured()
    unexpected = tally.result().unexpected.sum(axis=1).reshape(ROWS, 7)
    assert (unexpected[:, [0, 6]] == 3).all()
    assert (unexpected[:, 1:6] == 0).all()


def test_counts_of_parts_add_up():
    parts = [Judged(visible=2, missing=1, worst_mm=0.5), Judged(visible=2, worst_mm=0.2)]
    assert Judged.sum_of(parts) == Judged(visible=4, missing=1, worst_mm=0.5)
    assert Judged.sum_of(parts).share == 0.75


@pytest.mark.parametrize("scene", SCENES, ids=lambda scene: f"{scene.columns} columns")
@pytest.mark.parametrize("mirrored", [False, True])
def test_the_wall_hides_its_far_side_and_never_what_faces_a_view(scene, mirrored):
    """The march along rays, and the normals, know nothing of one another."""
    time_s = 0.3
    centre, normal = scene.discs(time_s)
    for eye in eyes(mirrored):
        sight = eye.camera.center - centre
        tilt_deg = np.rad2deg(np.arccos((sight * normal).sum(axis=1) / np.linalg.norm(sight, axis=1)))
        hidden = scene.hidden(time_s, centre + 0.03 * normal, eye.camera.center)
        assert hidden[tilt_deg > 100.0].all()
        assert not hidden[tilt_deg < 80.0].any()


def test_a_wall_keeps_the_distances_round_it():
    scene = SCENES[2]
    for time_s in (0.0, 0.3):
        places = scene.discs(time_s)[0].reshape(ROWS, scene.columns, 3)
        apart = np.linalg.norm(np.diff(places, axis=1), axis=2)
        assert (np.abs(apart - 6.4) < 0.6).all()  # chords of arcs of 6.3 to 6.7 mm


def test_a_disc_of_the_picture_lies_where_its_centre_is_projected():
    scene = SCENES[1]
    film = Film(scene, range(1), mirrored=False)
    for eye, seen in zip(eyes(False), film.seen[0], strict=True):
        picture = eye.picture(scene, 0.0, 1e-6)
        for x, y in seen.image_px[visible(film.seen[0])[0]]:
            column, line = round(x), round(y)
            window = picture[line - 5 : line + 6, column - 4 : column + 5]
            lines, columns = np.mgrid[line - 5 : line + 6, column - 4 : column + 5]
            assert (window * columns).sum() / window.sum() == pytest.approx(x, abs=0.05)
            assert (window * lines).sum() / window.sum() == pytest.approx(y, abs=0.05)
