"""`docs/reference/capture-file.md` says what is in the file."""

import json
import re
import sqlite3
from pathlib import Path

import numpy as np
import pytest

from archive.captures import packed, points, slots, write
from archive.readings import readings, write_with_channels
from grabberd.archive.capture.encodings import POINT
from grabberd.archive.capture.schema import APPLICATION_ID, VERSION
from grabberd.archive.export.field_pictures import MANIFEST_COLUMNS

TEXT = (Path(__file__).parents[2] / "docs" / "reference" / "capture-file.md").read_text(encoding="utf-8")


@pytest.fixture
def capture(tmp_path, monkeypatch):
    path = write(tmp_path, slots(3), measured=range(3))
    monkeypatch.chdir(tmp_path)
    connection = sqlite3.connect(path)
    yield connection
    connection.close()


def section(name):
    return TEXT.split(f"## {name}\n")[1].split("\n## ")[0]


def program(name):
    """Everything that the program in a section makes."""
    code = "\n".join(line[4:] for line in section(name).splitlines() if line.startswith("    "))
    found = {}
    exec(code, found)
    found["capture"].close()
    return found


def test_every_table_and_column_is_described(capture):
    for (table,) in capture.execute("SELECT name FROM sqlite_schema WHERE type = 'table'").fetchall():
        columns = [row[1] for row in capture.execute(f"PRAGMA table_info({table})")]
        assert [c for c in columns if f"`{c}`" not in section(table)] == []


def test_every_key_of_the_meta_data_is_described(capture):
    keys = [key for key, value in capture.execute("SELECT key, value FROM meta") if json.loads(value) != ""]
    described = [re.sub(r"\.\d{7}(?=\.|$)", ".RUN", re.sub(r"\.\d{10}$", ".N", key)) for key in keys]
    assert [key for key in described if f"`{key}`" not in section("meta")] == []


def test_every_column_of_the_manifest_is_described():
    assert [c for c in MANIFEST_COLUMNS if f"`{c}`" not in section("Exports")] == []


def test_the_numbers_are_right():
    assert f"0x{APPLICATION_ID:x}" in TEXT
    assert f"the version of this layout: {VERSION}." in TEXT
    assert f"{POINT.itemsize} bytes each" in TEXT


def test_the_program_in_it_reads_the_points(capture):
    found = program("points")
    for name in ("target", "xyz_mm"):
        expected = np.concatenate([getattr(points(n), name) for n in range(3)])
        np.testing.assert_array_equal(found[name], expected)
    assert found["n"].tolist() == [0] * 5 + [1] * 5 + [2] * 5
    np.testing.assert_array_equal(found["image_px"][5:10], points(1).image_px.reshape(5, 4))
    np.testing.assert_allclose(found["covariance_mm2"][10:], points(2).covariance_mm2, rtol=1e-12)


def test_the_tables_of_channels_are_described_and_the_program_reads_them(tmp_path, monkeypatch):
    path = write_with_channels(tmp_path, slots(60))
    connection = sqlite3.connect(path)
    for table in ("channels", "readings"):
        columns = [row[1] for row in connection.execute(f"PRAGMA table_info({table})")]
        assert [c for c in columns if f"`{c}`" not in section(table)] == []
    connection.close()
    monkeypatch.chdir(tmp_path)
    found = program("readings")
    expected = readings(0, 240)
    np.testing.assert_array_equal(found["time_ns"], expected.time_ns)
    np.testing.assert_array_equal(found["value"], expected.value)
    np.testing.assert_allclose(found["kpa"], 101.3 - 0.1 * expected.value)


@pytest.mark.parametrize("bits", [1, 6, 8])
def test_the_program_in_it_reads_the_pictures(tmp_path, monkeypatch, bits):
    write(tmp_path, slots(3, bits=bits), bits=bits)
    monkeypatch.chdir(tmp_path)
    found = program("pictures")
    if bits == 8:
        np.testing.assert_array_equal(found["grey"][1], packed(1, 8).data[0])
    else:
        expected = np.unpackbits(packed(1, bits).data, axis=2)[..., : found["columns"]]
        np.testing.assert_array_equal(found["pixels"][1], expected)


def test_columns_of_format_1_are_described():
    assert [name for name in POINT.names if f"`{name}`" not in section("Format 1")] == []
