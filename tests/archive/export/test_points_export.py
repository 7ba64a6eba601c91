"""Points of a capture as CSV, PLY and Parquet."""

import csv
import io
import json
import math
import re
import sqlite3
import sys
from contextlib import closing

import numpy as np
import pytest

from archive.captures import META, meta, points, slots, write
from grabberd.archive.capture_contents import parquet_stream
from grabberd.archive.export.points_columns import POINT_COLUMNS
from grabberd.archive.export.points_export import (
    export_csv,
    export_parquet,
    export_ply,
    points_csv,
    points_ply,
)
from grabberd.errors import CaptureFileError, ExtraMissing, NotFound, StorageError

NUMPY = {"int": "<i4", "float": "<f4", "double": "<f8"}


def read_ply(data):
    """Vertices and head, as any program would read them."""
    head, _, body = data.partition(b"end_header\n")
    lines = head.decode().splitlines()
    assert lines[:2] == ["ply", "format binary_little_endian 1.0"]
    count = int(re.search(r"element vertex (\d+)", head.decode())[1])
    kinds = [line.split()[1:] for line in lines if line.startswith("property ")]
    vertices = np.frombuffer(body, [(name, NUMPY[kind]) for kind, name in kinds])
    assert len(vertices) == count
    return vertices, lines


def csv_rows(path, run=None):
    return list(csv.DictReader(io.StringIO("".join(points_csv(path, run)))))


def csv_columns(path, run=None):
    rows = csv_rows(path, run)
    return {column.name: [row[column.name] for row in rows] for column in POINT_COLUMNS}


def parquet(path, tmp_path, run=None):
    pq = pytest.importorskip("pyarrow.parquet")
    file = tmp_path / "read.parquet"
    file.write_bytes(b"".join(parquet_stream(path, run)))
    return pq.read_table(file)


@pytest.fixture
def capture(tmp_path):
    return write(tmp_path, slots(60), measured=range(60))


# --- CSV ---


def test_there_is_a_row_for_each_target_and_field(tmp_path):
    rows = csv_rows(write(tmp_path, slots(70), measured=range(70)))
    assert len(rows) == 70 * 5
    assert [int(row["target"]) for row in rows[:5]] == points(0).target.tolist()


def test_places_are_written_bit_for_bit(tmp_path):
    (first, *_) = csv_rows(write(tmp_path, slots(1), measured=[0]))
    assert [float(first[f"{axis}_mm"]) for axis in "xyz"] == points(0).xyz_mm[0].tolist()


def test_standard_deviations_stand_beside_them(tmp_path):
    (first, *_) = csv_rows(write(tmp_path, slots(1), measured=[0]))
    one = points(0)
    assert float(first["sigma_y_mm"]) == pytest.approx(math.sqrt(one.covariance_mm2[0, 1, 1]), rel=1e-5)
    expected = math.sqrt(one.calibration_covariance_mm2[0, 2, 2])
    assert float(first["calibration_sigma_z_mm"]) == pytest.approx(expected, rel=1e-5)
    assert float(first["residual_px"]) == pytest.approx(one.residual_px[0], rel=1e-5)
    assert float(first["right_x_px"]) == pytest.approx(one.image_px[0, 1, 0], rel=1e-5)


def test_times_count_from_the_first_field_and_from_noon_somewhere(tmp_path):
    rows = csv_rows(write(tmp_path, slots(60), measured=[0, 50]))
    assert float(rows[0]["time_s"]) == 0.0
    assert float(rows[-1]["time_s"]) == pytest.approx(1.0, abs=1e-6)
    assert rows[-1]["time_utc"] == "2026-03-01T09:30:01.000Z"


def test_fields_before_the_trigger_are_earlier_than_the_capture_was_asked_for(tmp_path):
    rows = csv_rows(write(tmp_path, slots(60), measured=[0], start_ns=META.start_ns + 500_000_000))
    assert rows[0]["time_utc"] == "2026-03-01T09:29:59.500Z"


def test_a_recording_that_was_played_again_has_no_time_of_day(tmp_path):
    device = {**META.device, "stream": {"live": False}}
    rows = csv_rows(write(tmp_path, slots(1), measured=[0], device=device))
    assert rows[0]["time_utc"] == ""
    assert rows[0]["time_s"] == "0.000000"


def test_a_run_can_be_chosen_and_must_exist(tmp_path):
    path = write(tmp_path, slots(1), measured=[0])
    assert len(csv_rows(path, 1)) == 5
    with pytest.raises(NotFound):
        points_csv(path, 2)
    with pytest.raises(CaptureFileError):
        points_csv(tmp_path / "gone.grab")


@pytest.mark.parametrize("value", ["'received'", "1e300"])
def test_times_cannot_be_counted_from_a_first_field_without_one(tmp_path, value):
    path = write(tmp_path, slots(3), measured=[1])
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute("PRAGMA ignore_check_constraints = ON")
        connection.execute(f"UPDATE fields SET time_ns = {value} WHERE n = 0")
    with pytest.raises(CaptureFileError, match="not a whole number"):
        csv_rows(path)


def test_the_table_is_given_in_pieces(tmp_path):
    assert len(list(points_csv(write(tmp_path, slots(70), measured=range(70), fields_a_commit=5)))) > 10


def test_points_are_written_into_a_new_folder(tmp_path):
    path = write(tmp_path, slots(3), measured=range(3))
    assert export_csv(path, tmp_path / "out") == 15
    assert len((tmp_path / "out" / "points.csv").read_text().splitlines()) == 16
    with pytest.raises(StorageError, match="not empty"):
        export_csv(path, tmp_path / "out")


