"""Groups are read as arrays or field by field, from anywhere; whatever is wrong with one is said."""

import sqlite3
import tracemalloc
from contextlib import closing

import numpy as np
import pytest

from archive.captures import (
    MADE_WITH,
    META,
    PERIOD_NS,
    ledger_of,
    packed,
    points,
    same_field,
    slot,
    slots,
    write,
)
from grabberd.archive.capture.groups import MOST_FIELDS
from grabberd.archive.capture.reader import CaptureReader
from grabberd.errors import CaptureFileError

COUNT, A_COMMIT = 60, 7


@pytest.fixture(scope="module")
def capture(tmp_path_factory):
    """Sixty fields in groups of seven, every third of them not measured."""
    measured = [n for n in range(COUNT) if n % 3]
    return write(tmp_path_factory.mktemp("groups"), slots(COUNT), measured=measured, fields_a_commit=A_COMMIT)


@pytest.fixture
def changed(tmp_path):
    """Executes statements in a capture, as its owner may have; digests would tell, so they are gone."""

    def change(*statements):
        path = write(tmp_path, slots(12), measured=range(12), fields_a_commit=4)
        with closing(sqlite3.connect(path, isolation_level=None)) as connection:
            for statement in statements:
                assert connection.execute(*statement).rowcount > 0
            connection.execute("DELETE FROM meta WHERE key GLOB 'digest*'")
        return path

    return change


@pytest.mark.parametrize(
    ("first", "end", "every"), [(0, 60, 1), (13, 29, 1), (14, 15, 1), (5, 50, 4), (61, 99, 1)]
)
def test_points_are_read_from_anywhere_to_anywhere(capture, first, end, every):
    wanted = [n for n in range(first, min(end, COUNT)) if n % 3 and n % every == 0]
    with CaptureReader(capture) as reader:
        timed = list(reader.timed_points(1, first, end, every))
        assert [n for n, _, _ in timed] == wanted
        for n, time_ns, one in timed:
            assert one.xyz_mm.tobytes() == points(n).xyz_mm.tobytes()
            assert time_ns == slot(n).numbered.time_ns
        assert reader.point_count(1, first, end, every) == 5 * len(wanted)
        if every == 1:
            assert reader.point_span(1, first, end) == (5 * len(wanted), wanted[-1] + 1 if wanted else 0)


def test_arrays_hold_the_points_of_a_group(capture):
    with CaptureReader(capture) as reader:
        second = list(reader.point_arrays(1))[1]
    assert second.n.tolist() == [7, 8, 10, 11, 13]
    assert second.counts.tolist() == [5] * 5
    assert np.diff(second.time_ns).min() >= PERIOD_NS - 7
    np.testing.assert_array_equal(second.points.xyz_mm[5:10], points(8).xyz_mm)


def test_a_commit_is_a_group_and_a_long_one_is_several(part, writer):
    writer.append(slots(25))
    writer.commit()
    writer.append([slot(n) for n in range(25, 125)])
    writer.commit()
    writer.seal(ledger_of(slots(125)), complete=True, ended_because="stopped")
    with closing(sqlite3.connect(writer.path)) as connection:
        groups = connection.execute("SELECT first_n, fields FROM pictures ORDER BY first_n").fetchall()
    assert groups == [(0, 25), (25, MOST_FIELDS), (57, MOST_FIELDS), (89, MOST_FIELDS), (121, 4)]


def test_pictures_of_another_size_begin_a_group(part, writer):
    numbered = slot(2).numbered._replace(packed=packed(2, doubled=True))
    taken = [slot(0), slot(1), slot(2)._replace(numbered=numbered), slot(3)]
    writer.append(taken)
    path = writer.seal(ledger_of(taken), complete=True, ended_because="stopped")
    with CaptureReader(path) as reader:
        for one, field in zip(taken, reader.received(), strict=True):
            same_field(one.numbered, field)


def test_points_of_fields_out_of_order_are_refused(writer):
    writer.append_points(1, 4, points(4))
    writer.append_points(1, 3, points(3))
    with pytest.raises(ValueError, match="not in order"):
        writer.commit()


def test_the_points_of_two_runs_are_kept_apart(part, writer):
    writer.begin_run(2, "live", META.created_utc, "0.1.0", MADE_WITH)
    writer.append(slots(2))
    for run, n in ((1, 0), (2, 0), (1, 1)):
        writer.append_points(run, n, points(n + run))
    path = writer.seal(ledger_of(slots(2)), complete=True, ended_because="stopped")
    with CaptureReader(path) as reader:
        assert [n for n, _ in reader.points(1)] == [0, 1]
        ((_, second),) = reader.points(2)
    assert second.xyz_mm.tobytes() == points(2).xyz_mm.tobytes()


SHORT = np.array([0, 1, 2], "<u4").tobytes()
HOSTILE = {
    "more fields than a group has": ("UPDATE points SET fields = 4000000000 WHERE first_n = 4",),
    "no fields": ("UPDATE points SET fields = 0 WHERE first_n = 4",),
    "a short column of numbers": ("UPDATE points SET field_n = ? WHERE first_n = 4", (SHORT,)),
    "a short column of counts": ("UPDATE points SET field_points = ? WHERE first_n = 4", (SHORT,)),
    "counts of another sum": ("UPDATE points SET points = 21 WHERE first_n = 4",),
    "billions of points": (
        "UPDATE points SET points = 17179869180, field_points = ? WHERE first_n = 4",
        (b"\xff" * 16,),
    ),
    "numbers that fall": (
        "UPDATE points SET field_n = ? WHERE first_n = 4",
        (np.array([0, 2, 1, 3], "<u4").tobytes(),),
    ),
    "another last number": ("UPDATE points SET last_n = 9 WHERE first_n = 4",),
    "a huge column": ("UPDATE points SET xyz_mm = zeroblob(30000000) WHERE first_n = 4",),
    "huge numbers": ("UPDATE points SET field_n = zeroblob(30000000) WHERE first_n = 4",),
    "a column of text": ("UPDATE points SET xyz_mm = 'points' WHERE first_n = 4",),
    "bytes for the names of columns": ("UPDATE points SET exact = x'00' WHERE first_n = 4",),
    "a column that is not exact": ("UPDATE points SET exact = 'xyz_mm' WHERE first_n = 4",),
    "more fields than there are": ("UPDATE pictures SET fields = 5 WHERE first_n = 4",),
    "a field that is gone": ("DELETE FROM fields WHERE n = 6",),
    "one that is too many": ("UPDATE pictures SET last_n = 8 WHERE first_n = 4",),
    "large pictures": ("UPDATE pictures SET rows = 4096, columns = 4096, bits = 8 WHERE first_n = 4",),
    "pictures as text": ("UPDATE pictures SET data = 'pictures' WHERE first_n = 4",),
    "no bits": ("UPDATE pictures SET bits = 0 WHERE first_n = 4",),
}


@pytest.mark.parametrize("case", HOSTILE)
def test_a_group_that_contradicts_itself_is_damaged_because(changed, case):
    path = changed(HOSTILE[case])
    tracemalloc.start()
    try:
        with CaptureReader(path) as reader, pytest.raises(CaptureFileError):
            assert len(list(reader.fields())) == len(list(reader.points(1))) == 12
        assert tracemalloc.get_traced_memory()[1] < 10 << 20
    finally:
        tracemalloc.stop()
    left_out = []
    with CaptureReader(path, left_out) as reader:
        list(reader.fields()), list(reader.points(1))
    assert {4, 5, 7} <= {one.n for one in left_out} <= {4, 5, 6, 7}
