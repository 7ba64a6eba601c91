"""The truth, of options and of a capture file."""

import json
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from grabberd.errors import CaptureFileError
from grabberd_fake import FakeOptions, World, truth_at, truth_of_liner, truth_of_wall
from grabberd_fake.__main__ import main
from grabberd_fake.stage import REARRANGED
from grabberd_fake.truth import (
    CSV_HEADER,
    LINER_CSV_HEADER,
    LOAD_CSV_HEADER,
    WALL_CSV_HEADER,
    capture_quantities,
    capture_truth,
    capture_vacuum_log,
)

OPTIONS = {"scene": "liner", "rig": {"reflections": 1}, "pace": "free"}
ELLIPSE = {**OPTIONS, "scene": "ellipse"}


@pytest.fixture
def capture(tmp_path: Path) -> Path:
    """A capture file of three fields, one of them lost."""
    return write_capture(tmp_path / "liner.grab", {"name": "a", "driver": "fake", "options": OPTIONS})


def write_capture(path: Path, device: dict[str, Any], *reasons: str) -> Path:
    with closing(sqlite3.connect(path)) as database:
        database.execute("CREATE TABLE ledger(first_n INTEGER, reason TEXT)")
        database.executemany("INSERT INTO ledger VALUES (2, ?)", [(reason,) for reason in reasons])
        database.execute("CREATE TABLE meta(key TEXT PRIMARY KEY, value TEXT)")
        database.execute("CREATE TABLE fields(n INTEGER PRIMARY KEY, time_ns INTEGER, data BLOB)")
        database.execute("INSERT INTO meta VALUES ('device', ?)", (json.dumps(device),))
        rows = [(0, 20_000_000), (1, 40_000_000), (2, None), (3, 80_000_000)]
        database.executemany("INSERT INTO fields(n, time_ns) VALUES (?, ?)", rows)
        database.commit()
    return path


def test_truth_is_that_of_the_world_that_the_options_make() -> None:
    truth, world = truth_at(OPTIONS, 40_000_000), World(FakeOptions.read(OPTIONS)).truth(40_000_000)
    assert truth.ids.tolist() == list(range(1, 109))
    for told, true in zip(truth, world, strict=True):
        assert_allclose(told, true, atol=0)
    assert_allclose(truth_at(FakeOptions.read(OPTIONS), 40_000_000).left_px, truth.left_px, atol=0)


def test_options_that_cannot_be_used_have_no_truth() -> None:
    with pytest.raises(ValueError, match="scene"):
        truth_at({"scene": "cow"}, 0)


def test_a_captures_truth_has_every_target_at_every_field_that_came(capture: Path) -> None:
    lines = list(capture_truth(capture))
    assert lines[0] == CSV_HEADER == "n,time_ns,target,x_mm,y_mm,z_mm,visible"
    rows = [line.split(",") for line in lines[1:]]
    assert len(rows) == 3 * 108
    assert sorted({(int(row[0]), int(row[1])) for row in rows}) == [
        (0, 20_000_000),
        (1, 40_000_000),
        (3, 80_000_000),
    ]
    truth = truth_at(OPTIONS, 80_000_000)
    assert rows[-1][:3] == ["3", "80000000", "108"]
    assert_allclose([float(value) for value in rows[-1][3:6]], truth.xyz_mm[-1], atol=1e-6)
    assert [row[6] == "1" for row in rows[-108:]] == (truth.visible_left & truth.visible_right).tolist()


def test_the_command_prints_it(capture: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["truth", str(capture)]) == 0
    assert capsys.readouterr().out.splitlines() == list(capture_truth(capture))


def test_reading_the_truth_leaves_the_capture_alone(capture: Path) -> None:
    before = capture.read_bytes()
    list(capture_truth(capture))
    assert capture.read_bytes() == before
    assert [path.name for path in capture.parent.iterdir()] == ["liner.grab"]


def test_what_is_no_capture_is_refused(tmp_path: Path) -> None:
    text = tmp_path / "notes.txt"
    text.write_text("no database")
    for path in (text, tmp_path / "absent.grab"):
        with pytest.raises(CaptureFileError, match=path.name):
            list(capture_truth(path))
    assert not (tmp_path / "absent.grab").exists()


def test_a_capture_of_another_driver_has_no_truth(tmp_path: Path) -> None:
    path = write_capture(tmp_path / "cow.grab", {"name": "a", "driver": "v4l2", "options": {}})
    with pytest.raises(CaptureFileError, match="'v4l2', not 'fake'"):
        list(capture_truth(path))


