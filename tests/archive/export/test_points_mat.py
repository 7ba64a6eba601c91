"""Points as a MAT-file, opened by the MATIO library, which shares nothing with the one that writes them."""

import math
import sqlite3
from contextlib import closing

import numpy as np
import pytest

from archive.captures import MADE_WITH, META, PERIOD_NS, points, slot, slots, write
from archive.mat_files import by_matio
from archive.milkings import object_document
from archive.readings import readings, write_with_channels
from grabberd.archive.capture_contents import mat_stream
from grabberd.archive.export import mat_file as module
from grabberd.archive.export.mat_file import LONGEST_NAME, export_mat
from grabberd.archive.export.points_columns import GRID_COLUMNS
from grabberd.errors import InputError, NotFound, StorageError

LOST = 3
MEASURED = (0, 1, 2, 6, 7, 9)


@pytest.fixture
def capture(tmp_path):
    """Fields 0, 1, 2, then three that are lost, then 6 to 9, of which 8 was not measured."""
    taken = [*slots(3), slot(3 + LOST, lost=LOST), *(slot(n) for n in range(4 + LOST, 10))]
    return write(tmp_path, taken, measured=MEASURED)


@pytest.fixture
def read(capture, tmp_path):
    assert export_mat(capture, tmp_path / "out") == 30
    return by_matio(tmp_path / "out" / "points.mat")


def seen():
    return sorted({int(target) for n in MEASURED for target in points(n).target})


# --- points ---


def test_positions_are_dense_over_fields_and_targets(read):
    xyz_mm, targets = read["points"]["xyz_mm"], seen()
    assert xyz_mm.shape == (10, len(targets), 3)
    for n in MEASURED:
        expected = np.full((len(targets), 3), np.nan)
        expected[np.searchsorted(targets, points(n).target)] = points(n).xyz_mm
        np.testing.assert_array_equal(xyz_mm[n], expected)


def test_lost_and_unmeasured_fields_are_unknown_and_keep_their_places(read):
    found = read["points"]
    assert found["n"].ravel().tolist() == list(range(10))
    assert np.isnan(found["xyz_mm"][[3, 4, 5, 8]]).all()
    assert np.isnan(found["time_s"].ravel()[[3, 4, 5]]).all(), "nobody knows the time of a lost field"
    np.testing.assert_allclose(found["time_s"].ravel()[[0, 2, 6, 8]], [0, 0.04, 0.12, 0.16], atol=1e-6)
    assert found["time_s"].ravel()[6] == (6 * PERIOD_NS + 6) / 1e9


@pytest.mark.parametrize("value", ["'received'", "1e300", "-1"])
def test_a_time_that_none_can_be_is_unknown(capture, tmp_path, value):
    with closing(sqlite3.connect(capture)) as connection, connection:
        connection.execute("PRAGMA ignore_check_constraints = ON")
        connection.execute(f"UPDATE fields SET time_ns = {value} WHERE n = 8")
    export_mat(capture, tmp_path / "out", left_out=[])
    time_s = by_matio(tmp_path / "out" / "points.mat")["points"]["time_s"].ravel()
    assert np.flatnonzero(np.isnan(time_s)).tolist() == [3, 4, 5, 8]


def test_standard_deviations_residuals_and_images_stand_beside_them(read):
    places, one, found = np.searchsorted(seen(), points(7).target), points(7), read["points"]
    sigma_mm = np.sqrt(np.diagonal(one.covariance_mm2, axis1=1, axis2=2))
    np.testing.assert_allclose(found["sigma_mm"][7, places], sigma_mm, rtol=1e-6)
    assert found["calibration_sigma_mm"][7, places[0], 2] == pytest.approx(
        math.sqrt(one.calibration_covariance_mm2[0, 2, 2]), rel=1e-6
    )
    np.testing.assert_allclose(found["residual_px"][7, places], one.residual_px, rtol=1e-6)
    np.testing.assert_allclose(found["left_px"][7, places], one.image_px[:, 0], rtol=1e-6)
    np.testing.assert_allclose(found["right_px"][7, places], one.image_px[:, 1], rtol=1e-6)


def test_whole_numbers_are_doubles_since_matlab_would_round_what_is_made_of_them(read):
    assert all(read["points"][name].dtype == np.float64 for name in ("n", "target", "row", "column"))


