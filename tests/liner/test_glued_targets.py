"""The advice on glueing targets: its table, and what it is for."""

import numpy as np
from tests.proofs.bench.load_accuracy import GLUED_HEADER, GRIDS

from grabberd_liner.glued_targets import HEADS, TABLE, advice, glued_targets, note, own_grid
from liner.analysis.walls import solved, solved_six


def test_the_table_is_the_one_that_its_command_writes() -> None:
    from importlib.resources import files  # noqa: PLC0415

    head, *_ = files("grabberd_liner").joinpath(TABLE).read_text().splitlines()
    assert head == GLUED_HEADER
    assert tuple((one.columns, one.row_pitch_mm) for one in glued_targets()) == GRIDS


def test_six_columns_halve_the_errors_of_four() -> None:
    four, six = own_grid(4, 6.5), own_grid(6, 6.5)
    assert four.walls >= 48 <= six.walls
    for name in ("mean_kpa", "compression_kpa", "load_percent"):
        assert getattr(six, name) < 0.65 * getattr(four, name)


def test_a_grid_that_is_not_in_the_table_is_none_of_it() -> None:
    assert own_grid(9, 6.5) is None
    assert own_grid(4, 9.0) is None
    assert own_grid(4, 6.7) == own_grid(4, 6.5)


def model_of(liner):
    from grabberd.core.reconstruction import ObjectModel  # noqa: PLC0415

    grid = liner.grid
    return ObjectModel("liner", grid.target, grid.nominal_mm, grid.row, grid.column, 1.5, 0.3)


def test_the_plan_marks_the_grid_of_the_object_model() -> None:
    for liner, columns in ((solved("reference-round"), "4"), (solved_six("reference-round"), "6")):
        found = advice(model_of(liner))
        assert [row[:2] for row in found.rows if row[-1]] == [(columns, "6.5")]
        assert len(found.heads) == len(HEADS) + 1 == len(found.rows[0])
        assert found.note == note()


def test_without_a_grid_nothing_is_marked_and_the_figures_are_there() -> None:
    found = advice(None)
    assert not any(row[-1] for row in found.rows)
    assert np.isfinite([one["load_percent"] for one in found.figures]).all()
