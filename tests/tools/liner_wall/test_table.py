"""A case's table gives back its states."""

import json
from pathlib import Path

import numpy as np
import pytest
from tools.liner_wall.__main__ import main
from tools.liner_wall.designs import DESIGNS, Case, cases, mounted
from tools.liner_wall.path import follow
from tools.liner_wall.table import SHIFT_MM, force_n_per_mm, save_table


def test_states_come_back_to_half_a_step(tmp_path: Path) -> None:
    case = Case(DESIGNS[0], None)
    tube, state = mounted(case.design, fineness=0.25)
    rests = list(follow(tube, state, 0.0, 0.012, 0.006, case.push(tube.mesh.inner_angles())))
    save_table(tmp_path / "coarse.npz", case, tube, rests)
    outer = np.isclose(tube.mesh.block[:, 1], 1.0)
    with np.load(tmp_path / "coarse.npz") as table:
        places = table["mounted_mm"] + np.cumsum(table["shift"], axis=0, dtype=np.int64) * table["shift_mm"]
        contact = np.cumsum(table["contact"], axis=0, dtype=np.int64) * table["contact_kpa"]
        assert json.loads(str(table["about"]))["design"]["name"] == "reference"
        assert table["outer_kpa"][[0, -1]].tolist() == [0.0, 12.0]
    for rest, shown in zip(rests, places, strict=True):
        np.testing.assert_allclose(shown.reshape(-1, 3), rest.state.nodes_mm[outer], atol=0.51 * SHIFT_MM)
    assert contact.min() >= 0


def test_load_is_the_pressure_times_the_width_of_the_bore() -> None:
    tube, state = mounted(DESIGNS[0], fineness=0.25)

    def press(points_mm):
        return np.full(points_mm.shape[:-1], 0.02), np.zeros(points_mm.shape)

    bore_mm = 2 * DESIGNS[0].radius_mm - DESIGNS[0].wall_mm
    assert force_n_per_mm(tube, state.nodes_mm, press) == pytest.approx(0.02 * bore_mm, rel=5e-3)


def test_every_liner_meets_every_teat() -> None:
    names = [case.name for case in cases()]
    assert len(names) == len(set(names)) == 26
    assert {"reference-empty", "rubbing-blunt"} <= set(names)


def test_an_unknown_case_is_refused_with_those_there_are(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    assert main([str(tmp_path), "no-such-case"]) == 2
    assert "reference-empty, reference-round" in capsys.readouterr().err
