"""Folders that results are written into."""

from pathlib import Path

from grabberd.errors import StorageError
from grabberd.storage.capture.schema import storage_errors


def new_folder(directory: Path) -> None:
    """Makes the folder; it may be there, with nothing in it.

    Raises:
        StorageError: it cannot be made, or has something in it.
    """
    with storage_errors(directory):
        directory.mkdir(parents=True, exist_ok=True)
        if any(directory.iterdir()):
            raise StorageError(
                f"the folder {directory} is not empty", "name a new one; nothing is overwritten"
            )
