"""The target grid."""

import numpy as np
import pytest

from grabberd.core.reconstruction import ObjectModel
from grabberd.errors import AnalysisError
from grabberd_liner.analysis.grid import Grid
from liner.analysis.collapsing import grid, model


def of(rows, columns, place=lambda r, c: (6.0 * r, 5.0 * c, 0.0), keep=lambda r, c: True):
    kept = [(r, c) for r in range(rows) for c in range(columns) if keep(r, c)]
    row, column = (np.array(part, np.int32) for part in zip(*kept, strict=True))
    xyz = np.array([place(r, c) for r, c in kept], float)
    return Grid.of(
        ObjectModel("sheet", np.arange(10, 10 + len(kept), dtype=np.int32), xyz, row, column, 1.5, 0.0)
    )


def test_material_coordinates_are_row_and_column_times_the_mean_nominal_pitch():
    sheet = of(4, 3)
    assert (sheet.u_pitch_mm, sheet.v_pitch_mm) == pytest.approx((6.0, 5.0))
    np.testing.assert_allclose(sheet.u_mm, 6.0 * sheet.row)
    np.testing.assert_allclose(sheet.v_mm, 5.0 * sheet.column)


def test_rows_may_be_numbered_from_anywhere():
    shifted = model()
    moved = ObjectModel("x", shifted.target, shifted.xyz_mm, shifted.row + 7, shifted.column - 3, 1.5, 0.0)
    np.testing.assert_array_equal(Grid.of(moved).u_mm, grid().u_mm)


def test_a_grid_of_full_cells_has_two_triangles_a_cell_all_facing_the_cameras():
    corner = grid().nominal_mm[grid().triangles]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    assert len(grid().triangles) == 2 * 17 * 5
    assert (normal[:, 2] > 0).all()


def test_rows_the_other_way_round_turn_the_orientation_not_the_triangles():
    mirrored = of(4, 3, lambda r, c: (-6.0 * r, 5.0 * c, 0.0))
    corner = mirrored.nominal_mm[mirrored.triangles]
    assert mirrored.outward == -1.0
    assert (np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])[:, 2] > 0).all()


def test_a_hole_in_the_grid_takes_the_cells_about_it():
    assert len(of(4, 4, keep=lambda r, c: (r, c) != (1, 1)).triangles) == 2 * (9 - 4)


def test_triangles_that_share_an_edge_are_found_once():
    sheet = of(3, 3)
    pairs = sheet.adjoining_triangles()
    shared = [len(set(sheet.triangles[a]) & set(sheet.triangles[b])) for a, b in pairs]
    assert set(shared) == {2}
    assert len(pairs) == 4 + 4


def test_too_few_rows_are_refused():
    with pytest.raises(AnalysisError, match="2 rows"):
        of(2, 6)


def test_a_target_that_the_model_does_not_have_is_named():
    with pytest.raises(AnalysisError, match="999"):
        grid().indices(np.array([1, 999], np.int32))
