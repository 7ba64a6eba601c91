"""Files that are read back before they get their names."""

import csv

import cv2
import numpy as np
import pytest

from grabberd.archive.export.c3d_file import Markers, c3d_frames, c3d_head, c3d_padding
from grabberd.archive.export.hdf5_file import write_hdf5
from grabberd.archive.export.mat_file import mat_check, table_struct, write_mat
from grabberd.archive.export.read_back import (
    c3d_check,
    csv_check,
    hdf5_check,
    parquet_check,
    ply_check,
    png_check,
    xml_check,
)
from grabberd.archive.export.table_files import csv_text, ply_head, ply_triangles, ply_vertices, write_parquet
from grabberd.core.chain.columns import Column, Table
from grabberd.errors import StorageError
from grabberd.files.checked_file import checked_file, text_check, write_checked

COLUMNS = (Column("n", "", "i4", "number"), Column("x_mm", "mm", "f8", "place"))
TABLE = Table("points", "points", COLUMNS, {"n": np.arange(5, dtype=np.int32), "x_mm": np.linspace(0, 1, 5)})
NAMES = ["n", "x_mm"]
PICTURE = np.arange(600, dtype=np.uint8).reshape(20, 30)
PAGE = "<!DOCTYPE html>\n<html><body><p>σ<br></p><svg><path d='M0'/></svg></body></html>"
XML = b"<VTKFile><Piece/><DataArray/><DataArray/></VTKFile>"


def five():
    return 5


def text():
    return "".join(csv_text(COLUMNS, TABLE.parts(2))).encode()


def parquet(path):
    with path.open("wb") as file:
        write_parquet(file, COLUMNS, [TABLE.rows], {})
    return path.read_bytes()


def hdf5(path):
    return write_hdf5(path, [TABLE], {}, {"grid": ("", {"u": np.zeros(3)})}).read_bytes()


def ply():
    triangles = np.array([[0, 1, 2]])
    return ply_head(COLUMNS, 5, ["σ"], 1) + ply_vertices(COLUMNS, TABLE.rows) + ply_triangles(triangles)


STRUCTS = {"points": table_struct(TABLE), "about": {"note": "σ", "units": {"x_mm": "mm"}}}


def mat(path, structs=STRUCTS):
    with path.open("wb") as file:
        write_mat(file, structs)
    return path.read_bytes()


def c3d():
    """Two markers in five frames, one of which lacks one."""
    markers = Markers(["T001", "T002"], ["", ""], 5, 50.0, 0.01, {})
    xyz_mm = np.ones((5, 2, 3))
    xyz_mm[3, 1] = np.nan
    frames = c3d_frames(xyz_mm, np.full((5, 2), 0.1), 0.01)
    return c3d_head(markers) + frames.tobytes() + c3d_padding(markers)


def png():
    return bytes(cv2.imencode(".png", PICTURE)[1])


KINDS = {
    "csv": (lambda _: text(), csv_check(NAMES, five)),
    "parquet": (parquet, parquet_check(NAMES, five)),
    "hdf5": (hdf5, hdf5_check({"points": COLUMNS}, {"points": 5}, ["grid"])),
    "ply": (lambda _: ply(), ply_check(five, 1)),
    "mat": (mat, mat_check(STRUCTS)),
    "c3d": (lambda _: c3d(), c3d_check(2, 5, 9)),
    "vtu": (lambda _: XML, xml_check({"Piece": 1, "DataArray": 2})),
    "png": (lambda _: png(), png_check(PICTURE)),
    "html": (lambda _: PAGE.encode(), text_check(PAGE)),
}


@pytest.fixture(params=KINDS)
def kind(request, tmp_path):
    """Content of a good file, and the check of it."""
    make, check = KINDS[request.param]
    return make(tmp_path / "source"), check


def test_a_good_file_gets_its_name(kind, tmp_path):
    content, check = kind
    assert write_checked(tmp_path / "out", [content], check).read_bytes() == content


@pytest.mark.parametrize(
    "spoil", [lambda one: one[: len(one) * 2 // 3], lambda _: b"", lambda _: b"\xff\0" * 99]
)
def test_a_file_that_reads_back_otherwise_is_named_and_leaves_nothing(kind, spoil, tmp_path):
    content, check = kind
    folder = tmp_path / "folder"
    folder.mkdir()
    with pytest.raises(StorageError, match="out reads back other than it was written"):
        write_checked(folder / "out", [spoil(content)], check)
    assert list(folder.iterdir()) == []


@pytest.mark.parametrize(
    ("content", "check", "said"),
    [
        (text(), csv_check(NAMES, lambda: 6), "5 rows, expected 6"),
        (text(), csv_check(["n", "y_mm"], five), "columns are n, x_mm"),
        (b"n,x_mm\r\n1\r\n", csv_check(NAMES, lambda: 1), "line 2 has 1 values of 2"),
        (ply(), ply_check(lambda: 4, 1), "5 rows, expected 4"),
        (ply(), ply_check(five, 2), "1 rows, expected 2"),
        (c3d(), c3d_check(3, 5, 9), "2 markers, expected 3"),
        (c3d(), c3d_check(2, 99, 9), "bytes, expected"),
        (c3d(), c3d_check(2, 5, 10), "9 rows, expected 10"),
        (XML, xml_check({"DataArray": 3}), "expected {'DataArray': 3}"),
        (png(), png_check(PICTURE + 1), "another one"),
        (b"<!doctype html><p><b></p>", text_check("<!doctype html><p><b></p>"), "</p> closes nothing"),
        (b"<!doctype html><p>", text_check("<!doctype html><p>"), "<p> is not closed"),
        (b"{1}", text_check("{1}"), "cannot be read"),
    ],
)
def test_what_differs_is_said(content, check, said, tmp_path):
    with pytest.raises(StorageError) as error:
        write_checked(tmp_path / "out", [content], check)
    assert said in error.value.message
    assert error.value.hint


@pytest.mark.parametrize(
    ("expected", "said"),
    [
        ({"points": STRUCTS["points"]}, "its variables are points, about"),
        (STRUCTS | {"about": {"note": "σ"}}, "the fields of about are note, units"),
        (
            STRUCTS | {"about": STRUCTS["about"] | {"note": "Å."}},
            "about.note has the size (1, 1), expected (1, 2)",
        ),
    ],
)
def test_what_differs_in_a_mat_file_is_said(expected, said, tmp_path):
    with pytest.raises(StorageError) as error:
        write_checked(tmp_path / "out", [mat(tmp_path / "source")], mat_check(expected))
    assert said in error.value.message


def test_a_file_that_exists_stays_as_it_is(tmp_path):
    (tmp_path / "out").write_text("mine")
    with pytest.raises(StorageError, match="File exists"):
        write_checked(tmp_path / "out", [text()], csv_check(NAMES, five))
    assert (tmp_path / "out").read_text() == "mine"


def test_a_writer_that_fails_leaves_nothing(tmp_path):
    def parts():
        yield b"half"
        raise RuntimeError

    with pytest.raises(RuntimeError):
        write_checked(tmp_path / "out", parts(), csv_check(NAMES, five))
    assert list(tmp_path.iterdir()) == []


def test_the_file_has_its_name_only_once_it_is_whole(tmp_path):
    with checked_file(tmp_path / "out", csv_check(NAMES, five)) as file:
        file.write(text())
        assert not (tmp_path / "out").exists()
    with (tmp_path / "out").open(newline="") as read:
        assert len(list(csv.reader(read))) == 6