def test_the_command_says_what_is_wrong_and_fails(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as left:
        main(["truth", str(tmp_path / "absent.grab")])
    assert left.value.code == 2
    assert "absent.grab" in capsys.readouterr().err


def last_row(lines: list[str]) -> dict[str, str]:
    return dict(zip(lines[0].split(","), lines[-1].split(","), strict=True))


def test_the_liners_truth_of_a_capture_has_a_row_for_every_target_and_field(capture: Path) -> None:
    lines = list(capture_truth(capture, "wall"))
    assert lines[0] == LINER_CSV_HEADER
    assert len(lines) == 1 + 3 * 108
    last, truth = last_row(lines), truth_of_liner(OPTIONS, 80_000_000)
    assert (last["n"], last["time_ns"], last["target"]) == ("3", "80000000", "108")
    assert float(last["strain_12"]) == pytest.approx(truth.strain[-1, 0, 1])
    assert float(last["p_contact_kpa"]) == pytest.approx(truth.contact_kpa[-1], abs=1e-6)
    assert float(last["rest_kpa"]) == pytest.approx(truth.rest_kpa)
    assert float(last["pulsation_vacuum_kpa"]) == pytest.approx(truth.pulsation_kpa)


def test_the_load_of_a_capture_has_a_row_for_every_element_and_field(capture: Path) -> None:
    lines = list(capture_truth(capture, "load"))
    assert lines[0] == LOAD_CSV_HEADER
    truth = truth_of_liner(OPTIONS, 20_000_000)
    assert len(lines) == 1 + 3 * len(truth.load_x_mm)
    rows = np.array([line.split(",") for line in lines[1 : 1 + len(truth.load_x_mm)]], float)
    assert_allclose(rows[:, 2:], np.column_stack([truth.load_x_mm, truth.load_n_per_mm]), atol=1e-6)


def test_scenes_without_a_liner_have_no_load_and_no_vacuum(tmp_path: Path) -> None:
    options = {"scene": "calibration_frame"}
    path = write_capture(tmp_path / "frame.grab", {"name": "a", "driver": "fake", "options": options})
    with pytest.raises(ValueError, match="'calibration_frame' is not the solved wall"):
        list(capture_truth(path, "load"))
    with pytest.raises(ValueError, match="'calibration_frame' has no vacuum"):
        list(capture_vacuum_log(path))


def test_the_ellipses_truth_of_a_capture_has_what_its_movement_would_need(tmp_path: Path) -> None:
    path = write_capture(tmp_path / "one.grab", {"name": "a", "driver": "fake", "options": ELLIPSE})
    lines = list(capture_truth(path, "wall"))
    assert lines[0] == WALL_CSV_HEADER
    assert len(lines) == 1 + 3 * 108
    last, truth = last_row(lines), truth_of_wall(ELLIPSE, 80_000_000)
    assert (last["n"], last["time_ns"], last["target"]) == ("3", "80000000", "108")
    assert float(last["strain_12"]) == pytest.approx(truth.strain[-1, 0, 1])
    assert float(last["curvature_per_m_22"]) == pytest.approx(truth.curvature_per_m[-1, 1, 1])
    assert float(last["p_contact_kpa"]) == pytest.approx(truth.pressure_kpa[-1], abs=1e-6)
    assert float(last["pulsation_vacuum_kpa"]) == pytest.approx(truth.pulsation_kpa)


def test_the_vacuum_log_reaches_a_cycle_beyond_the_capture_on_its_own_clock(capture: Path) -> None:
    lines = list(capture_vacuum_log(capture, offset_s=0.4))
    first, last = (float(line.split(",")[0]) + 0.4 for line in (lines[1], lines[-1]))
    assert (first, last) == (pytest.approx(-1.0), pytest.approx(1.06))


@pytest.mark.parametrize("of", ["wall", "load", "vacuum"])
def test_the_command_prints_wall_load_and_vacuum(
    capture: Path, capsys: pytest.CaptureFixture[str], of: str
) -> None:
    lines = capture_vacuum_log(capture) if of == "vacuum" else capture_truth(capture, of)
    assert main(["truth", str(capture), "--of", of]) == 0
    assert capsys.readouterr().out.splitlines() == list(lines)


def test_a_capture_s_truth_is_that_of_the_stage_it_was_made_on(tmp_path: Path) -> None:
    stream = {"details": {"stage": json.dumps({"wall": "thin-round", "period_s": 0.8})}}
    device = {"driver": "fake", "options": OPTIONS, "stream": stream}
    path = write_capture(tmp_path / "a.grab", device)
    truth = truth_of_liner({**OPTIONS, "liner": {"wall": "thin-round", "period_s": 0.8}}, 80_000_000)
    assert list(capture_truth(path, "wall"))[-1].split(",")[-3:] == [
        f"{value + 0.0:.9g}" for value in (truth.rest_kpa, truth.pulsation_kpa, truth.liner_kpa)
    ]
    assert "liner_compression_mean_kpa" in "\n".join(capture_quantities(path))


def test_a_capture_during_which_the_stage_changed_has_no_truth(tmp_path: Path) -> None:
    device = {"driver": "fake", "options": OPTIONS}
    path = write_capture(tmp_path / "a.grab", device, "unplugged", REARRANGED)
    with pytest.raises(CaptureFileError, match="rearranged from field 2 on"):
        list(capture_truth(path))