# --- PLY ---


def test_a_cloud_has_all_points_of_all_fields(capture):
    vertices, lines = read_ply(b"".join(points_ply(capture)))
    text = csv_columns(capture)
    for name in ("x", "y", "z"):
        np.testing.assert_array_equal(vertices[name], np.array(text[f"{name}_mm"], float))
    for name in ("n", "target", "sigma_y_mm", "calibration_sigma_z_mm", "residual_px", "time_s"):
        np.testing.assert_allclose(vertices[name], np.array(text[name], float), rtol=1e-5, atol=1e-6)
    assert any(META.id in line and "run 1" in line for line in lines)
    assert any("mm" in line for line in lines if line.startswith("comment"))


def test_one_fields_cloud_has_its_points_alone(capture):
    vertices, _ = read_ply(b"".join(points_ply(capture, field=7)))
    np.testing.assert_array_equal(np.stack([vertices[a] for a in "xyz"], 1), points(7).xyz_mm)
    assert set(vertices["n"]) == {7}


def test_a_field_without_points_is_said_and_no_file_is_made(tmp_path):
    path = write(tmp_path, slots(3), measured=[0])
    for field in (1, 99):
        with pytest.raises(NotFound, match=f"field {field}"):
            points_ply(path, field=field)
    with pytest.raises(NotFound):
        export_ply(path, tmp_path / "out", field=99)
    assert not (tmp_path / "out").exists()


def test_a_cloud_without_points_is_a_file_too(tmp_path):
    path = write(tmp_path, slots(2), measured=[0, 5])
    vertices, _ = read_ply(b"".join(points_ply(path)))
    assert set(vertices["n"]) == {0}


def test_how_many_points_were_written_is_told(capture, tmp_path):
    assert export_ply(capture, tmp_path / "all") == 300
    assert export_ply(capture, tmp_path / "one", field=3) == 5
    assert read_ply((tmp_path / "one" / "points.ply").read_bytes())[0].shape == (5,)


# --- Parquet ---


def test_a_table_has_the_columns_of_the_csv(capture, tmp_path):
    table, text = parquet(capture, tmp_path), csv_columns(capture)
    assert table.column_names == [column.name for column in POINT_COLUMNS]
    for column in POINT_COLUMNS:
        found = table[column.name].to_pylist()
        if column.name == "time_utc":
            shown = [one.isoformat(timespec="milliseconds").replace("+00:00", "Z") for one in found]
            assert shown == text["time_utc"]
        else:
            exact = {"rtol": 0, "atol": 0} if column.name in ("x_mm", "y_mm", "z_mm") else {"rtol": 1e-5}
            np.testing.assert_allclose(found, np.array(text[column.name], float), **exact)


def test_every_column_carries_its_unit_and_meaning(capture, tmp_path):
    schema = parquet(capture, tmp_path).schema
    for column in POINT_COLUMNS:
        said = schema.field(column.name).metadata
        assert (said[b"unit"].decode(), said[b"description"].decode()) == (column.unit, column.meaning)
        assert column.name.endswith(f"_{column.unit}") or not column.unit


def test_the_file_says_which_capture_run_and_calibration_it_is_of(capture, tmp_path):
    about = json.loads(parquet(capture, tmp_path).schema.metadata[b"grabberd"])
    assert (about["capture"], about["run"], about["calibration"]) == (META.id, 1, "rig-7")
    assert about["labels"] == META.labels
    assert about["site"] == META.site


def test_a_recording_played_again_has_no_time_of_day(tmp_path):
    device = {**META.device, "stream": {"live": False}}
    table = parquet(write(tmp_path, slots(2), measured=[0], device=device), tmp_path)
    assert table["time_utc"].null_count == 5


def test_a_run_is_chosen_before_anything_is_written(capture, tmp_path):
    pytest.importorskip("pyarrow")
    assert export_parquet(capture, tmp_path / "out", run=1) == 300
    for ask in (parquet_stream, lambda path, run: export_parquet(path, tmp_path / "other", run)):
        with pytest.raises(NotFound):
            ask(capture, 2)
    assert not (tmp_path / "other").exists()


def test_without_its_optional_part_it_says_how_to_install_it(capture, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    for ask in (parquet_stream, lambda path: export_parquet(path, tmp_path / "out")):
        with pytest.raises(ExtraMissing, match="parquet") as caught:
            ask(capture)
        assert "grabberd[parquet]" in caught.value.hint
    assert not (tmp_path / "out").exists()


def test_who_turns_away_ends_the_process_that_writes(capture):
    pytest.importorskip("pyarrow")
    stream = parquet_stream(capture)
    assert next(stream)[:4] == b"PAR1"
    stream.close()


def test_units_stand_in_the_columns_names():
    assert meta().id
    assert {column.unit for column in POINT_COLUMNS} == {"", "s", "mm", "px"}


def test_the_process_that_writes_has_nothing_to_say(capture, capfd):
    pytest.importorskip("pyarrow")
    assert b"".join(parquet_stream(capture)).endswith(b"PAR1")
    assert capfd.readouterr().err == ""


def test_a_file_that_is_damaged_meanwhile_is_an_error_and_no_short_file(capture, tmp_path):
    pytest.importorskip("pyarrow")
    stream = parquet_stream(capture)
    capture.write_bytes(b"nothing")
    with pytest.raises(CaptureFileError, match="cannot be read as a capture"):
        list(stream)
