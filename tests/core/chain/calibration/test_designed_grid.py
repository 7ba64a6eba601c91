"""A calibration frame from rows, columns, pitch and steps in depth."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from core.chain.sized_pictures import Picture, fields
from grabberd.core.calibration.calibration_frame import symmetries
from grabberd.core.chain.calibration.designed_grid import (
    Along,
    GridDesign,
    calibration_frame_remarks,
    designed_grid,
)
from grabberd.core.chain.calibration.frame_capture import identify
from grabberd.errors import InputError


def design(**other):
    return GridDesign(**({"name": "stand", "rows": 12, "columns": 9, "pitch_mm": 6.5} | other))


@settings(max_examples=25, deadline=None)
@given(
    rows=st.integers(1, 15),
    columns=st.integers(1, 15),
    pitch_mm=st.floats(2, 50),
    row_pitch_mm=st.none() | st.floats(2, 50),
    depth_mm=st.floats(0, 40),
    depth_steps=st.integers(2, 9),
    along=st.sampled_from(Along),
)
def test_targets_lie_on_the_grid_about_the_origin(**given_design):
    wanted = design(**given_design)
    model = designed_grid(wanted)
    assert model.target.tolist() == list(range(1, wanted.rows * wanted.columns + 1))
    assert model.xyz_mm[:, :2].mean(axis=0) == pytest.approx([0, 0], abs=1e-3)
    down, across = model.xyz_mm[model.row > 0], model.xyz_mm[model.column > 0]
    up, beside = model.xyz_mm[model.row < wanted.rows - 1], model.xyz_mm[model.column < wanted.columns - 1]
    assert np.allclose(down[:, 0] - up[:, 0], wanted.row_pitch_mm or wanted.pitch_mm, atol=2e-4)
    assert np.allclose(across[:, 1] - beside[:, 1], wanted.pitch_mm, atol=2e-4)
    assert len(np.unique(model.xyz_mm[:, 2])) <= wanted.depth_steps
    assert np.ptp(model.xyz_mm[:, 2]) <= wanted.depth_mm + 1e-3


@pytest.mark.parametrize("along", Along)
def test_steps_use_the_whole_depth_in_equal_heights(along):
    model = designed_grid(design(depth_mm=16, depth_steps=5, along=along))
    assert np.unique(model.xyz_mm[:, 2]).tolist() == [-8, -4, 0, 4, 8]
    if along is not Along.TARGETS:
        every = model.row if along is Along.ROWS else model.column
        assert all(len(np.unique(model.xyz_mm[every == one, 2])) == 1 for one in every)


def test_a_frame_of_single_depths_has_no_symmetry_and_nothing_is_remarked():
    model = designed_grid(design(depth_mm=16))
    assert symmetries(model) == ()
    assert not list(calibration_frame_remarks(model))


@settings(max_examples=25, deadline=None)
@given(rows=st.integers(1, 12), columns=st.integers(2, 12), steps=st.integers(3, 9))
def test_neighbours_in_a_row_differ_by_half_of_the_depth_at_most(rows, columns, steps):
    model = designed_grid(design(rows=rows, columns=columns, depth_mm=16, depth_steps=steps))
    z_mm = model.xyz_mm[:, 2].reshape(rows, columns)
    assert np.abs(np.diff(z_mm, axis=1)).max() <= 8 + 1e-3


def test_a_picture_of_it_by_another_program_is_identified():
    model, camera = designed_grid(design(depth_mm=16)), Picture(720, 576, 0.0084)
    seen = identify(fields(camera.draw(model.xyz_mm, 1.5), 1), camera.nominal, model)
    assert seen.refusal is None
    assert [sorted(target) for target in seen.target] == [list(range(108))] * 2


def test_the_same_design_is_the_same_frame():
    one, same = (designed_grid(design(depth_mm=16)).xyz_mm for _ in range(2))
    assert np.array_equal(one, same)


def test_a_planar_frame_is_remarked_with_what_calibration_will_say():
    (first, *_) = calibration_frame_remarks(designed_grid(design()))
    assert "lie in a plane" in first
    assert "±8 mm" in first


def test_a_frame_that_maps_onto_itself_is_remarked():
    model = designed_grid(design(rows=5, columns=5, depth_mm=16, depth_steps=2, along=Along.ROWS))
    assert any("cannot be told from itself" in one for one in calibration_frame_remarks(model))


@pytest.mark.parametrize("along", [Along.ROWS, Along.COLUMNS])
def test_a_frame_of_plates_is_its_own_mirror_image_unless_one_target_is_added(along):
    (remark,) = calibration_frame_remarks(designed_grid(design(depth_mm=16, along=along)))
    assert "its mirror image maps 108 of 108 targets" in remark
    assert "a further one at (" in remark


def test_a_large_frame_is_not_examined_for_symmetries():
    (remark,) = calibration_frame_remarks(designed_grid(design(rows=20, columns=20, depth_mm=16)))
    assert "not examined" in remark


def test_a_frame_of_few_targets_is_remarked():
    assert any(
        "11 targets" in one for one in calibration_frame_remarks(designed_grid(design(rows=1, columns=11)))
    )


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"rows": 0}, "rows"),
        ({"columns": -1}, "columns"),
        ({"rows": 1000, "columns": 1000}, "1000"),
        ({"pitch_mm": 1.5}, "overlap"),
        ({"row_pitch_mm": 1.2}, "overlap"),
        ({"pitch_mm": float("nan")}, "pitch"),
        ({"diameter_mm": 0}, "diameter"),
        ({"depth_mm": -1}, "depth"),
        ({"depth_mm": float("inf")}, "depth"),
        ({"depth_mm": 1, "depth_steps": 1}, "steps"),
        ({"sigma_mm": -0.1}, "sigma"),
    ],
)
def test_a_design_that_cannot_be_built_is_refused(wrong, said):
    with pytest.raises(InputError, match=said) as caught:
        designed_grid(design(**wrong))
    assert caught.value.hint
