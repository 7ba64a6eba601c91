"""A sealed capture proves itself: whatever the disk has changed is found, and the rest can be read."""

import sqlite3
from contextlib import closing

import numpy as np
import pytest

from archive.captures import MADE_WITH, META, ledger_of, meta, points, same_field, slot, slots, write
from archive.first_format import write_first_format
from grabberd.archive.capture.crash_recovery import recover
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.runs import append_run
from grabberd.archive.capture.verification import verify
from grabberd.archive.capture.writer import CaptureWriter
from grabberd.errors import CaptureFileError, GrabberdError

COMMITS = ([*slots(4), slot(6, lost=2)], [slot(n) for n in range(7, 11)])
MEASURED = (0, 1, 2, 3, 6, 7, 9, 10)
FLIPS = 30
"""On every page that holds something."""
USED_BYTES = 200
"""A page with fewer bytes that are not zero has nothing but heads, or is free."""


@pytest.fixture
def part(tmp_path):
    """A capture of two commits that was not sealed."""
    writer = CaptureWriter.create(tmp_path / "liner.grab.part", meta())
    writer.begin_run(1, "live", META.created_utc, "0.1.0", MADE_WITH)
    for one in (one for taken in COMMITS for one in taken):
        writer.append([one])
        if one.n in MEASURED:
            writer.append_points(1, one.n, points(one.n))
        writer.commit()
    return writer


@pytest.fixture
def sealed(part):
    ledger = ledger_of([one for taken in COMMITS for one in taken])
    path = part.seal(ledger, complete=False, ended_because="stopped", coverage={1: {"share": 0.9}})
    again = ((n, points(n + 50)) for n in MEASURED)
    append_run(path, "measure", META.created_utc, "0.1.0", MADE_WITH, again, lambda: {"share": 0.8})
    return path


@pytest.fixture
def first_format(tmp_path):
    taken = [one for some in COMMITS for one in some]
    coverage = {1: {"share": 0.9}, 2: {"share": 0.8}}
    return write_first_format(tmp_path, taken, measured=MEASURED, again=MEASURED, coverage=coverage)


def change(path, statement):
    with closing(sqlite3.connect(path, isolation_level=None)) as connection:
        assert connection.execute(statement).rowcount > 0
    return path


def content(path):
    """All that a reader gives of a capture."""
    with CaptureReader(path) as reader:
        ledger = reader.ledger
        runs = [(run, list(reader.points(run.run))) for run in reader.runs]
        return reader.meta, (ledger.received, ledger.entries), list(reader.fields()), runs


def same_content(one, other):
    assert one[:2] == other[:2]
    for (field, *rest), (other_field, *other_rest) in zip(one[2], other[2], strict=True):
        same_field(field, other_field)
        assert rest == other_rest
    for (run, of_run), (other_run, of_other_run) in zip(one[3], other[3], strict=True):
        assert run == other_run
        for (n, some), (other_n, others) in zip(of_run, of_other_run, strict=True):
            assert n == other_n
            for name in ("target", "xyz_mm", "covariance_mm2", "image_px", "residual_px"):
                np.testing.assert_array_equal(getattr(some, name), getattr(others, name))


def test_a_sound_capture_is_found_sound(sealed):
    assert verify(sealed) == (9, 16, 0, True, [])


