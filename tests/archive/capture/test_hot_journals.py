"""What a crash left unfinished is rolled back by whoever knows of the crash, and not by a mere reader."""

import shutil

import pytest

from archive.captures import MADE_WITH, META, meta, points, slots, write
from grabberd.archive.capture.crash_recovery import recover
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.runs import append_run
from grabberd.archive.capture.schema import DAMAGED, connect
from grabberd.archive.capture.verification import verify
from grabberd.archive.capture.writer import CaptureWriter
from grabberd.archive.guarded_database import JOURNAL
from grabberd.archive.state.index_entries import read_entries
from grabberd.errors import StorageError


def crashed(path, folder):
    """A copy of a file and its journal, as a crash leaves them."""
    folder.mkdir()
    for one in (path, journal_of(path)):
        shutil.copy(one, folder)
    return folder / path.name


def journal_of(path):
    return path.with_name(path.name + JOURNAL)


@pytest.fixture
def part(tmp_path):
    """A capture of thirty fields that was killed while sixty more were being written into its file."""
    writer = CaptureWriter.create(tmp_path / "liner.grab.part", meta(bits=8))
    writer.append(slots(30, bits=8))
    writer.commit()
    writer._connection.execute("PRAGMA cache_size = 1")  # writes into the file before the commit
    writer.append(slots(90, bits=8)[30:])
    left = crashed(writer.path, tmp_path / "left")
    writer.close()
    return left


@pytest.fixture
def sealed(tmp_path):
    """A sealed capture whose program was killed in the middle of changing it."""
    path = write(tmp_path, slots(30, bits=8))
    connection = connect(path, writable=True)
    connection.execute("PRAGMA cache_size = 1")
    connection.execute("BEGIN IMMEDIATE")
    connection.execute("DELETE FROM fields")
    left = crashed(path, tmp_path / "left")
    connection.close()
    return left


def test_a_reader_leaves_an_unfinished_capture_as_it_is_and_says_what_to_do(part):
    before = part.read_bytes(), journal_of(part).read_bytes()
    with pytest.raises(StorageError, match="unfinished") as caught:
        CaptureReader(part)
    assert "grabberd storage seal" in caught.value.hint
    assert (part.read_bytes(), journal_of(part).read_bytes()) == before


def test_it_is_not_called_damaged_content_in_the_index(part):
    (reading,) = read_entries([part])
    assert not reading.is_damage
    assert "unfinished" in reading.entry.reason
    assert part.exists()
    assert not (part.parent / DAMAGED).exists()


def test_sealing_it_rolls_back(part):
    path = recover(part)
    assert not journal_of(part).exists()
    with CaptureReader(path) as reader:
        assert [field.numbered.n for field in reader.fields()] == list(range(30))
    assert verify(path).damages == []


def test_a_reader_of_an_unfinished_capture_without_anything_to_roll_back_reads_it(tmp_path):
    writer = CaptureWriter.create(tmp_path / "liner.grab.part", meta())
    writer.append(slots(10))
    writer.commit()
    with CaptureReader(crashed(writer.path, tmp_path / "left")) as reader:
        assert reader.field_count == 10
    writer.close()


def test_a_sealed_capture_is_rolled_back_by_its_first_reader(sealed):
    with CaptureReader(sealed) as reader:
        assert reader.field_count == 30
    assert verify(sealed).damages == []


def test_it_takes_further_runs_and_is_listed(sealed):
    (reading,) = read_entries([sealed])
    assert (reading.is_damage, reading.entry.state) == (False, "sealed")
    assert append_run(sealed, "measure", META.created_utc, "0.1.0", MADE_WITH, [(0, points(0))]) == 1
