"""Bad fields that `grabberd analyse` survives and names."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from archive.milkings import milking
from cli.analyse.analysing import (
    rows,
    run,
)
from core.chain.milking import changed, grid, still

pytestmark = pytest.mark.timeout(600)


HOLE = (grid().row >= 2) & (grid().row <= 4) & (grid().column >= 1)
CROSSED, FOLDED, JUMPED, HOLED = 2, 4, 6, 12


def spoiled() -> list[Any]:
    """Fields of the open liner, each bad one bad in its own way; 8 to 10 are missing."""
    fields = {one.n: one for one in still(14)}
    target, places = (getattr(fields[0].timed.points, name) for name in ("target", "xyz_mm"))
    crossed, folded, turned = target.copy(), fields[FOLDED].timed.points.xyz_mm.copy(), grid().row >= 3
    crossed[[11, 22]] = target[[22, 11]]
    folded[turned, 0] = 2 * places[grid().row == 3, 0].mean() - folded[turned, 0]
    fields[CROSSED] = changed(fields[CROSSED], target=crossed)
    fields[FOLDED] = changed(fields[FOLDED], places=folded)
    fields[JUMPED] = changed(fields[JUMPED], target=np.roll(target, 5))
    fields[HOLED] = changed(fields[HOLED], keep=~HOLE)
    return [one for n, one in fields.items() if n not in {8, 9, 10}]


@pytest.fixture(scope="module")
def survived(tmp_path_factory: pytest.TempPathFactory) -> tuple[list[str], Path]:
    """The problems, and the folder."""
    folder = tmp_path_factory.mktemp("survived")
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("grabberd.reports.figures.drawing.find_spec", lambda name: None)
        result = run(milking(folder, spoiled()), "--json", "--out", folder / "out")
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)["problems"], folder / "out"


def of_field(problems: list[str], n: int) -> str:
    return " ".join(words for words in problems if f"field {n}" in words.partition(":")[0].split(", "))


def test_crossing_targets_are_named(survived: tuple[list[str], Path]) -> None:
    assert "targets 12, 23" in of_field(survived[0], CROSSED)


def test_a_folded_wall_is_named(survived: tuple[list[str], Path]) -> None:
    assert of_field(survived[0], FOLDED)


def test_ids_that_jump_by_a_row_are_named(survived: tuple[list[str], Path]) -> None:
    assert of_field(survived[0], JUMPED)


def test_good_fields_have_no_problem(survived: tuple[list[str], Path]) -> None:
    assert not any(of_field(survived[0], n) for n in (0, 1, 3, 5, 7, 11, 13))


def test_a_hole_stays_empty_in_the_tables(survived: tuple[list[str], Path]) -> None:
    inside = {
        row["n"]: (row["x_mm"], row["kappa1_per_m"])
        for row in rows(survived[1] / "targets.csv")
        if (row["row"], row["column"]) == ("3", "3")
    }
    assert inside[str(HOLED)] == ("", "")
    assert all(inside["11"])


def test_a_gap_in_the_ledger_is_named_and_a_table(survived: tuple[list[str], Path]) -> None:
    assert "3 after field 7" in survived[0][0]
    assert rows(survived[1] / "gaps.csv") == [{"after_n": "7", "until_n": "11", "missing": "3"}]


def test_the_report_has_the_same_problems(survived: tuple[list[str], Path]) -> None:
    assert json.loads((survived[1] / "report.json").read_text())["problems"] == survived[0]
