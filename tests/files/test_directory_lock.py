"""Two programs never share a folder of captures."""

from pathlib import Path

import pytest

from grabberd.errors import StorageError
from grabberd.files.disk import DirectoryLock


def test_a_folder_is_one_programs_until_it_is_given_back(tmp_path: Path) -> None:
    one, other = DirectoryLock(tmp_path / "captures"), DirectoryLock(tmp_path / "captures")
    one.acquire()
    with pytest.raises(StorageError, match="another grabberd uses"):
        other.acquire()
    one.release()
    other.acquire()
    other.release()


def test_taking_and_giving_back_twice_does_no_harm(tmp_path: Path) -> None:
    lock = DirectoryLock(tmp_path)
    lock.acquire()
    lock.acquire()
    lock.release()
    lock.release()


def test_a_folder_that_cannot_be_made_is_a_storage_error(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(StorageError):
        DirectoryLock(tmp_path / "file" / "captures").acquire()
