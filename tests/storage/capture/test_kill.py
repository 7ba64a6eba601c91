"""A capture whose process is killed at a random instant: at most the last second is gone, and it says so."""

import random
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from grabberd.storage import CaptureReader, recover
from storage.captures import points

CHILD = Path(__file__).with_name("writing_child.py")
ROUNDS, AT_ONCE = 5, 4
LAST_SECOND = 50


def start(part, count):
    command = [sys.executable, str(CHILD), str(part), str(count)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, text=True)


def kill_after(child, lines):
    """Kills it once it has said that it appended so many fields; returns the last it said."""
    said = ""
    for _ in range(lines):
        said = child.stdout.readline() or said
    child.send_signal(signal.SIGKILL)
    rest, _ = child.communicate(timeout=120)
    return int((said + rest).split()[-1])


@pytest.mark.parametrize("seed", range(ROUNDS))
def test_a_killed_capture_loses_at_most_its_last_second(tmp_path, seed):
    instants = random.Random(seed)
    parts = [tmp_path / f"c{i}.grab.part" for i in range(AT_ONCE)]
    children = [start(part, 100_000) for part in parts]
    # Every other one dies when it is about to commit.
    lines = [25 * instants.randint(1, 15) if i % 2 else instants.randint(1, 380) for i in range(AT_ONCE)]
    with ThreadPoolExecutor(AT_ONCE) as threads:
        appended = list(threads.map(kill_after, children, lines))
    for part, last in zip(parts, appended, strict=True):
        check(part, last)


def check(part, last):
    with CaptureReader(part) as reader:
        before = reader.field_count
    with CaptureReader(recover(part)) as reader:
        kept = [field.n for field in reader.received()]
        measured = list(reader.points(1))
        assert kept == list(range(len(kept)))
        assert len(kept) == before
        assert last + 1 - len(kept) <= LAST_SECOND
        assert reader.meta.complete is False
        assert reader.ledger.received == len(kept)
        assert "lost" in reader.ledger.in_words(50.0)
    assert [n for n, _ in measured] == kept
    for n, one in measured[-3:]:
        assert one.xyz_mm.tobytes() == points(n).xyz_mm.tobytes()


def test_a_capture_that_is_left_to_its_end_is_complete(tmp_path):
    child = start(tmp_path / "c.grab.part", 400)
    assert child.communicate(timeout=120)[0].split()[-1] == "399"
    assert child.returncode == 0
    with CaptureReader(tmp_path / "c.grab") as reader:
        assert reader.meta.complete
        assert reader.field_count == 400


@pytest.mark.parametrize("seed", range(3))
def test_a_capture_killed_while_it_is_sealed_is_there_under_one_name_or_the_other(tmp_path, seed):
    part = tmp_path / "c.grab.part"
    child = start(part, 400)
    for _ in range(400):
        child.stdout.readline()
    try:
        child.wait(random.Random(seed).uniform(0.0, 0.02))
    except subprocess.TimeoutExpired:
        child.kill()
    child.communicate(timeout=120)
    path = recover(part) if part.exists() else tmp_path / "c.grab"
    with CaptureReader(path) as reader:
        assert 400 - reader.field_count <= LAST_SECOND
        assert reader.meta.complete == (reader.field_count == 400 and reader.ledger.complete)
