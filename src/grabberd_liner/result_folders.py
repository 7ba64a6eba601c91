"""Results on disk: a folder each, written under another name and renamed, so whole or not there at all."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from grabberd.files.disk import clear_scratch, scratch_folder


class ResultFolders:
    """A folder of results; any thread and process may read, one at a time may add."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory

    def open(self) -> None:
        """Creates the folder, and removes what a crash left unfinished.

        Raises:
            StorageError: It cannot be written.
        """
        clear_scratch(self.directory)

    @contextmanager
    def scratch(self) -> Iterator[Path]:
        """A folder to write a result into, removed afterwards unless it was published.

        What a killed program left of another one is removed first.

        Raises:
            StorageError: It cannot be made.
        """
        clear_scratch(self.directory)
        with scratch_folder(self.directory) as scratch:
            yield scratch
