"""What is taken home from a capture: points as CSV, fields as pictures."""

import csv
import io
import math

import cv2
import numpy as np
import pytest

from grabberd.acquisition import Outcome
from grabberd.errors import CaptureFileError, InputError, NotFound, StorageError
from grabberd.field import unpack
from grabberd.storage import export_csv, export_png, field_png, points_csv
from storage.captures import COLUMNS, META, ROWS, packed, points, slot, slots, write


def rows_of(path, run=None):
    return list(csv.DictReader(io.StringIO("".join(points_csv(path, run)))))


def picture(data):
    return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)


# --- points ---


def test_there_is_a_row_for_each_target_and_field(tmp_path):
    rows = rows_of(write(tmp_path, slots(70), measured=range(70)))
    assert len(rows) == 70 * 5
    assert [int(row["target"]) for row in rows[:5]] == points(0).target.tolist()


def test_places_are_written_bit_for_bit(tmp_path):
    (first, *_) = rows_of(write(tmp_path, slots(1), measured=[0]))
    assert [float(first[f"{axis}_mm"]) for axis in "xyz"] == points(0).xyz_mm[0].tolist()


def test_standard_deviations_stand_beside_them(tmp_path):
    (first, *_) = rows_of(write(tmp_path, slots(1), measured=[0]))
    one = points(0)
    assert float(first["sigma_y_mm"]) == pytest.approx(math.sqrt(one.covariance_mm2[0, 1, 1]), rel=1e-5)
    expected = math.sqrt(one.calibration_covariance_mm2[0, 2, 2])
    assert float(first["calibration_sigma_z_mm"]) == pytest.approx(expected, rel=1e-5)
    assert float(first["residual_px"]) == pytest.approx(one.residual_px[0], rel=1e-5)
    assert float(first["right_x_px"]) == pytest.approx(one.image_px[0, 1, 0], rel=1e-5)


def test_times_count_from_the_first_field_and_from_noon_somewhere(tmp_path):
    rows = rows_of(write(tmp_path, slots(60), measured=[0, 50]))
    assert float(rows[0]["time_s"]) == 0.0
    assert float(rows[-1]["time_s"]) == pytest.approx(1.0, abs=1e-6)
    assert rows[-1]["time_utc"] == "2026-03-01T09:30:01.000Z"


def test_fields_before_the_trigger_are_earlier_than_the_capture_was_asked_for(tmp_path):
    rows = rows_of(write(tmp_path, slots(60), measured=[0], start_ns=META.start_ns + 500_000_000))
    assert rows[0]["time_utc"] == "2026-03-01T09:29:59.500Z"


def test_a_recording_that_was_played_again_has_no_time_of_day(tmp_path):
    device = {**META.device, "stream": {"live": False}}
    rows = rows_of(write(tmp_path, slots(1), measured=[0], device=device))
    assert rows[0]["time_utc"] == ""
    assert rows[0]["time_s"] == "0.000000"


def test_a_run_can_be_chosen_and_must_exist(tmp_path):
    path = write(tmp_path, slots(1), measured=[0])
    assert len(rows_of(path, 1)) == 5
    with pytest.raises(NotFound):
        points_csv(path, 2)
    with pytest.raises(CaptureFileError):
        points_csv(tmp_path / "gone.grab")


def test_the_table_is_given_in_pieces(tmp_path):
    assert len(list(points_csv(write(tmp_path, slots(70), measured=range(70))))) > 10


def test_points_are_written_into_a_new_folder(tmp_path):
    path = write(tmp_path, slots(3), measured=range(3))
    assert export_csv(path, tmp_path / "out") == 15
    assert len((tmp_path / "out" / "points.csv").read_text().splitlines()) == 16
    with pytest.raises(StorageError, match="not empty"):
        export_csv(path, tmp_path / "out")


# --- pictures ---


@pytest.mark.parametrize(("bits", "doubled"), [(1, True), (1, False), (5, False), (8, False)])
def test_a_field_is_a_grey_picture(tmp_path, bits, doubled):
    path = write(tmp_path, slots(2, bits=bits, doubled=doubled))
    luma = picture(field_png(path, 1))
    np.testing.assert_array_equal(luma, unpack(packed(1, bits, doubled)).luma)
    assert luma.shape == (2 * ROWS if doubled else ROWS, COLUMNS)


def test_a_field_that_is_not_there_has_no_picture(tmp_path):
    with pytest.raises(NotFound):
        field_png(write(tmp_path, slots(2)), 5)


def manifest(directory):
    with (directory / "fields.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def test_a_folder_of_pictures_says_what_each_is(tmp_path):
    taken = [slot(0), slot(4, lost=3), slot(5, Outcome.DAMAGED, "repeated")]
    assert export_png(write(tmp_path, taken), tmp_path / "out") == 3
    rows = manifest(tmp_path / "out")
    assert [row["n"] for row in rows] == ["0", "4", "5"]
    assert [row["outcome"] for row in rows] == ["received", "received", "damaged"]
    assert rows[2]["parity"] == rows[2]["y0"] == "1"
    assert rows[1]["time_ns"] == str(taken[1].numbered.time_ns)
    for row, one in zip(rows, taken, strict=True):
        luma = picture((tmp_path / "out" / row["file"]).read_bytes())
        np.testing.assert_array_equal(luma, unpack(one.numbered.packed).luma)


def test_intact_fields_can_be_woven_into_frames(tmp_path):
    taken = [*slots(4, bits=8), slot(5, lost=1, bits=8), slot(6, bits=8)]
    assert export_png(write(tmp_path, taken), tmp_path / "out", woven=True) == 4
    rows = manifest(tmp_path / "out")
    assert [row["file"] for row in rows] == [
        *["frame-00000000.png"] * 2,
        *["frame-00000002.png"] * 2,
        "frame-00000005.png",
        "frame-00000006.png",
    ]
    frame = picture((tmp_path / "out" / "frame-00000002.png").read_bytes())
    np.testing.assert_array_equal(frame[0::2], packed(2, 8).data[0])
    np.testing.assert_array_equal(frame[1::2], packed(3, 8).data[0])
    alone = picture((tmp_path / "out" / "frame-00000005.png").read_bytes())
    assert not alone[0::2].any()
    np.testing.assert_array_equal(alone[1::2], packed(5, 8).data[0])


def test_doubled_fields_cannot_be_woven(tmp_path):
    path = write(tmp_path, slots(2, doubled=True), lines="doubled")
    with pytest.raises(InputError, match="doubled"):
        export_png(path, tmp_path / "out", woven=True)


def test_pictures_do_not_go_among_other_files(tmp_path):
    with pytest.raises(StorageError, match="not empty"):
        export_png(write(tmp_path, slots(1)), tmp_path)
