"""Fields of a capture as pictures."""

import csv

import cv2
import numpy as np
import pytest

from archive.captures import COLUMNS, ROWS, packed, slot, slots, write
from grabberd.archive.export.field_pictures import export_png, field_png
from grabberd.core.field import Field, quantise, unpack
from grabberd.core.ledger import Outcome
from grabberd.errors import NotFound, StorageError


def replace_packed(one, packed):
    return one._replace(numbered=one.numbered._replace(packed=packed))


def picture(data):
    return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)


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


def test_a_progressive_picture_stays_whole(tmp_path):
    whole = Field.progressive(np.arange(ROWS * COLUMNS, dtype=np.uint8).reshape(ROWS, COLUMNS))
    taken = [replace_packed(slot(n, bits=8), quantise(whole, 8, 60)) for n in range(2)]
    assert export_png(write(tmp_path, taken), tmp_path / "out") == 2
    assert [(row["parity"], row["y0"], row["y_step"]) for row in manifest(tmp_path / "out")] == [
        ("2", "0", "1")
    ] * 2
    again = picture((tmp_path / "out" / "field-00000001.png").read_bytes())
    np.testing.assert_array_equal(again, whole.luma)


def test_pictures_do_not_go_among_other_files(tmp_path):
    with pytest.raises(StorageError, match="not empty"):
        export_png(write(tmp_path, slots(1)), tmp_path)
