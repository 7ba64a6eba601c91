"""The memory of answers is bounded: who finds no room waits, and is then told to come again."""

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

import pytest
from starlette.responses import Response

from grabberd.server.api.answers import AnswerMemory, HeldAnswer, held
from grabberd.server.api.problems import Refusal

LARGE = 200_000


def run(work: Callable[[], Awaitable[Any]]) -> Any:
    return asyncio.run(work())  # type: ignore[arg-type]


async def nothing() -> dict[str, Any]:
    return {"type": "http.disconnect"}


def test_who_finds_no_room_is_refused_with_a_time_to_come_again() -> None:
    async def work() -> None:
        memory = AnswerMemory(100, wait_s=0.01)
        await memory.hold(60)
        with pytest.raises(Refusal) as refused:
            await memory.hold(60)
        assert (refused.value.status_code, refused.value.name) == (503, "too-many-answers")
        assert dict(refused.value.headers or {})["Retry-After"] == "5"
        assert "ask for less" in refused.value.hint
        assert memory.count == 60

    run(work)


def test_who_waits_is_let_in_when_somebody_has_finished() -> None:
    async def work() -> None:
        memory = AnswerMemory(100, wait_s=60)
        first = await memory.hold(60)
        second = asyncio.create_task(memory.hold(60))
        await asyncio.sleep(0)
        assert not second.done()
        first.release()
        first.release()
        (await second).release()
        assert memory.count == 0

    run(work)


def test_what_is_small_passes_what_is_large() -> None:
    async def work() -> None:
        memory = AnswerMemory(100, wait_s=60)
        await memory.hold(60)
        large = asyncio.create_task(memory.hold(60))
        await asyncio.sleep(0)
        await memory.hold(30)
        assert not large.done()
        large.cancel()
        await asyncio.wait([large])
        assert memory.count == 90

    run(work)


def test_who_gives_up_as_room_is_made_gives_back_what_it_never_had() -> None:
    async def work() -> None:
        memory = AnswerMemory(100, wait_s=60)
        first = await memory.hold(60)
        second = asyncio.create_task(memory.hold(60))
        await asyncio.sleep(0)
        second.cancel()
        first.release()
        await asyncio.wait([second])
        assert memory.count == 0

    run(work)


def test_an_answer_larger_than_all_of_it_is_made_alone() -> None:
    async def work() -> None:
        memory = AnswerMemory(100, wait_s=60)
        assert (await memory.hold(1000)) is not None
        assert memory.count == 100

    run(work)


def test_a_whole_answer_holds_its_memory_until_the_client_has_it() -> None:
    async def work() -> None:
        memory = AnswerMemory(10 * LARGE)
        answer = held(Response(bytes(LARGE), media_type="text/csv"), await memory.hold(10))
        counts, sent = [], []

        async def send(message: dict[str, Any]) -> None:
            counts.append(memory.count)
            sent.append(message)

        await answer({"type": "http"}, nothing, send)  # type: ignore[arg-type]
        assert set(counts) == {LARGE}
        assert memory.count == 0
        assert sent[0]["status"] == 200
        assert b"".join(one["body"] for one in sent[1:]) == bytes(LARGE)
        assert [one["more_body"] for one in sent[1:]] == [True] * (len(sent) - 2) + [False]
        assert len(sent) > 3

    run(work)


def test_a_short_answer_holds_nothing_any_more() -> None:
    async def work() -> None:
        memory = AnswerMemory(100)
        answer = held(Response(b"short"), await memory.hold(100))
        assert not isinstance(answer, HeldAnswer)
        assert memory.count == 0

    run(work)


def test_an_answer_that_became_too_large_is_not_sent() -> None:
    async def work() -> None:
        memory = AnswerMemory(LARGE)
        await memory.hold(LARGE // 2)
        hold = await memory.hold(10)
        with pytest.raises(Refusal):
            held(Response(bytes(LARGE)), hold)
        hold.release()
        assert memory.count == LARGE // 2

    run(work)


def test_an_answer_that_is_never_sent_gives_its_memory_back() -> None:
    async def work() -> None:
        memory = AnswerMemory(10 * LARGE)
        held(Response(bytes(LARGE)), await memory.hold(10))
        assert memory.count == 0

    run(work)