def is_found(path, whole, place, written):
    """True if a flipped bit is told of; otherwise it must have changed nothing."""
    flipped = bytearray(whole)
    flipped[place // 8] ^= 1 << place % 8
    path.write_bytes(flipped)
    try:
        if verify(path).damages:
            return True
    except GrabberdError:
        return True
    same_content(content(path), written)
    return False


def test_a_bit_that_flips_on_any_page_of_the_file_is_found_or_changes_nothing(sealed):
    whole, written = np.frombuffer(sealed.read_bytes(), np.uint8), content(sealed)
    page = int.from_bytes(whole[16:18].tobytes(), "big")
    rng = np.random.default_rng(20)
    for first in range(0, len(whole), page):
        used = first + np.flatnonzero(whole[first : first + page])
        anywhere = 8 * first + rng.integers(0, 8 * page, 2)
        assert all(is_found(sealed, whole, place, written) in (True, False) for place in anywhere)
        if len(used) > USED_BYTES:
            found = [is_found(sealed, whole, 8 * place, written) for place in rng.choice(used, FLIPS)]
            assert sum(found) > FLIPS / 2, f"page {first // page}: {found}"


OF_ALL = [
    ("UPDATE fields SET time_ns = time_ns + 1 WHERE n = 7", "field 7: it is not what was written"),
    ("UPDATE fields SET threshold = threshold + 1 WHERE n = 2", "field 2: it is not what was written"),
    ("UPDATE fields SET outcome = 'damaged' WHERE n = 2", "field 2: it is not what was written"),
    ("UPDATE meta SET value = '49.0' WHERE key = 'rate_hz'", "its metadata: it is not"),
    ("UPDATE meta SET value = '{}' WHERE key = 'coverage.2'", "run 2: it is not"),
    ("UPDATE ledger SET reason = 'time gaq'", "its ledger: it is not"),
    ("DELETE FROM ledger", "its ledger: it is not"),
    ("UPDATE runs SET calibration = '{}' WHERE run = 1", "run 1: it is not"),
    ("DELETE FROM runs WHERE run = 2", "run 2: it is not"),
    ("DELETE FROM meta WHERE key = 'digest.sealed'", "the digest of its metadata and ledger"),
    ("UPDATE meta SET key = 'digess' WHERE key GLOB 'digest.fields.*7'", "field 7: it is not"),
    ("DELETE FROM meta WHERE key GLOB 'digest.points.0000001.*7'", "run 1: it is not"),
    ("UPDATE meta SET value = '[1]' WHERE key GLOB 'digest.fields.*7'", "its metadata: it is not"),
]
OF_GROUPS = [
    ("UPDATE fields SET n = 5 WHERE n = 6", "field 6: it is not what was written"),
    ("UPDATE fields SET n = 5 WHERE n = 6", "1 field without a picture"),
    ("DELETE FROM fields WHERE n = 0", "field 0: it is not what was written"),
    ("DELETE FROM pictures WHERE first_n = 0", "field 0: it is missing"),
    ("DELETE FROM pictures WHERE first_n = 10", "field 10: it is missing"),
    ("DELETE FROM pictures WHERE first_n = 10", "1 field without a picture"),
    ("UPDATE pictures SET rows = rows + 1 WHERE first_n = 3", "field 3: it is not what was written"),
    ("UPDATE points SET points = 4 WHERE first_n = 3 AND run = 1", "points, field 3: it is not"),
    ("UPDATE points SET exact = 'xyz_mm' WHERE first_n = 3 AND run = 1", "points, field 3: it is not"),
    ("DELETE FROM points WHERE first_n = 3 AND run = 1", "points, field 3: it is missing"),
    ("DELETE FROM points WHERE first_n = 0 AND run = 2", "points of run 2, field 7: it is missing"),
    ("UPDATE points SET target = zeroblob(9) WHERE run = 2", "points of run 2, field 3: it is"),
]
OF_ROWS = [
    ("UPDATE fields SET n = 5 WHERE n = 6", "field 5: it is not what was written"),
    ("DELETE FROM fields WHERE n = 0", "field 0: it is missing"),
    ("DELETE FROM fields WHERE n = 10", "field 10: it is missing"),
    ("UPDATE points SET count = 4 WHERE n = 3 AND run = 1", "points, field 3: it is not"),
    ("DELETE FROM points WHERE n = 3 AND run = 2", "points of run 2, field 3: it is missing"),
    ("UPDATE points SET data = zeroblob(9) WHERE n = 3 AND run = 2", "points of run 2, field 3: it is"),
]


@pytest.mark.parametrize(("statement", "damage"), [*OF_ALL, *OF_GROUPS])
def test_what_was_changed_is_named(sealed, statement, damage):
    assert any(words.startswith(damage) for words in verify(change(sealed, statement)).damages)


@pytest.mark.parametrize(("statement", "damage"), [*OF_ALL, *OF_ROWS])
def test_what_was_changed_in_a_file_of_format_1_is_named(first_format, statement, damage):
    assert any(words.startswith(damage) for words in verify(change(first_format, statement)).damages)


def test_a_damaged_group_costs_its_fields_alone(sealed):
    change(sealed, "UPDATE fields SET time_ns = time_ns + 1 WHERE n = 7")
    change(sealed, "DELETE FROM pictures WHERE first_n = 2")
    change(sealed, "UPDATE points SET target = zeroblob(9) WHERE first_n = 3 AND run = 1")
    assert verify(sealed)[:2] == (7, 15)
    left_out = []
    with CaptureReader(sealed, left_out) as reader:
        assert [one.n for one in reader.received()] == [0, 1, 3, 6, 8, 9, 10]
        assert sorted((one.what, one.n) for one in left_out) == [("field", 2), ("field", 7)]
        left_out.clear()
        assert [n for n, _ in reader.points(1)] == [0, 1, 2, 6, 7, 9, 10]
        assert [one.in_words.split(":")[0] for one in left_out] == ["points, field 3"]


def test_all_fields_of_a_damaged_group_are_told(tmp_path):
    taken = slots(12)
    path = write(tmp_path, taken, measured=range(12), fields_a_commit=4)
    change(path, "UPDATE pictures SET data = zeroblob(9) WHERE first_n = 4")
    change(path, "DELETE FROM points WHERE first_n = 0")
    left_out = []
    with CaptureReader(path, left_out) as reader:
        assert [one.n for one in reader.received()] == [0, 1, 2, 3, 8, 9, 10, 11]
        assert [(one.what, one.n) for one in left_out] == [("field", n) for n in (4, 5, 6, 7)]
        left_out.clear()
        assert [one.n for one in reader.received(6, 9)] == [8]
        assert [one.n for one in left_out] == [6, 7]
        left_out.clear()
        reader.check_points(1)
        assert [one.n for one in left_out] == [0, 1, 2, 3]


def test_a_damaged_field_of_format_1_costs_itself_alone(first_format):
    change(first_format, "UPDATE fields SET time_ns = time_ns + 1 WHERE n = 7")
    change(first_format, "DELETE FROM fields WHERE n = 2")
    change(first_format, "UPDATE points SET data = zeroblob(9) WHERE n = 3 AND run = 2")
    assert verify(first_format)[:2] == (7, 15)
    left_out = []
    with CaptureReader(first_format, left_out) as reader:
        assert [one.n for one in reader.received()] == [0, 1, 3, 6, 8, 9, 10]
        assert sorted((one.what, one.n) for one in left_out) == [("field", 2), ("field", 7)]
        left_out.clear()
        assert [n for n, _ in reader.points(2)] == [0, 1, 6, 7, 9, 10]
        assert [one.in_words.split(":")[0] for one in left_out] == ["points, field 3"]


def test_whoever_asks_for_a_damaged_field_is_told(sealed):
    change(sealed, "UPDATE fields SET time_ns = time_ns + 1 WHERE n = 7")
    change(sealed, "DELETE FROM pictures WHERE first_n = 2")
    with CaptureReader(sealed) as reader:
        with pytest.raises(CaptureFileError, match="field 7: it is not what was written"):
            reader.field(7)
        with pytest.raises(CaptureFileError, match="field 2: it is missing"):
            reader.field(2)
        with pytest.raises(CaptureFileError, match=r"field [27]: it is"):
            list(reader.received())
        assert reader.field(8).numbered.n == 8


def test_damaged_points_are_known_before_the_first_one_is_sent(sealed):
    change(sealed, "UPDATE points SET target = zeroblob(9) WHERE run = 2")
    with CaptureReader(sealed) as reader:
        reader.check_points(1)
        with pytest.raises(CaptureFileError, match="points, field 0"):
            reader.check_points(2)
        with pytest.raises(CaptureFileError, match="points, field 9"):
            reader.check_points(2, 9)


def test_metadata_that_were_changed_are_not_relied_on(sealed):
    with CaptureReader(sealed) as reader:
        reader.check_unchanged()
    change(sealed, "UPDATE runs SET calibration = '{}' WHERE run = 1")
    with CaptureReader(sealed) as reader:
        reader.check_unchanged(runs=(2,))
        with pytest.raises(CaptureFileError, match="run 1"):
            reader.check_unchanged(runs=(1,))
    change(sealed, "UPDATE meta SET value = '49.0' WHERE key = 'rate_hz'")
    with CaptureReader(sealed) as reader, pytest.raises(CaptureFileError, match="its metadata"):
        reader.check_unchanged()


def test_what_a_crash_left_proves_itself_too(part):
    part.append([slot(11)])  # never committed
    part.close()
    assert verify(recover(part.path)) == (9, 8, 0, True, [])


def test_a_run_that_failed_leaves_no_digests(sealed):
    def failing():
        yield 0, points(0)
        raise RuntimeError("unplugged")

    with pytest.raises(RuntimeError):
        append_run(sealed, "measure", "", "", {}, failing())
    with closing(sqlite3.connect(sealed)) as connection:
        connection.execute("INSERT INTO meta VALUES ('digest.points.0000003.0000000000', '{\"0\": \"00\"}')")
        connection.execute("UPDATE points SET run = 3 WHERE run = 1 AND first_n = 0")
        connection.commit()
    append_run(sealed, "measure", "", "", MADE_WITH, [(1, points(1))])
    assert verify(sealed)[:4] == (9, 16, 0, True)
    with CaptureReader(sealed) as reader:
        assert [n for n, _ in reader.points(3)] == [1]


def test_a_capture_of_an_earlier_version_is_read_as_far_as_it_can_be(first_format):
    change(first_format, "DELETE FROM meta WHERE key GLOB 'digest*'")
    assert verify(first_format) == (9, 16, 0, False, [])
    change(first_format, "UPDATE fields SET data = x'00' WHERE n = 1")
    found = verify(first_format)
    assert found.fields == 8
    assert "field 1: damaged zlib data" in found.damages[0]
