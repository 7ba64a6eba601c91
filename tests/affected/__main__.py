"""Run the tests that the changes of this branch reach, nearest first.

python -m tests.affected [--base COMMIT] [--seconds SECONDS]
"""

import argparse
import os
import subprocess
import sys
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

from tests.affected.changes import changed_files
from tests.affected.durations import recorded
from tests.affected.imports import Imports
from tests.affected.selection import Selection, select

ROOT = Path(__file__).parents[2]
SECONDS = 20.0
"""For the tests themselves; reading the imports and starting the workers takes some seconds more."""
ALONE = 3
"""Up to this many test files, one process is done before several have started."""


def main() -> int:
    """Selects, says what it leaves out, runs; the status is pytest's."""
    asked = _arguments()
    changes = changed_files(ROOT, asked.base)
    processors = len(os.sched_getaffinity(0))
    selection = select(changes, Imports(ROOT), recorded(ROOT), asked.seconds * processors)
    print(f"{len(changes)} changed files reach {_count(selection)} test files", flush=True)
    changed = _pytest(selection.changed) if selection.changed else 0
    near = _pytest(selection.near, "-m", "not slow") if selection.near else 0
    _tell_what_is_left_out(selection)
    return changed or near


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="make test-affected", description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--base", help="commit to compare with; default: where the branch left main")
    parser.add_argument(
        "--seconds", type=float, default=SECONDS, help="time for the tests (default: %(default)s)"
    )
    return parser.parse_args()


def _count(selection: Selection) -> int:
    return len(selection.changed) + len(selection.near) + len(selection.left_out)


def _pytest(files: Iterable[Path], *options: str) -> int:
    names = [path.as_posix() for path in files]
    if len(names) > ALONE:
        options = (*options, "--numprocesses", "auto", "--dist", "loadfile")
    status = subprocess.run(
        [sys.executable, "-m", "pytest", *options, *names], cwd=ROOT, check=False
    ).returncode
    return 0 if status == _NOTHING_COLLECTED else status


_NOTHING_COLLECTED = 5


def _tell_what_is_left_out(selection: Selection) -> None:
    print("Left out: tests marked slow, in files that have not changed themselves.")
    rooms = Counter(path.parent.as_posix() for path in selection.left_out)
    if rooms:
        print(f"Left out: {len(selection.left_out)} test files farther away, for lack of time:")
        print("  " + ", ".join(f"{room} ({count})" for room, count in sorted(rooms.items())))
    if selection.unknown:
        print("No test is known for:", *selection.unknown)
    if selection.whole or selection.unknown or rooms:
        print("Run `make test` before you hand this on." + _WHOLE * selection.whole)


_WHOLE = " The change concerns every test."

if __name__ == "__main__":
    sys.exit(main())
