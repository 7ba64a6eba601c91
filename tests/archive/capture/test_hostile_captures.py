"""A file in the folder of captures is data: whatever it holds, it is refused, and soon."""

import json
import os
import sqlite3
import time
from contextlib import closing, suppress

import pytest

from archive.captures import slots, write
from grabberd.archive.capture.digests import some_rows
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.runs import append_run
from grabberd.archive.capture.schema import TABLES
from grabberd.errors import CaptureFileError, GrabberdError

ENDLESS = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT"
SOON_S = 2.0
"""Processor time within which a file is refused."""


@pytest.fixture
def whole(tmp_path):
    return write(tmp_path, slots(3), measured=[0, 1])


@pytest.fixture
def changed(whole):
    """Executes statements in a capture, as its owner may have; digests would tell, so they are gone."""

    def change(*statements):
        with closing(sqlite3.connect(whole, isolation_level=None)) as connection:
            for statement in statements:
                connection.execute(*((statement,) if isinstance(statement, str) else statement))
            with suppress(sqlite3.Error):
                connection.execute("DELETE FROM meta WHERE key = 'digests'")
        return whole

    return change


def read_all(path):
    with CaptureReader(path) as reader:
        assert reader.ledger.total >= 0
        for run in reader.runs:
            list(reader.points(run.run))
        return list(reader.fields())


def refused_soon(path, match):
    begin_s = time.process_time()
    with pytest.raises(CaptureFileError, match=match):
        read_all(path)
    assert time.process_time() - begin_s < SOON_S


def as_view(table, select):
    return (f"DROP TABLE {table}", f"CREATE VIEW {table} AS {ENDLESS} {select} FROM n")


@pytest.mark.parametrize(
    "statements",
    [
        as_view("meta", "'id' AS key, i AS value"),
        as_view(
            "fields",
            "i AS n, i AS time_ns, 0 AS sequence, 0 AS parity, 0 AS y0, 1 AS y_step, 1 AS rows, 1 AS columns,"
            " 1 AS bits, 1 AS threshold, 'received' AS outcome, NULL AS reason, 'zlib' AS codec, x'' AS data",
        ),
        ("CREATE TRIGGER late AFTER INSERT ON runs BEGIN DELETE FROM fields; END",),
        ("CREATE VIRTUAL TABLE words USING fts5(text)",),
        ("CREATE TABLE more (data)",),
        ("CREATE INDEX slow ON fields (lower(reason))",),
        ("DROP TABLE reserve", "CREATE TABLE reserve (data BLOB NOT NULL, twice AS (data || data))"),
        ("ALTER TABLE fields ADD COLUMN more DEFAULT 1",),
        ("DROP TABLE points",),
    ],
)
def test_another_schema_is_refused_before_anything_in_it_runs(changed, statements):
    refused_soon(changed(*statements), "schema")


def test_a_large_schema_is_refused_before_it_is_read(changed):
    path = changed(*(f"CREATE TABLE t{number} (a)" for number in range(2000)))
    refused_soon(path, "schema has more than 8 entries")


def test_another_number_of_tables_is_said_beside_the_expected_one(changed):
    refused_soon(changed("CREATE TABLE more (data)"), "its schema has 9 entries, not 8")


def test_the_schema_may_be_laid_out_otherwise(whole, tmp_path):
    other = tmp_path / "other.grab"
    with closing(sqlite3.connect(other)) as new, closing(sqlite3.connect(whole)) as old:
        new.executescript(TABLES.replace(" ", "  ").replace(", ", ",\n"))
        for name in ("application_id", "user_version"):
            new.execute(f"PRAGMA {name} = {old.execute(f'PRAGMA {name}').fetchone()[0]}")
        for table in ("meta", "fields", "pictures", "ledger", "runs", "points"):
            rows = old.execute(f"SELECT * FROM {table}").fetchall()
            for row in rows:
                new.execute(f"INSERT INTO {table} VALUES ({', '.join('?' * len(row))})", row)
        new.commit()
    assert len(read_all(other)) == 3


def test_a_link_is_not_followed(whole, tmp_path):
    link = tmp_path / "link.grab"
    link.symlink_to(whole)
    refused_soon(link, "it is a link")


def test_a_pipe_is_not_waited_for(tmp_path):
    os.mkfifo(tmp_path / "pipe.grab")
    refused_soon(tmp_path / "pipe.grab", "a device")


def test_a_folder_is_no_capture(tmp_path):
    (tmp_path / "folder.grab").mkdir()
    refused_soon(tmp_path / "folder.grab", "a folder")


def test_a_journal_cannot_name_another_file_to_be_deleted(whole, tmp_path):
    victim = tmp_path / "victim"
    victim.write_text("keep me")
    name = str(victim).encode()
    journal = whole.with_name(whole.name + "-journal")
    # The end of a journal of a transaction over several databases, as SQLite writes it.
    end = (len(name).to_bytes(4, "big"), sum(name).to_bytes(4, "big"), bytes.fromhex("d9d505f920a163d7"))
    journal.write_bytes(bytes.fromhex("d9d505f920a163d7") + bytes(504) + bytes(4) + name + b"".join(end))
    refused_soon(whole, "belongs to another database")
    assert victim.read_text() == "keep me"


