"""`docs/reference/capture-file.md` says what is in the file."""

import json
import re
import sqlite3
from pathlib import Path

import numpy as np
import pytest

from grabberd.storage.capture.codec import POINT
from grabberd.storage.capture.schema import APPLICATION_ID, VERSION
from grabberd.storage.export.field_pictures import MANIFEST_COLUMNS
from storage.captures import points, slots, write

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
    code = "\n".join(line[4:] for line in section("points").splitlines() if line.startswith("    "))
    found = {}
    exec(code, found)
    found["capture"].close()
    np.testing.assert_array_equal(found["points"]["xyz_mm"], points(2).xyz_mm)
