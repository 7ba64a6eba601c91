"""A capture of format 1 is converted whole, or stays as it is."""

import os
import sqlite3
from contextlib import closing
from datetime import UTC, datetime

import pytest

from archive.capture.groups.test_quanta import ARRAYS
from archive.captures import same_field, slot, slots, write
from archive.first_format import write_first_format
from grabberd.archive.capture import conversion
from grabberd.archive.capture.content_digest import content_sha256
from grabberd.archive.capture.conversion import convert
from grabberd.archive.capture.encodings import quantised
from grabberd.archive.capture.meta import read_conversion
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.runs import append_run
from grabberd.archive.capture.schema import connect, format_of
from grabberd.archive.capture.verification import verify
from grabberd.core.ledger import Outcome
from grabberd.errors import CaptureFileError, GrabberdError, StorageError

NOW = datetime(2026, 11, 26, 9, 30, tzinfo=UTC)
TAKEN = [
    *slots(30),
    slot(33, lost=3),
    slot(34, Outcome.DAMAGED, "copied rows"),
    slot(35, Outcome.NO_SIGNAL, "no signal"),
    *[slot(n) for n in range(36, 80)],
]
MEASURED = [one.n for one in TAKEN if one.outcome is Outcome.RECEIVED]


@pytest.fixture
def capture(tmp_path):
    """A capture of format 1 with a live run and one that was measured later."""
    return write_first_format(
        tmp_path, TAKEN, measured=MEASURED, again=MEASURED[5:], coverage={1: {"share": 0.9}}
    )


def points_of(path, run):
    with CaptureReader(path) as reader:
        return dict(reader.points(run))


def same_points(one, other):
    assert list(one) == list(other)
    for n in one:
        assert all(getattr(one[n], name).tobytes() == getattr(other[n], name).tobytes() for name in ARRAYS), n


def everything(path):
    with CaptureReader(path) as reader:
        ledger = reader.ledger
        told = (reader.meta, reader.runs, ledger.received, ledger.entries, ledger.events)
        return told, list(reader.fields())


def test_all_of_a_capture_is_there_afterwards(capture):
    told, fields = everything(capture)
    points = {run: points_of(capture, run) for run in (1, 2)}
    shares = []
    sizes = convert(capture, NOW, shares.append)
    assert shares == sorted(shares)
    assert sizes.after_bytes == capture.stat().st_size
    with closing(connect(capture)) as connection:
        assert format_of(connection) == 2
    now, now_fields = everything(capture)
    assert now == told
    for one, other in zip(fields, now_fields, strict=True):
        same_field(one.numbered, other.numbered)
        assert one[1:] == other[1:]
    for run, before in points.items():
        same_points({n: quantised(one) for n, one in before.items()}, points_of(capture, run))
    assert verify(capture) == (len(fields), len(points[1]) + len(points[2]), 0, True, [])
    assert [file.name for file in capture.parent.iterdir()] == [capture.name]


def test_what_it_was_measured_from_keeps_its_digest_and_when_it_was_changed_its_time(capture):
    with CaptureReader(capture) as reader:
        before = content_sha256(capture, reader.meta)
    os.utime(capture, (1_700_000_000, 1_700_000_000))
    capture.chmod(0o640)
    convert(capture, NOW)
    with CaptureReader(capture) as reader:
        assert content_sha256(capture, reader.meta) == before
    assert capture.stat().st_mtime == 1_700_000_000
    assert capture.stat().st_mode & 0o777 == 0o640
    with closing(connect(capture)) as connection:
        found = read_conversion(connection)
    assert (found.version, found.converted_utc) == (1, "2026-11-26T09:30:00+00:00")


def test_the_digest_of_what_a_capture_of_format_2_was_measured_from_tells_of_every_change(tmp_path):
    digests = set()
    for name, taken in (("a", slots(5)), ("b", slots(6)), ("c", [*slots(4), slot(4, reason="predicted")])):
        path = write(tmp_path, taken, name=name)
        with CaptureReader(path) as reader:
            digests.add(content_sha256(path, reader.meta))
            assert content_sha256(path, reader.meta) in digests
    assert len(digests) == 3


def test_a_capture_of_todays_format_stays_as_it_is(tmp_path):
    path = write(tmp_path, slots(3))
    before = path.read_bytes()
    sizes = convert(path, NOW)
    assert sizes.before_bytes == sizes.after_bytes
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    "statement",
    [
        "UPDATE fields SET threshold = threshold + 1 WHERE n = 7",
        "UPDATE points SET data = zeroblob(9) WHERE n = 7 AND run = 2",
        "DELETE FROM fields WHERE n = 7",
        "UPDATE meta SET value = '49.0' WHERE key = 'rate_hz'",
    ],
)
def test_a_damaged_capture_is_kept(capture, statement):
    with closing(sqlite3.connect(capture, isolation_level=None)) as connection:
        connection.execute(statement)
    kept_as_it_is(capture, CaptureFileError, "it is")


def test_a_capture_that_is_not_sealed_is_kept(capture):
    with closing(sqlite3.connect(capture, isolation_level=None)) as connection:
        connection.execute("UPDATE meta SET value = '\"recording\"' WHERE key = 'state'")
    kept_as_it_is(capture, CaptureFileError, "is not sealed")


def test_a_new_file_that_differs_is_thrown_away(capture, monkeypatch):
    other = slot(3).numbered._replace(time_ns=1)
    monkeypatch.setattr(
        conversion,
        "_slot",
        lambda one: slot(one.numbered.n)._replace(
            numbered=other if one.numbered.n == 3 else one.numbered, outcome=one.outcome, reason=one.reason
        ),
    )
    kept_as_it_is(capture, StorageError, "differs: field 3")


def test_a_conversion_that_fails_half_way_leaves_nothing(capture, monkeypatch):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(conversion, "_finish", full)
    kept_as_it_is(capture, StorageError, "No space left")


def kept_as_it_is(path, error, words):
    before = path.read_bytes()
    with pytest.raises(GrabberdError, match=words) as raised:
        convert(path, NOW)
    assert isinstance(raised.value, error)
    assert path.read_bytes() == before
    assert [file.name for file in path.parent.iterdir()] == [path.name]


def test_what_a_killed_conversion_left_is_removed_by_the_next(capture):
    left = capture.with_name(f"{conversion.FOLDER}{capture.name}")
    left.mkdir()
    (left / f"{capture.name}.part").write_bytes(b"half a capture")
    convert(capture, NOW)
    assert list(capture.parent.iterdir()) == [capture]


def test_a_run_is_not_added_to_a_file_that_was_converted_meanwhile(capture):
    def measured():
        yield 0, points_of(capture, 1)[0]
        convert(capture, NOW)

    with pytest.raises(StorageError, match="was replaced meanwhile"):
        append_run(capture, "measure", "", "", {}, measured())
    with CaptureReader(capture) as reader:
        assert [run.run for run in reader.runs] == [1, 2]


def test_whoever_reads_a_capture_reads_on_while_it_is_converted(capture):
    with CaptureReader(capture) as reader:
        fields = reader.fields()
        first = next(fields)
        convert(capture, NOW)
        assert [first.numbered.n, *(one.numbered.n for one in fields)] == [
            one.n for one in TAKEN if one.numbered
        ]
