"""What a killed capture leaves in somebody's folder is found, and sealed when they say so."""

import pytest

from archive.captures import meta, slots, write
from grabberd.archive.capture.crash_recovery import interrupted_captures, recording_folder, seal
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.writer import CaptureWriter
from grabberd.errors import CaptureFileError, StorageError


@pytest.fixture
def left(tmp_path):
    """As a kill leaves it: the folder and its lock file, which nobody holds."""
    folder = tmp_path / ".grabberd-abc"
    folder.mkdir()
    (folder / ".lock").touch()
    return unsealed(folder)


def unsealed(folder):
    part = folder / "liner.grab.part"
    writer = CaptureWriter.create(part, meta())
    writer.append(slots(5))
    writer.commit()
    writer.close()
    return part


def test_a_capture_that_ends_well_leaves_nothing(tmp_path):
    with recording_folder(tmp_path) as folder:
        assert folder.parent == tmp_path
    assert list(tmp_path.iterdir()) == []


def test_what_was_left_is_found_and_what_is_being_written_is_not(tmp_path, left):
    with recording_folder(tmp_path) as folder:
        part = unsealed(folder)
        assert interrupted_captures(tmp_path) == [left]
        with pytest.raises(StorageError, match="another grabberd"):
            seal(part)


def test_it_is_sealed_beside_its_folder_which_goes(tmp_path, left):
    path = seal(left)
    assert path == tmp_path / "liner.grab"
    assert [file.name for file in tmp_path.iterdir()] == ["liner.grab"]
    with CaptureReader(path) as reader:
        assert (reader.field_count, reader.meta.complete) == (5, False)


def test_one_anywhere_else_is_sealed_where_it_is(tmp_path):
    assert seal(unsealed(tmp_path)) == tmp_path / "liner.grab"
    assert [file.name for file in tmp_path.iterdir()] == ["liner.grab"]


def test_a_capture_of_that_name_is_not_overwritten(tmp_path, left):
    write(tmp_path, slots(2))
    with pytest.raises(StorageError, match="exists already"):
        seal(left)
    assert left.exists()


def test_one_that_cannot_be_read_is_kept_and_says_where(left):
    left.write_bytes(b"garbage " * 100)
    with pytest.raises(CaptureFileError, match="cannot be read") as caught:
        seal(left)
    kept = left.parent / "damaged" / left.name
    assert str(kept) in caught.value.hint
    assert kept.read_bytes() == b"garbage " * 100


@pytest.mark.parametrize("name", ["liner.grab", "nothing.grab.part"])
def test_what_is_no_cut_off_capture_is_refused(tmp_path, name):
    write(tmp_path, slots(2))
    with pytest.raises(CaptureFileError, match="not an interrupted capture"):
        seal(tmp_path / name)
