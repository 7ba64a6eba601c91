"""A capture file at a moment when nobody writes it."""

import os
from contextlib import closing, suppress
from pathlib import Path

from grabberd.errors import CaptureFileError
from grabberd.storage.capture.schema import connect, reading_errors


def stat_at_rest(path: Path) -> os.stat_result:
    """Size and time of a file between two commits; while it has them, what is read of it belongs together.

    A file that cannot be read as a capture is written by nobody: it is taken as it is.

    Raises:
        StorageError: somebody writes it for longer than ten seconds.
    """
    with suppress(CaptureFileError), closing(connect(path)) as connection, reading_errors(path):
        connection.execute("BEGIN")
        connection.execute("SELECT count(*) FROM meta").fetchone()  # from here on nobody commits
        return path.stat()
    return path.stat()
