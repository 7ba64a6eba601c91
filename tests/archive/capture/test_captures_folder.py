"""The folder of captures is told from any other that takes its place, and nothing is written into that."""

import shutil

import pytest

from grabberd.archive.capture.captures_folder import ANY, CapturesFolder, id_of
from grabberd.errors import Cause, StorageError


class Memory:
    """What the state database remembers."""

    def __init__(self, known=None):
        self.known = known

    def remembered(self):
        if isinstance(self.known, Exception):
            raise self.known
        return self.known

    def remember(self, known):
        self.known = known


@pytest.fixture
def memory():
    return Memory()


@pytest.fixture
def folder(tmp_path, memory):
    taken = CapturesFolder(tmp_path / "captures", memory.remembered, memory.remember)
    yield taken
    taken.release()


def cause_of(folder):
    with pytest.raises(StorageError) as refused:
        folder.take()
    return refused.value.cause


def test_at_the_first_start_it_is_made_and_gets_an_id_that_is_remembered(folder, memory):
    assert folder.take()
    assert folder.in_place
    assert memory.known
    assert memory.known == id_of(folder.path)


def test_one_of_an_earlier_version_gets_an_id(folder, memory):
    folder.path.mkdir()
    (folder.path / ".lock").touch()
    folder.take()
    assert id_of(folder.path) == memory.known


def test_it_is_taken_once(folder):
    assert folder.take()
    assert not folder.take()


def test_another_program_cannot_take_it_meanwhile(folder, memory):
    folder.take()
    other = CapturesFolder(folder.path, memory.remembered, memory.remember)
    assert cause_of(other) is None
    assert not other.in_place


def test_one_that_was_renamed_is_missing_until_it_is_back_and_not_made_again(folder):
    folder.take()
    away = folder.path.rename(folder.path.with_name("away"))
    assert not folder.in_place
    assert cause_of(folder) is Cause.CAPTURES_MISSING
    assert not folder.path.exists()
    away.rename(folder.path)
    assert folder.in_place
    assert not folder.take()


def test_an_empty_mount_point_in_its_place_stays_empty(folder):
    folder.take()
    folder.path.rename(folder.path.with_name("away"))
    folder.path.mkdir()
    assert cause_of(folder) is Cause.CAPTURES_MISSING
    assert list(folder.path.iterdir()) == []


def test_another_folder_in_its_place_is_left_as_it_is(folder, tmp_path):
    folder.take()
    folder.path.rename(folder.path.with_name("away"))
    folder.path.mkdir()
    (folder.path / "holiday.jpg").write_bytes(b"beach")
    assert cause_of(folder) is Cause.CAPTURES_REPLACED
    assert [path.name for path in folder.path.iterdir()] == ["holiday.jpg"]
    stranger = CapturesFolder(tmp_path / "strange")
    stranger.take()
    stranger.release()
    shutil.rmtree(folder.path)
    stranger.path.rename(folder.path)
    assert cause_of(folder) is Cause.CAPTURES_REPLACED


def test_the_same_folder_on_a_disk_that_was_mounted_again_is_taken_anew(folder):
    folder.take()
    shutil.copytree(folder.path, folder.path.with_name("again"))  # the same content, another inode
    shutil.rmtree(folder.path)
    folder.path.with_name("again").rename(folder.path)
    assert not folder.in_place
    assert folder.take()
    assert folder.in_place


def test_after_a_restart_the_remembered_folder_is_expected(folder, memory):
    folder.take()
    folder.release()
    shutil.rmtree(folder.path)
    assert cause_of(CapturesFolder(folder.path, memory.remembered, memory.remember)) is Cause.CAPTURES_MISSING
    assert not folder.path.exists()


@pytest.mark.parametrize("known", [None, StorageError("state.sqlite cannot be used", "fix it")])
def test_what_was_held_is_expected_even_if_the_state_has_forgotten_it(folder, memory, known):
    folder.take()
    memory.known = known
    folder.path.rename(folder.path.with_name("away"))
    assert cause_of(folder) is Cause.CAPTURES_MISSING


def test_a_state_that_has_forgotten_the_folder_is_told_again(folder, memory):
    folder.take()
    known, memory.known = memory.known, None
    folder.identify()
    assert memory.known == known


@pytest.mark.parametrize("there", [False, True])
def test_what_a_person_has_accepted_is_taken_whatever_it_is(folder, memory, there):
    folder.take()
    first = memory.known
    folder.path.rename(folder.path.with_name("away"))
    if there:
        folder.path.mkdir()
    memory.known = ANY
    assert folder.take()
    assert memory.known == id_of(folder.path) != first
