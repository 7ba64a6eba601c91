"""Files of a data set: read back before they get their names."""

import json

import numpy as np
import pytest

from archive.damage import damage, every_way
from grabberd.archive.capture.content_digest import document_sha256
from grabberd.archive.export.dataset import DataSet, read_about, write_dataset_file
from grabberd.archive.export.points_columns import POINT_COLUMNS
from grabberd.errors import StorageError

ABOUT = {
    "capture": {"id": "20260301T120000-liner"},
    "device": "cup",
    "calibration": {"id": "rig"},
    "labels": {"cow": "812"},
}


def fields(count, points=70):
    """Rows of so many fields, no two values alike."""
    rng = np.random.default_rng(1)
    for n in range(count):
        rows = {column.name: rng.normal(size=points) for column in POINT_COLUMNS if column.dtype == "f8"}
        numbers = {
            column.name: np.full(points, n).astype(column.dtype)
            for column in POINT_COLUMNS
            if column.name not in rows
        }
        yield 1, rows | numbers


def written(folder, count=5):
    return write_dataset_file(folder / "part", folder / "out" / "a.parquet", fields(count), ABOUT)


def test_a_whole_file_gets_its_name_and_tells_its_origin(tmp_path):
    assert written(tmp_path) == (5, 350)
    assert read_about(tmp_path / "out" / "a.parquet") == {**ABOUT, "fields": 5, "points": 350}


@every_way
def test_a_file_damaged_before_it_is_read_back_gets_no_name(tmp_path, monkeypatch, spoil):
    damage(monkeypatch, spoil)
    with pytest.raises(StorageError, match=r"a\.parquet reads back other than it was written") as caught:
        written(tmp_path)
    assert caught.value.hint
    assert [path.name for path in tmp_path.iterdir()] == ["part.fields"]


def test_an_older_file_of_that_name_stays(tmp_path, monkeypatch):
    written(tmp_path, 3)
    damage(monkeypatch, lambda content: content[:-1])
    with pytest.raises(StorageError):
        written(tmp_path)
    assert read_about(tmp_path / "out" / "a.parquet")["fields"] == 3


@every_way
def test_a_damaged_document_is_not_kept(tmp_path, monkeypatch, spoil):
    document = {"id": "rig", "views": [{"name": name, "shift_px": [0.25] * 40} for name in ("left", "right")]}
    damage(monkeypatch, spoil)
    with DataSet(tmp_path) as data, pytest.raises(StorageError, match="reads back other"):
        data.keep(document)
    assert list(data.made_with.iterdir()) == []
    monkeypatch.undo()
    with DataSet(tmp_path) as data:
        kept = data.made_with / f"{data.keep(document)}.json"
    assert document_sha256(json.loads(kept.read_text())) == kept.stem
