"""Points that cannot be where they are."""

import numpy as np

from grabberd_liner.analysis.surface.fitting import screen
from liner.analysis.collapsing import grid, outer

ALL = np.arange(108)


def places(closed=1.0):
    return outer(grid().row.astype(float), grid().column.astype(float), closed)


def test_a_closed_liner_passes_whole():
    assert screen(grid(), ALL, places()).kept.all()
    assert screen(grid(), ALL, places()).problems == ()


def test_two_ids_that_have_jumped_to_each_others_targets_are_left_out_and_named():
    xyz = places()
    xyz[[44, 45]] = xyz[[45, 44]]
    screening = screen(grid(), ALL, xyz)
    assert set(np.flatnonzero(~screening.kept)) == {44, 45}
    assert "45, 46" in screening.problems[0]


def test_a_point_far_off_is_left_out_alone():
    xyz = places()
    xyz[50] += [0.0, 0.0, 12.0]
    assert np.flatnonzero(~screen(grid(), ALL, xyz).kept).tolist() == [50]


def test_a_fold_is_named():
    xyz = grid().nominal_mm.copy()
    xyz[grid().row >= 9, 0] = 2 * xyz[grid().row == 9, 0][0] - xyz[grid().row >= 9, 0]
    xyz[grid().row >= 9, 2] += 1.5
    screening = screen(grid(), ALL, xyz)
    assert any("folded" in problem for problem in screening.problems)


def test_missing_targets_are_no_trouble():
    seen = np.random.default_rng(0).random(108) > 0.3
    assert screen(grid(), ALL[seen], places()[seen]).kept.all()
