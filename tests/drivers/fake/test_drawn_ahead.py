"""Pictures that another process draws are those that this one would draw."""

import gc
import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from grabberd.errors import StreamFailed
from grabberd_fake import FakeGrabber, FakeOptions, World, read_stamp
from grabberd_fake.optics import COLUMNS
from grabberd_fake.render import ROWS
from grabberd_fake.stream import SLOTS, ComesFirst, DrawnAhead

PATIENCE_S = 30.0
OPTIONS = FakeOptions.read({"scene": "ellipse", "seed": 5})


@pytest.fixture(scope="module")
def ahead() -> DrawnAhead:
    return DrawnAhead(OPTIONS)


@pytest.fixture(scope="module")
def world() -> World:
    return World(OPTIONS)


def luma() -> np.ndarray:
    return np.zeros((ROWS, COLUMNS), np.uint8)


def process_of(ahead: DrawnAhead) -> int:
    """Its number."""
    _, _, arguments, _ = ahead._end.peek()  # type: ignore[misc]
    return int(arguments[0].pid)


def take(grabber: FakeGrabber, count: int) -> None:
    for _ in range(count):
        with grabber.dequeue(PATIENCE_S):
            pass


def gone(process: int) -> bool:
    end_s = time.monotonic() + PATIENCE_S
    while Path(f"/proc/{process}").exists() and time.monotonic() < end_s:
        time.sleep(0.01)
    return not Path(f"/proc/{process}").exists()


@pytest.mark.parametrize(
    "fields",
    [
        range(100, 110),
        (200, 200, 201, 201),
        (300, 350, 1000, 1001),
        (2000, 2000 + SLOTS, 2000 + 2 * SLOTS),
        (3000, 3010, 3002, 3003 + SLOTS, 3002 + SLOTS, 3004),
    ],
    ids=["one after the other", "shown again", "some skipped", "all but skipped", "back and forth"],
)
def test_each_is_the_picture_of_its_field(ahead: DrawnAhead, world: World, fields: Iterator[int]) -> None:
    for field in fields:
        here, there = luma(), luma()
        world.picture(field, here)
        ahead.picture(field, there)
        np.testing.assert_array_equal(here, there)


def test_those_that_follow_are_drawn_before_they_are_asked_for(ahead: DrawnAhead) -> None:
    out, first = luma(), 5000
    ahead.picture(first, out)
    slots, end_s = ahead._slots, time.monotonic() + PATIENCE_S
    last = first + SLOTS - 1
    while (stamp := read_stamp(slots[last % SLOTS])) is None or stamp.number != last:
        assert time.monotonic() < end_s
        time.sleep(0.01)
    waited_ns = ahead.waited_ns
    for field in range(first, last + 1):
        ahead.picture(field, out)
    # They are there; to learn of each takes a message.
    assert ahead.waited_ns - waited_ns < SLOTS * 1e9 / 50


def test_the_process_ends_with_whoever_asks() -> None:
    ahead = DrawnAhead(OPTIONS)
    process = process_of(ahead)
    del ahead
    gc.collect()
    assert gone(process)


def test_it_outlives_a_signal_to_the_whole_group_since_a_capture_may_still_go_on(ahead: DrawnAhead) -> None:
    for number in (signal.SIGINT, signal.SIGTERM):
        os.kill(process_of(ahead), number)
    for field in range(7000, 7000 + 2 * SLOTS):
        ahead.picture(field, luma())


def test_a_process_that_was_killed_fails_the_stream_and_the_next_start_has_another() -> None:
    grabber = FakeGrabber(scene="ellipse")
    grabber.open()
    with grabber.dequeue(5.0) as fields:
        assert fields
    assert isinstance(grabber._pictures, DrawnAhead)
    os.kill(process_of(grabber._pictures), signal.SIGKILL)
    with pytest.raises(StreamFailed, match="has ended") as failed:
        take(grabber, 2 * SLOTS)
    assert "started again" in failed.value.hint
    grabber.restart()
    with grabber.dequeue(5.0) as fields:
        stamp = read_stamp(fields[0].field.luma)
        assert stamp
        assert stamp.number == fields[0].time_ns // 20_000_000


class Processor:
    """A processor of which a share is taken, and what the process has asked it for."""

    def __init__(self, permitted: bool = True) -> None:
        self.now_ns = self.ran_ns = 0
        self.asked: list[int] = []
        self._permitted = permitted

    def schedule(self, _pid: int, policy: int, _param: object) -> None:
        if not self._permitted:
            raise PermissionError(1, "Operation not permitted")
        self.asked.append(policy)

    def first(self) -> ComesFirst:
        return ComesFirst(lambda: self.now_ns, lambda: self.ran_ns, self.schedule)

    def pass_s(self, seconds: float, share: float) -> None:
        self.now_ns += round(seconds * 1e9)
        self.ran_ns += round(seconds * 1e9 * share)


def test_it_comes_before_other_programs_as_long_as_it_takes_its_share() -> None:
    processor = Processor()
    first = processor.first()
    for _ in range(10):
        processor.pass_s(6.0, 0.3)
        first.keep_to_share()
    assert first.first
    assert processor.asked == [os.SCHED_RR]


def test_on_a_slow_processor_it_runs_like_others_again() -> None:
    processor = Processor()
    first = processor.first()
    processor.pass_s(6.0, 0.8)
    first.keep_to_share()
    assert not first.first
    assert processor.asked == [os.SCHED_RR, os.SCHED_OTHER]


def test_a_burst_at_the_start_is_no_reason() -> None:
    processor = Processor()
    first = processor.first()
    processor.pass_s(0.3, 1.0)
    first.keep_to_share()
    processor.pass_s(5.0, 0.2)
    first.keep_to_share()
    assert first.first


def test_without_the_right_to_it_it_runs_like_others() -> None:
    processor = Processor(permitted=False)
    first = processor.first()
    processor.pass_s(6.0, 0.8)
    first.keep_to_share()
    assert not first.first
