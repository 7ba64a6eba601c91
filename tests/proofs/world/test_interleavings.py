"""Interleavings of the objects that threads share: what each promises, and that a mistake would be found."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).parents[3]
NAMES = (
    *("ring", "backlog", "feed", "faults", "recent fields", "latency", "logger's board"),
    *("unsealed captures", "rejected calibrations", "cache"),
)


@pytest.fixture(scope="module")
def found():
    """What is printed of each object, in a process of its own, whose locks the model checker replaces."""
    environment = {**os.environ, "PYTHONPATH": f"{REPOSITORY}:{REPOSITORY / 'tests'}"}
    command = [sys.executable, "-m", "tests.proofs.world.interleavings"]
    done = subprocess.run(
        command, cwd=REPOSITORY, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return dict(line.split(": ", 1) for line in done.stdout.splitlines())


@pytest.mark.parametrize("name", NAMES)
def test_a_promise_is_kept_in_all_interleavings_and_a_mistake_is_found(found, name):
    pattern = r"promise kept in (\d+) interleavings, mistake found in number (\d+)"
    assert (counts := re.fullmatch(pattern, found[name])), found[name]
    assert int(counts[1]) > 1


def test_no_object_is_left_out(found):
    assert set(found) == set(NAMES)