def test_a_write_ahead_log_is_refused_and_none_is_made(whole, tmp_path):
    with closing(sqlite3.connect(whole)) as connection:
        connection.execute("PRAGMA journal_mode = WAL")
    refused_soon(whole, "write-ahead log")
    assert [path.name for path in tmp_path.iterdir()] == [whole.name]


def with_meta(key, text):
    return (("UPDATE meta SET value = ? WHERE key = ?", (text, key)),)


NESTED = "[" * 100_000 + "]" * 100_000
OF_META = {
    "rate zero": ("rate_hz", "0"),
    "rate infinite": ("rate_hz", "1e999"),
    "rate of no number": ("rate_hz", "NaN"),
    "rate true": ("rate_hz", "true"),
    "start of 4000 digits": ("start_ns", "9" * 4000),
    "start of 5000 digits": ("start_ns", "9" * 5000),
    "start before the computer's": ("start_ns", "-1"),
    "year alone": ("created_utc", '"9999"'),
    "no date": ("created_utc", '"yesterday"'),
    "no time zone": ("created_utc", '"2026-03-01T09:30:00"'),
    "last moment of the calendar": ("created_utc", '"9999-12-31T23:59:59+00:00"'),
    "nested labels": ("labels", '{"cow": {"number": 7}}'),
    "labels that are numbers": ("labels", '{"cow": 7}'),
    "labels as a list": ("labels", '["cow"]'),
    "nesting": ("config", NESTED),
    "nesting in 50 levels": ("config", '{"a":' * 50 + "1" + "}" * 50),
    "lone surrogate": ("note", '"\\ud800"'),
    "note of a million letters": ("note", json.dumps("a" * 1_000_000)),
    "id with a path": ("id", '"../../state"'),
    "id with a line break": ("id", '"a\\nb"'),
    "empty id": ("id", '""'),
    "device without a name": ("device", "{}"),
    "device that cannot be shown": ("device", '{"name": "a\\nb"}'),
    "stream that is a number": ("device", '{"name": "cup", "stream": 1}'),
    "bits": ("bits", "7"),
    "lines": ("lines", '"woven"'),
    "state": ("state", '"armed"'),
    "trigger's number": ("extra", '{"trigger": {"n": 4000000000000}}'),
    "group": ("extra", '{"group": [1]}'),
    "rig": ("extra", '{"rig": 1}'),
    "event": ("extra", '{"rebases": [{"n": -1, "kind": "clock", "reason": ""}]}'),
    "number in place of text": ("note", 7),
    "bytes in place of text": ("note", b"\xff\xfe"),
}


@pytest.mark.parametrize("case", OF_META)
def test_metadata_outside_their_range_are_refused(changed, case):
    key, text = OF_META[case]
    refused_soon(changed(*with_meta(key, text)), "metadata|cannot be read")


def test_a_key_of_a_later_version_is_ignored(changed):
    path = changed(("INSERT INTO meta VALUES ('later', ?)", (NESTED,)))
    assert len(read_all(path)) == 3


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE fields SET n = 4000000000000 WHERE n = 2",
        "UPDATE fields SET n = -5 WHERE n = 2",
        "UPDATE fields SET time_ns = 9223372036854775807 WHERE n = 2",
        "UPDATE pictures SET rows = 16000, columns = 16000",
        "INSERT INTO ledger VALUES (3, 4000000000000, 'lost', 'time gap')",
        "INSERT INTO ledger VALUES (3, 2.5, 'lost', 'time gap')",
        "INSERT INTO ledger VALUES (3, 1, 'stolen', 'time gap')",
        "INSERT INTO ledger VALUES (3, 1, 'lost', x'00')",
        "UPDATE runs SET calibration = '[' || zeroblob(9) || ']'",
        "UPDATE runs SET run = 0",
        "UPDATE runs SET state = x'00'",
    ],
)
def test_rows_outside_their_range_are_refused(changed, statement):
    path = changed(statement)
    with pytest.raises(GrabberdError):
        read_all(path)


def test_pictures_are_read_in_parts_that_fit_into_memory(changed):
    whole = changed(
        *(
            (
                "INSERT INTO pictures SELECT ?, last_n, fields, rows, columns, bits, zeroblob(20000000) "
                "FROM pictures WHERE first_n = 0",
                (n,),
            )
            for n in range(3, 9)
        )
    )
    with closing(sqlite3.connect(whole)) as connection:
        assert len(some_rows(connection.execute("SELECT * FROM pictures ORDER BY first_n"))) == 3


def test_damage_that_only_adding_a_run_meets_is_damage_of_the_file(whole):
    content = bytearray(whole.read_bytes())
    with closing(sqlite3.connect(whole)) as connection:
        size = connection.execute("PRAGMA page_size").fetchone()[0]
        root = connection.execute(
            "SELECT rootpage FROM sqlite_schema WHERE name = 'sqlite_autoindex_points_1'"
        ).fetchone()[0]
    content[(root - 1) * size : root * size] = bytes(size)
    whole.write_bytes(content)
    with pytest.raises(CaptureFileError, match="malformed"):
        append_run(whole, "measure", "2026-03-01T09:30:00Z", "1", {}, [])
