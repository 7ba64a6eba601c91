"""Files of earlier versions: captures are read, the state is brought up to date, the index is made again.

The layouts stand here as they were written then, and stay as they are whatever becomes of the program's own.
"""

import json
import sqlite3
import zlib
from contextlib import closing

import numpy as np
import pytest

from archive.captures import points, slots, write
from grabberd.archive.capture.crash_recovery import recover
from grabberd.archive.capture.encodings import decode_field_points
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.runs import append_run
from grabberd.archive.export.field_pictures import export_png
from grabberd.archive.export.points_export import export_csv
from grabberd.archive.state.capture_index import CaptureIndex
from grabberd.archive.state.state_database import (
    MIGRATIONS,
    Annotation,
    AnnotationStore,
    StateDatabase,
    StateStore,
    TokenStore,
)

CAPTURE_1 = """
CREATE TABLE meta (key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID;
CREATE TABLE fields (
    n INTEGER PRIMARY KEY, time_ns INTEGER NOT NULL, sequence INTEGER, parity INTEGER NOT NULL,
    y0 INTEGER NOT NULL, y_step INTEGER NOT NULL, rows INTEGER NOT NULL, columns INTEGER NOT NULL,
    bits INTEGER NOT NULL, threshold INTEGER NOT NULL, outcome TEXT NOT NULL, reason TEXT,
    codec TEXT NOT NULL, data BLOB NOT NULL);
CREATE TABLE ledger (
    first_n INTEGER PRIMARY KEY, count INTEGER NOT NULL, outcome TEXT NOT NULL, reason TEXT NOT NULL);
CREATE TABLE runs (
    run INTEGER PRIMARY KEY, kind TEXT NOT NULL, created_utc TEXT NOT NULL, version TEXT NOT NULL,
    state TEXT NOT NULL, reason TEXT, calibration TEXT NOT NULL, object TEXT NOT NULL,
    settings TEXT NOT NULL);
CREATE TABLE points (
    run INTEGER NOT NULL, n INTEGER NOT NULL, count INTEGER NOT NULL, data BLOB NOT NULL,
    PRIMARY KEY (run, n)) WITHOUT ROWID;
CREATE TABLE reserve (data BLOB NOT NULL);
PRAGMA application_id = 0x67726162;
PRAGMA user_version = 1;
"""
META_1 = {
    "id": "c1",
    "created_utc": "2026-03-01T09:30:00.000Z",
    "start_ns": 0,
    "device": {"name": "teatcup", "driver": "fake", "options": {}, "stream": {"live": True}},
    "config": {},
    "site": {},
    "labels": {"cow": "112"},
    "note": "",
    "bits": 1,
    "lines": "field",
    "rate_hz": 50.0,
    "version": "0.1.0",
    "state": "sealed",
    "complete": True,
    "ended_because": "stopped",
}
LUMA = np.arange(24 * 40).reshape(24, 40) % 3 == 0
FIELD_1 = zlib.compress(np.packbits(LUMA, axis=1).tobytes())
POINT_1 = np.zeros(2, "<i4, (3,)<f8, (6,)<f4, (6,)<f4, (4,)<f4, <f4")
POINT_1["f0"], POINT_1["f1"] = (7, 9), [(1, 2, 3), (4, 5, 6)]


def capture_1(path, **changes):
    """A capture as version 1 first wrote it."""
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.executescript(CAPTURE_1)
        meta = [(key, json.dumps(value)) for key, value in {**META_1, **changes}.items()]
        connection.executemany("INSERT INTO meta VALUES (?, ?)", meta)
        for n in range(3):
            row = (n, n * 20_000_000, None, n % 2, n % 2, 2, 24, 40, 1, 60, "received", None, "zlib", FIELD_1)
            connection.execute("INSERT INTO fields VALUES (?,?,?,?,?,?,?,?,?,?,?,?,?,?)", row)
        run = (1, "live", "2026-03-01T09:30:00.000Z", "0.1.0", "done", None, "{}", "{}", "{}")
        connection.execute("INSERT INTO runs VALUES (?,?,?,?,?,?,?,?,?)", run)
        connection.execute("INSERT INTO points VALUES (1, 0, 2, ?)", (zlib.compress(POINT_1.tobytes()),))
        connection.execute("INSERT INTO reserve VALUES (zeroblob(1000))")
    return path


