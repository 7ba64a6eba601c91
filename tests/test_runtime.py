"""The seam between the daemon and its computer: plain in use, replaced by a test that simulates."""

import queue
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime

import pytest

from grabberd import runtime
from grabberd.runtime import SystemClock


def test_in_use_the_factories_give_the_standard_librarys_own_objects():
    """Behind the seam a lock costs what a lock costs."""
    assert type(runtime.lock()) is type(threading.Lock())
    assert type(runtime.rlock()) is type(threading.RLock())
    assert type(runtime.condition()) is threading.Condition
    assert type(runtime.event()) is threading.Event
    assert type(runtime.simple_queue()) is queue.SimpleQueue


def test_a_condition_may_share_a_lock():
    lock = runtime.lock()
    with runtime.condition(lock):
        assert not lock.acquire(blocking=False)


def test_a_thread_runs_and_ends():
    ran = threading.Event()
    thread = runtime.Thread(target=ran.set, daemon=True)
    assert not thread.is_alive()
    thread.start()
    thread.join()
    assert ran.is_set()
    assert not thread.is_alive()


def test_a_timer_calls_once_its_time_has_come():
    called = threading.Event()
    runtime.Timer(0.0, called.set).start()
    assert called.wait(60.0)


def test_a_cancelled_timer_does_not_call():
    called = threading.Event()
    timer = runtime.Timer(1e6, called.set)
    timer.start()
    timer.cancel()
    timer.join(60.0)
    assert not timer.is_alive()
    assert not called.is_set()


class Standing(runtime.Runtime):
    """Its clocks stand, and its threads run at once."""

    def monotonic_ns(self) -> int:  # type: ignore[override]
        return 5

    def utc_now(self) -> datetime:
        return datetime(2026, 1, 1, tzinfo=UTC)

    def start(self, thread: threading.Thread) -> None:  # type: ignore[override]
        thread.run()


@contextmanager
def standing() -> Iterator[None]:
    with runtime.installed(Standing()):
        yield


def test_another_runtime_is_installed_for_a_while():
    clock, ran = SystemClock(), []
    with standing():
        assert (clock.now_ns(), clock.utc_now()) == (5, datetime(2026, 1, 1, tzinfo=UTC))
        runtime.Thread(target=lambda: ran.append(1)).start()
    assert ran == [1]
    assert clock.now_ns() != 5


def test_it_is_gone_when_a_test_fails():
    with pytest.raises(ZeroDivisionError), standing():
        _ = 1 / 0
    assert runtime.monotonic_ns() != 5
