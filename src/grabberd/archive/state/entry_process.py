"""Reads entries of the index in a process of its own, which is killed where a file holds it up."""

import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from time import monotonic
from typing import Any, NamedTuple

from grabberd.archive.path_process import answer_paths, ask
from grabberd.archive.state.index_entries import IndexEntry, damaged_entry, sealed_entry
from grabberd.errors import CaptureFileError, LaterVersion, ReadingGivenUp, StorageError
from grabberd.files.patience import Patience, within

LONGEST_S = 30.0
"""Time for one file, of which only some rows are read; a disk that has to spin up takes ten seconds."""
PROGRAM = f"from {__name__} import main; main()"


class Reading(NamedTuple):
    """Outcome of reading a file.

    Attributes:
        path: The file.
        entry: Its entry.
        is_damage: True if its content is to blame, and no later version, lock or disk.
    """

    path: Path
    entry: IndexEntry
    is_damage: bool = False


def read_entries(paths: Iterable[Path], longest_s: float = LONGEST_S) -> Iterator[Reading]:
    """Reads the entries of capture files, in order.

    Args:
        paths: The files.
        longest_s: Time for each of them.

    Raises:
        StorageError: No process can be started.
    """
    for path, answer in ask(PROGRAM, [str(longest_s)], paths, lambda _: longest_s):
        if answer is None:
            reason = f"reading it ends the reader, or takes longer than {longest_s:g} s"
            yield Reading(path, damaged_entry(path, reason))
        else:
            is_damage, *entry = answer
            yield Reading(path, IndexEntry(*entry), is_damage)


def _answer(path: Path, longest_s: float) -> list[Any]:
    try:
        # Half the time: a statement that is too long ends by itself, with a reason.
        with within(Patience(monotonic() + longest_s / 2)):
            return [False, *sealed_entry(path)]
    except (LaterVersion, ReadingGivenUp, StorageError) as error:  # the file itself may be sound
        return [False, *damaged_entry(path, error.message)]
    except CaptureFileError as error:
        return [True, *damaged_entry(path, error.message)]
    except Exception as error:
        return [False, *damaged_entry(path, f"{type(error).__name__}: {error}")]


def main() -> None:
    """Answers paths with their entries."""
    longest_s = float(sys.argv[1])
    answer_paths(lambda path: _answer(path, longest_s))