def test_the_first_captures_are_read(tmp_path):
    with CaptureReader(capture_1(tmp_path / "c1.grab")) as reader:
        assert reader.meta.labels == {"cow": "112"}
        assert reader.meta.extra == {}
        assert reader.ledger.complete
        (n, first), *_ = reader.points()
        assert (n, first.target.tolist(), first.xyz_mm.tolist()) == (0, [7, 9], [[1, 2, 3], [4, 5, 6]])
        packed = reader.field(1).numbered.packed
        np.testing.assert_array_equal(np.unpackbits(packed.data[0], axis=1, count=40), LUMA)


def test_they_are_exported_and_measured_again(tmp_path):
    path = capture_1(tmp_path / "c1.grab")
    assert append_run(path, "measure", "", "", {}, [(0, points(0))]) == 2
    assert export_csv(path, tmp_path / "csv", run=1) == 2
    assert export_png(path, tmp_path / "png") == 3
    with closing(sqlite3.connect(path)) as connection:
        count, data = connection.execute("SELECT count, data FROM points WHERE run = 1").fetchone()
    assert decode_field_points(data, count).target.tolist() == [7, 9]


def test_one_that_was_being_recorded_at_the_update_is_sealed(tmp_path):
    part = capture_1(tmp_path / "c1.grab.part", state="recording", complete=None, ended_because=None)
    with CaptureReader(recover(part)) as reader:
        assert (reader.meta.state, reader.meta.complete, reader.field_count) == ("sealed", False, 3)


def test_a_missing_key_that_has_no_default_is_damage(tmp_path):
    path = capture_1(tmp_path / "c1.grab")
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute("DELETE FROM meta WHERE key = 'bits'")
    index = CaptureIndex(tmp_path)
    index.rebuild()
    assert index.get("c1").state == "damaged"


@pytest.mark.parametrize("version", range(len(MIGRATIONS) + 1))
def test_every_version_of_the_state_is_brought_up_to_date_and_keeps_what_is_in_it(tmp_path, version):
    """The first made its one table without saying a version."""
    path = tmp_path / "state.sqlite"
    with closing(sqlite3.connect(path)) as connection, connection:
        connection.execute("CREATE TABLE settings (key TEXT PRIMARY KEY, value TEXT NOT NULL) WITHOUT ROWID")
        connection.execute("INSERT INTO settings VALUES ('threshold', '60')")
        for statements in MIGRATIONS[1:version]:
            for statement in statements:
                connection.execute(statement)
        connection.execute(f"PRAGMA user_version = {version}")
    for _ in range(2):
        StateDatabase(path).open()
        assert StateStore(path).get("threshold") == 60
    TokenStore(path).add("tablet", "viewer", b"hash", "2026-03-01T09:30:00.000Z")
    AnnotationStore(path).put("c1", Annotation(pinned=True))
    with closing(sqlite3.connect(path)) as connection:
        assert connection.execute("PRAGMA user_version").fetchone()[0] == len(MIGRATIONS)


def test_a_migration_that_fails_changes_nothing(tmp_path, monkeypatch):
    path = tmp_path / "state.sqlite"
    StateStore(path).open()
    StateStore(path).put({"threshold": 60})
    broken = (*MIGRATIONS, ("CREATE TABLE other (key TEXT)", "CREATE TABLE settings (key TEXT)"))
    monkeypatch.setattr(StateStore, "migrations", broken)
    with pytest.raises(Exception, match="already exists"):
        StateStore(path).open()
    monkeypatch.undo()
    StateStore(path).open()
    assert StateStore(path).get("threshold") == 60
    with closing(sqlite3.connect(path)) as connection:
        assert connection.execute("SELECT 1 FROM sqlite_schema WHERE name = 'other'").fetchone() is None


def test_an_index_of_another_layout_is_made_again(tmp_path):
    write(tmp_path, slots(2), name="c1", id="c1")
    with closing(sqlite3.connect(tmp_path / "index.sqlite")) as connection, connection:
        connection.execute("CREATE TABLE captures (name TEXT)")
    index = CaptureIndex(tmp_path)
    index.rebuild()
    assert [entry.id for entry in index.list()] == ["c1"]
