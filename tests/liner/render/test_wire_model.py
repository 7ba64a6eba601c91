"""Wire models: what is near hides what is far, colours stand for values, axes have round numbers."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from grabberd_liner.analysis.surface.surface import Mesh
from grabberd_liner.render.wire_model import (
    PAPER,
    PLAIN,
    SIDES,
    UNKNOWN,
    Box,
    Look,
    Painted,
    Scale,
    ticks,
    wire_model,
)
from liner.analysis.exact import exact_surface
from liner.analysis.shapes import cylinder, sheet

SIZE = (400, 300)


def drawn(shape, side, columns=6, **how):
    mesh = Mesh.of(exact_surface(shape, columns=columns))
    painted = how.pop("painted", None)
    if painted:
        painted = painted(mesh)
    return wire_model(
        mesh, 1.0, Box.round(mesh.xyz_mm.reshape(-1, 3)), Look(*SIDES[side], *SIZE), painted, **how
    )


def close(picture, colour, within=12):
    return (np.abs(picture.astype(float) - colour) <= within).all(axis=2)


def test_a_plane_from_above_is_its_grid_on_an_even_face():
    picture = drawn(sheet, "top")
    face, dark = close(picture, np.array(PLAIN) * 0.93, 25), picture.mean(axis=2) < 150
    assert face.mean() > 0.15
    assert 6 <= (dark.mean(axis=1) > 0.25).sum() <= 12
    assert 8 <= (dark.mean(axis=0) > 0.25).sum() <= 16
    assert close(picture, PAPER, 0)[0].any()


def test_a_plane_from_the_side_is_a_line():
    picture = drawn(sheet, "side")
    assert 0 < (picture.mean(axis=2) < 150)[:, 80:200].any(axis=1).sum() < 40


def round_tube(u, v):
    return cylinder(29.25 / np.pi, u, v)


def by_height(mesh):
    z = mesh.xyz_mm[..., 2]
    middle = (z[:-1, :-1] + z[1:, 1:]) / 2
    return Painted(middle, Scale("z mm", -10.0, 10.0))


@pytest.mark.parametrize(("elevation", "bright"), [(90.0, True), (-90.0, False)])
def test_the_near_half_of_a_tube_hides_the_far_one(elevation, bright):
    mesh = Mesh.of(exact_surface(round_tube, columns=9))
    box = Box.round(mesh.xyz_mm.reshape(-1, 3))
    picture = wire_model(mesh, 1.0, box, Look(-90.0, elevation, *SIZE), by_height(mesh))
    middle = picture[140:160, 120:200].reshape(-1, 3).astype(int)
    coloured = middle[np.ptp(middle, axis=1) > 40]
    assert len(coloured) > 300
    yellow = (coloured[:, 2] > 120) & (coloured[:, 1] > 120)
    assert (yellow.mean() > 0.9) == bright
    assert (yellow.mean() < 0.1) != bright


def test_unknown_values_are_grey_and_those_beyond_the_scale_have_its_last_colours():
    scale = Scale("anything", 0.0, 1.0)
    colours = scale.colours(np.array([np.nan, -5.0, 0.0, 1.0, 7.0]))
    assert tuple(colours[0]) == UNKNOWN
    assert (colours[1] == colours[2]).all()
    assert (colours[3] == colours[4]).all()
    assert (colours[2] != colours[3]).any()


def test_a_scale_over_equal_or_no_values_can_be_drawn():
    for values in (np.full(5, 3.0), np.full(5, np.nan)):
        scale = Scale.over("x", values)
        assert scale.high > scale.low
        assert np.isfinite(scale.colours(values)).all()


@given(st.floats(-1e4, 1e4), st.floats(1e-3, 1e4))
def test_ticks_are_few_round_and_inside(low, span):
    high = low + span
    found = np.array(ticks(low, high))
    assert 2 <= len(found) <= 7
    assert (found >= low - 1e-6 * span).all()
    assert (found <= high + 1e-6 * span).all()
    assert np.ptp(np.diff(found), axis=0) < 1e-6 * span
    step = np.diff(found)[0]
    assert np.abs(found / step - np.round(found / step)).max() < 1e-6 * max(1.0, np.abs(found / step).max())


def test_a_box_has_whole_tens_round_all_that_is_known():
    box = Box.round(np.array([[-12.0, 3.0, 0.0], [np.nan] * 3, [31.0, 9.9, 10.0]]))
    assert (box.low == [-20, 0, 0]).all()
    assert (box.high == [40, 10, 10]).all()


def test_without_a_mesh_the_box_is_there_and_nothing_in_it():
    box = Box(np.zeros(3), np.full(3, 10.0))
    picture = wire_model(None, 1.0, box, Look(*SIDES["oblique"], *SIZE), caption="nothing")
    assert not close(picture, PAPER, 0).all()
    assert (np.ptp(picture.astype(int), axis=2) < 20).all()
