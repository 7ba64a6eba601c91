"""Latencies: the newest ones, and all of them in classes."""

import threading
from collections.abc import Iterator
from contextlib import closing

import numpy as np
import pytest
from running import PATIENCE_S

from grabberd.instrument.device.worker import BOUNDS_S, FairLock, Latency


def test_every_latency_is_in_one_class() -> None:
    latency = Latency()
    for milliseconds in (0.5, 1.0, 3.0, 3.0, 5000.0):
        latency.add(round(milliseconds * 1e6))
    histogram = latency.histogram
    assert dict(zip((*BOUNDS_S, np.inf), histogram.counts, strict=True)) == {
        **dict.fromkeys(BOUNDS_S, 0), 0.001: 2, 0.005: 2, np.inf: 1
    }  # fmt: skip
    assert histogram.sum_s == pytest.approx(5.0075)


def test_there_are_no_percentiles_of_nothing() -> None:
    assert Latency().percentiles_ms() is None


def test_percentiles_are_of_the_newest() -> None:
    latency = Latency()
    for milliseconds in (900, 1, 2, 3):
        latency.add(milliseconds * 1_000_000)
    assert latency.percentiles_ms(3) == pytest.approx({"p50": 2.0, "p99": 2.98, "max": 3.0})


def test_every_field_comes_in_order() -> None:
    assert list(FairLock().one_by_one(iter(range(5)))) == list(range(5))


def test_two_never_have_their_turn_at_the_same_time() -> None:
    lock, together = FairLock(), []
    inside = threading.Lock()

    def work() -> None:
        for _ in lock.one_by_one(iter(range(500))):
            alone = inside.acquire(blocking=False)
            together.append(not alone)
            if alone:
                inside.release()

    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(PATIENCE_S)
    assert together == [False] * 2000


def test_who_waits_for_a_field_has_no_turn() -> None:
    lock, came = FairLock(), threading.Event()

    def never() -> Iterator[int]:
        yield 0
        came.wait(PATIENCE_S)

    waiting = lock.one_by_one(never())
    next(waiting)
    thread = threading.Thread(target=lambda: next(waiting, None))
    thread.start()
    assert list(lock.one_by_one(iter(range(100)))) == list(range(100))
    assert not lock._lock.locked()
    came.set()
    thread.join(PATIENCE_S)


def test_one_that_takes_long_holds_up_no_other_for_long() -> None:
    lock = FairLock()
    with closing(lock.one_by_one(iter(range(2)))) as slow:
        next(slow)
        assert list(lock.one_by_one(iter(range(3)))) == [0, 1, 2]
        assert lock._lock.locked()
    assert not lock._lock.locked()


def test_one_that_fails_leaves_its_turn() -> None:
    lock = FairLock()

    def fail() -> None:
        with closing(lock.one_by_one(iter(range(2)))) as fields:
            next(fields)
            raise ValueError("bad field")

    with pytest.raises(ValueError, match="bad field"):
        fail()
    assert not lock._lock.locked()
