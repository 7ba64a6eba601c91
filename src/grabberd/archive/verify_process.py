"""Verifies capture files in a process of its own, behind everybody else on this computer."""

import os
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from grabberd.archive.capture.verification import Verification, verify
from grabberd.archive.path_process import answer_paths, ask
from grabberd.errors import GrabberdError

PROGRAM = f"from {__name__} import main; main()"
_LONGEST_S, _BYTES_A_SECOND = 600.0, 1_000_000
"""Time for a file beside that for its size, at a tenth of what a slow disk reads: others go first."""
_NICEST = 19


def verify_files(paths: Iterable[Path]) -> Iterator[tuple[Path, Verification]]:
    """Findings of capture files, in order; one that cannot be read is damaged.

    Raises:
        StorageError: No process can be started.
    """
    for path, answer in ask(PROGRAM, [], paths, _longest_s):
        if answer is None:
            reason = f"reading it ends the reader, or takes longer than {_longest_s(path):.0f} s"
            yield path, Verification(0, 0, 0, has_digests=False, damages=[reason])
        else:
            yield path, Verification(*answer)


def _longest_s(path: Path) -> float:
    size = path.lstat().st_size if path.exists() else 0
    return _LONGEST_S + size / _BYTES_A_SECOND


def _answer(path: Path) -> tuple[Any, ...]:
    try:
        return verify(path)
    except GrabberdError as error:
        return Verification(0, 0, 0, has_digests=False, damages=[error.message])
    except Exception as error:
        return Verification(0, 0, 0, has_digests=False, damages=[f"{type(error).__name__}: {error}"])


def main() -> None:
    """Answers paths with what is found in their files."""
    os.nice(_NICEST)
    # It also puts reading behind everybody else's, where the disk's scheduler knows of priorities.
    os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))
    answer_paths(_answer)
