"""A capture whose process is killed at a random instant: at most the last second is gone, and it says so."""

import multiprocessing
import random
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress

import pytest

from archive.capture.writing_child import READINGS_A_FIELD, write_fields
from archive.captures import points
from grabberd.archive.capture.crash_recovery import recover
from grabberd.archive.capture.reader import CaptureReader

ROUNDS, AT_ONCE = 5, 4
LAST_SECOND = 50
PATIENCE_S = 120
# Forked from a process that has imported what they need: importing would cost more than the writing.
FORKING = multiprocessing.get_context("forkserver")
FORKING.set_forkserver_preload(["__main__", write_fields.__module__])


class Child:
    """A process that writes a capture, and tells the number of each field that it has appended."""

    def __init__(self, part, count):
        self._told, tell = FORKING.Pipe(duplex=False)
        self.process = FORKING.Process(target=write_fields, args=(part, count, tell), daemon=True)
        self.process.start()
        tell.close()

    def last_of(self, fields):
        """The number told last, of so many or of all that are still to come."""
        last = -1
        with suppress(EOFError):
            for _ in range(fields):
                assert self._told.poll(PATIENCE_S)
                last = self._told.recv()
        return last

    def end(self):
        self.process.join(PATIENCE_S)
        return self.process.exitcode


EVER = 10**9


def kill_after(child, fields):
    """Kills it once it has told that it appended so many fields; returns the last it told."""
    last = child.last_of(fields)
    child.process.kill()
    child.end()
    return max(last, child.last_of(EVER))


@pytest.mark.parametrize("seed", range(ROUNDS))
def test_a_killed_capture_loses_at_most_its_last_second(tmp_path, seed):
    instants = random.Random(seed)
    parts = [tmp_path / f"c{i}.grab.part" for i in range(AT_ONCE)]
    children = [Child(part, 100_000) for part in parts]
    # Every other one dies when it is about to commit.
    fields = [25 * instants.randint(1, 15) if i % 2 else instants.randint(1, 380) for i in range(AT_ONCE)]
    with ThreadPoolExecutor(AT_ONCE) as threads:
        appended = list(threads.map(kill_after, children, fields))
    for part, last in zip(parts, appended, strict=True):
        check(part, last)


def check(part, last):
    with CaptureReader(recover(part)) as reader:
        kept = [field.n for field in reader.received()]
        measured = list(reader.points(1))
        assert kept == list(range(len(kept)))
        assert last + 1 - len(kept) <= LAST_SECOND
        assert reader.meta.complete is False
        assert reader.ledger.received == len(kept)
        assert "lost" in reader.ledger.in_words(50.0)
        assert len(reader.channels.read("pulsation").value) == len(kept) * READINGS_A_FIELD
        assert reader.channels.account.channels[0].readings == len(kept) * READINGS_A_FIELD
    assert [n for n, _ in measured] == kept
    for n, one in measured[-3:]:
        assert one.xyz_mm.tobytes() == points(n).xyz_mm.tobytes()


def test_a_capture_that_is_left_to_its_end_is_complete(tmp_path):
    child = Child(tmp_path / "c.grab.part", 400)
    assert child.last_of(EVER) == 399
    assert child.end() == 0
    with CaptureReader(tmp_path / "c.grab") as reader:
        assert reader.meta.complete
        assert reader.field_count == 400


@pytest.mark.parametrize("seed", range(3))
def test_a_capture_killed_while_it_is_sealed_is_there_under_one_name_or_the_other(tmp_path, seed):
    part = tmp_path / "c.grab.part"
    child = Child(part, 400)
    child.last_of(400)
    child.process.join(random.Random(seed).uniform(0.0, 0.02))
    child.process.kill()
    child.end()
    path = recover(part) if part.exists() else tmp_path / "c.grab"
    with CaptureReader(path) as reader:
        assert 400 - reader.field_count <= LAST_SECOND
        assert reader.meta.complete == (reader.field_count == 400 and reader.ledger.complete)
