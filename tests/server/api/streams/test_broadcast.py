"""One maker, many listeners, nobody waits for anybody."""

import asyncio
from collections.abc import Callable, Coroutine, Iterator
from itertools import count
from typing import Any

import pytest

from grabberd.server.api.streams.broadcast import Broadcast

PATIENCE_S = 20.0


def counting(every_s: float = 0.0) -> Broadcast[int]:
    numbers = count(1)
    return Broadcast(lambda: next(numbers), every_s)


def run(work: Callable[[], Coroutine[Any, Any, None]]) -> None:
    asyncio.run(work())


def test_nothing_is_made_while_nobody_listens() -> None:
    async def work() -> None:
        made: list[int] = []
        broadcast: Broadcast[int] = Broadcast(lambda: made.append(1) or len(made), 0.0)
        with broadcast.listening() as listener:
            await listener.next(PATIENCE_S)
        before = len(made)
        for _ in range(20):
            await asyncio.sleep(0)
        assert before >= 1
        assert len(made) <= before + 1  # one may have been on its way

    run(work)


def test_two_listeners_get_the_same() -> None:
    async def work() -> None:
        broadcast = counting(every_s=0.01)
        with broadcast.listening() as one, broadcast.listening() as other:
            assert await one.next(PATIENCE_S) == await other.next(PATIENCE_S)

    run(work)


def test_who_is_late_gets_the_newest_and_has_missed_the_rest() -> None:
    async def work() -> None:
        broadcast = counting()
        with broadcast.listening() as quick, broadcast.listening() as slow:
            newest = 0
            for _ in range(10):
                newest = await quick.next(PATIENCE_S) or 0
            assert (await slow.next(PATIENCE_S) or 0) >= newest >= 10

    run(work)


def test_who_comes_later_has_the_newest_at_once() -> None:
    async def work() -> None:
        broadcast = counting(every_s=PATIENCE_S)
        with broadcast.listening() as first:
            assert await first.next(PATIENCE_S) == 1
            with broadcast.listening() as second:
                assert await second.next(0.0) == 1

    run(work)


def test_what_was_made_for_the_listeners_of_before_is_not_shown() -> None:
    async def work() -> None:
        broadcast = counting(every_s=PATIENCE_S)
        for expected in (1, 2):
            with broadcast.listening() as listener:
                assert await listener.next(PATIENCE_S) == expected

    run(work)


def test_no_news_in_time_is_none() -> None:
    async def work() -> None:
        broadcast: Broadcast[int] = Broadcast(lambda: None, 0.001)
        with broadcast.listening() as listener:
            assert await listener.next(0.01) is None

    run(work)


def test_closing_ends_everybody_at_once() -> None:
    async def work() -> None:
        broadcast: Broadcast[int] = Broadcast(lambda: None, 0.001)
        with broadcast.listening() as listener:
            waiting = asyncio.create_task(listener.next(PATIENCE_S))
            await asyncio.sleep(0)
            broadcast.close()
            assert await waiting is None

    run(work)


def test_a_failure_is_logged_once_and_does_not_end_it(caplog: pytest.LogCaptureFixture) -> None:
    def fails_twice() -> Iterator[int]:
        yield 0
        yield 0
        yield 7

    numbers = fails_twice()

    async def work() -> None:
        broadcast: Broadcast[float] = Broadcast(lambda: 7 / next(numbers), 0.0)
        with broadcast.listening() as listener:
            assert await listener.next(PATIENCE_S) == 1.0
            broadcast.close()

    run(work)
    assert [record.message for record in caplog.records if "at this moment" in record.message] == [
        "live data cannot be made at this moment"
    ]