def test_targets_have_their_place_on_the_grid(tmp_path):
    model = object_document()
    path = write(tmp_path, slots(2), measured=[0], made_with={**MADE_WITH, "object": model})
    export_mat(path, tmp_path / "out")
    found = by_matio(tmp_path / "out" / "points.mat")["points"]
    place = found["target"].ravel().tolist().index(model["targets"][7]["id"])
    assert found["row"].ravel()[place] == model["targets"][7]["row"]
    assert found["column"].ravel()[place] == model["targets"][7]["column"]
    expected = [model["targets"][7][f"{axis}_mm"] for axis in "xyz"]
    np.testing.assert_allclose(found["nominal_mm"][place], expected)


# --- what stands beside them ---


def test_every_array_has_unit_and_meaning(read):
    assert list(read["points"]) == [column.name for column in GRID_COLUMNS]
    assert read["units"]["points"] == {column.name: column.unit for column in GRID_COLUMNS}
    assert read["meanings"]["points"] == {column.name: column.meaning for column in GRID_COLUMNS}
    assert all(len(column.name) <= LONGEST_NAME for column in GRID_COLUMNS)


def test_the_ledger_says_what_was_lost_and_why(read):
    assert read["ledger"]["first_n"].ravel().tolist() == [3]
    assert read["ledger"]["count"].ravel().tolist() == [LOST]
    assert read["ledger"]["outcome"] == ["lost"]
    assert read["ledger"]["reason"] == ["time gap"]


def test_the_file_says_what_it_was_made_from(read):
    about = read["about"]
    assert (about["capture"], about["run"], about["calibration"]) == (META.id, 1.0, "rig-7")
    assert about["rate_hz"] == 50.0
    assert about["first_field_utc"] == "2026-03-01T09:30:00.000Z"
    assert about["labels"] == [["cow", "1807"], ["teat", "front left"]]
    assert about["site"] == [["barn", "Ås"]], "a name that no field of a struct could have is a value"


# --- limits ---


def test_more_than_a_variable_holds_is_refused_with_numbers(capture, tmp_path, monkeypatch):
    monkeypatch.setattr(module, "MOST_BYTES", 9_999)
    with pytest.raises(InputError, match="GB") as refused:
        export_mat(capture, tmp_path / "out")
    assert "parquet" in refused.value.hint
    assert not (tmp_path / "out").exists()


def test_a_gap_of_years_is_refused_before_memory_is_taken_for_it(tmp_path):
    path = write(tmp_path, [slot(0), slot(1 << 24, lost=(1 << 24) - 1)], measured=[0, 1 << 24])
    with pytest.raises(InputError, match="`points` would take"):
        export_mat(path, tmp_path / "out")


def test_a_download_is_refused_before_it_takes_the_daemons_memory(tmp_path, monkeypatch):
    path = write(tmp_path, slots(2), measured=[0], made_with={**MADE_WITH, "object": object_document()})
    monkeypatch.setattr(module, "STREAM_BYTES", 999)
    with pytest.raises(InputError, match="GB") as refused:
        mat_stream(path)
    assert "grabberd export" in refused.value.hint


# --- files ---


def test_a_download_is_the_same_file(capture, tmp_path):
    export_mat(capture, tmp_path / "out")
    (tmp_path / "stream.mat").write_bytes(b"".join(mat_stream(capture)))
    one, other = (by_matio(path) for path in (tmp_path / "stream.mat", tmp_path / "out" / "points.mat"))
    np.testing.assert_array_equal(one["points"]["xyz_mm"], other["points"]["xyz_mm"])
    assert one["about"] == other["about"]


def test_nothing_is_overwritten_and_a_run_must_exist(capture, tmp_path):
    export_mat(capture, tmp_path / "out", run=1)
    with pytest.raises(StorageError, match="not empty"):
        export_mat(capture, tmp_path / "out")
    with pytest.raises(NotFound):
        export_mat(capture, tmp_path / "other", run=2)
    assert not (tmp_path / "other").exists()


# --- channels ---


def test_every_reading_of_a_channel_is_there_at_its_own_time(tmp_path):
    path = write_with_channels(tmp_path, slots(10), measured=[0, 1])
    export_mat(path, tmp_path / "out")
    channels = by_matio(tmp_path / "out" / "points.mat")["channels"]
    assert (channels["name"], channels["unit"]) == (["pulsation", "liner"], ["mbar", "kPa"])
    shown = readings(0, 40)
    time_s, value, kpa = (np.ravel(channels[name][0]) for name in ("time_s", "value", "vacuum_kpa"))
    np.testing.assert_allclose(time_s, (shown.time_ns - shown.time_ns[0]) / 1e9, atol=1e-12)
    np.testing.assert_array_equal(value, shown.value)
    np.testing.assert_allclose(kpa, 101.3 - 0.1 * shown.value)


def test_a_capture_without_channels_has_no_such_variable(read):
    assert "channels" not in read
