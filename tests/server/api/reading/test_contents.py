"""A process reads contents: it starts when it is needed, and the daemon outlives whatever happens to it."""

import asyncio
import errno
import os
import pickle
import signal
import time
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest
from starlette.types import Message

from grabberd.archive.capture_contents import LIMITS as OF_PROCESS
from grabberd.config import HttpLimits
from grabberd.errors import ReadingGivenUp
from grabberd.server.api.contents import WAITING_A_THREAD, Content, ContentReader, Contents
from grabberd.server.api.problems import Refusal
from grabberd.server.api.streams.downloads import Download
from grabberd.work.child import Limits
from grabberd.work.frames import Call, Frame, Question
from server.api.reading.things_to_read import about, breaking, chatty, counting, crash, deaf, echo, endless

LIMITS = HttpLimits(reads=2, read_timeout_s=60)
THINGS = f"{echo.__module__}:read"
pytestmark = pytest.mark.usefixtures("importable")


async def staying() -> Message:
    """A client that stays."""
    await asyncio.Event().wait()
    raise AssertionError


def leaving_when(file: Path) -> Callable[[], Awaitable[Message]]:
    async def left() -> Message:
        await there(file)
        return {"type": "http.disconnect"}

    return left


async def there(file: Path, size: int = 0) -> None:
    while not file.exists() or file.stat().st_size < size:
        await asyncio.sleep(0.01)


def run(work: Callable[[Contents], Awaitable[Any]], limits: HttpLimits = LIMITS, **options: Any) -> Any:
    async def all_of_it() -> Any:
        contents = Contents(limits, THINGS, **options)
        try:
            return await work(contents)
        finally:
            await contents.close()

    return asyncio.run(all_of_it())


async def body(contents: Contents, read: Callable[..., Any], *arguments: Any) -> bytes:
    return bytes((await contents.answer(Content(read, arguments), staying)).body)


async def pieces(contents: Contents, read: Callable[..., Any], *arguments: Any) -> Download:
    content = Content(read, arguments, media_type="text/csv", name="points.csv")
    answer = await contents.answer(content, staying)
    assert isinstance(answer, Download)
    return answer


def test_what_is_read_is_answered() -> None:
    assert run(lambda contents: body(contents, echo, "word")) == b"word"


def test_it_is_behind_the_daemon_and_killed_before_it() -> None:
    number, *rest = map(int, run(lambda contents: body(contents, about)).split())
    assert number != os.getpid()
    assert rest == [os.nice(0) + OF_PROCESS.niceness, OF_PROCESS.data_bytes, 1000]


def test_what_a_library_prints_is_no_answer() -> None:
    assert run(lambda contents: body(contents, chatty)) == b"and this is the answer"


def test_it_is_started_once_and_ends_when_nobody_has_asked_for_long() -> None:
    async def work(contents: Contents) -> None:
        first = await body(contents, about)
        assert await body(contents, about) == first
        number = int(first.split()[0])
        while Path(f"/proc/{number}").exists():
            await asyncio.sleep(0.01)
        assert (await body(contents, about)).split()[0] != first.split()[0]

    run(work, idle_s=1.0)


def test_one_that_crashes_costs_its_own_reading_and_the_next_starts_another() -> None:
    async def work(contents: Contents) -> bytes:
        with pytest.raises(ReadingGivenUp, match="ended while"):
            await body(contents, crash)
        assert contents.count == 0
        return await body(contents, echo, "again")

    assert run(work) == b"again"


def test_a_client_that_leaves_ends_its_reading(tmp_path: Path) -> None:
    begun = tmp_path / "begun"

    async def work(contents: Contents) -> None:
        number = await body(contents, about)
        with pytest.raises(ReadingGivenUp):
            await contents.answer(Content(endless, (begun,)), leaving_when(begun))
        while contents.count:
            await asyncio.sleep(0.01)
        assert await body(contents, about) == number  # it was not killed for that

    run(work)


def test_a_reading_ends_with_its_time(tmp_path: Path) -> None:
    with pytest.raises(ReadingGivenUp, match="too long"):
        run(lambda contents: body(contents, endless, tmp_path / "begun"), HttpLimits(read_timeout_s=3))


def test_one_that_does_not_let_go_is_killed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("grabberd.server.api.contents.GRACE_S", 0.5)
    begun = tmp_path / "begun"

    async def work(contents: Contents) -> None:
        number = int((await body(contents, about)).split()[0])
        with pytest.raises(ReadingGivenUp):
            await contents.answer(Content(deaf, (begun,)), leaving_when(begun))
        while Path(f"/proc/{number}").exists():
            await asyncio.sleep(0.01)
        assert await body(contents, echo, "next") == b"next"

    run(work)


def test_one_that_never_answers_is_killed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("grabberd.server.api.contents.GRACE_S", 0.5)
    with pytest.raises(ReadingGivenUp):
        run(lambda contents: body(contents, deaf, tmp_path / "begun"), HttpLimits(read_timeout_s=3))


def test_no_more_wait_than_there_is_room_for(tmp_path: Path) -> None:
    begun = tmp_path / "begun"
    room = LIMITS.reads * (1 + WAITING_A_THREAD)

    async def work(contents: Contents) -> None:
        reads = [asyncio.create_task(body(contents, endless, begun)) for _ in range(room)]
        while contents.count < room:
            await asyncio.sleep(0.01)
        with pytest.raises(Refusal) as refused:
            await body(contents, echo, "too much")
        assert refused.value.status_code == 503
        for read in reads:
            read.cancel()
        await asyncio.gather(*reads, return_exceptions=True)
        while contents.count:
            await asyncio.sleep(0.01)
        assert await body(contents, echo, "room again") == b"room again"

    run(work)


def test_a_download_comes_piece_by_piece(tmp_path: Path) -> None:
    closed = tmp_path / "closed"

    async def work(contents: Contents) -> None:
        answer = await pieces(contents, counting, closed)
        assert answer.headers["content-disposition"] == 'attachment; filename="points.csv"'
        found = [piece async for piece in answer.pieces(answer.source)]
        assert [piece[:2] for piece in found] == [f"{number}".encode() * 2 for number in range(10)] + [
            f"{number}".encode() for number in range(10, 100)
        ]
        answer.source.close()

    run(work)


def test_a_client_that_leaves_a_download_closes_its_source(tmp_path: Path) -> None:
    closed = tmp_path / "closed"

    async def work(contents: Contents) -> None:
        answer = await pieces(contents, counting, closed)
        async for _ in answer.pieces(answer.source):
            break
        assert not closed.exists()
        answer.source.close()
        await there(closed)

    run(work)


def test_an_error_breaks_a_download_off() -> None:
    async def work(contents: Contents) -> None:
        answer = await pieces(contents, breaking)
        with pytest.raises(ReadingGivenUp, match="it broke"):
            async for _ in answer.pieces(answer.source):
                pass

    run(work)


def test_a_client_that_leaves_while_it_waits_for_a_thread_costs_nobody_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("grabberd.server.api.contents.GRACE_S", 0.5)
    begun = tmp_path / "begun"

    async def work(contents: Contents) -> None:
        reads = [asyncio.create_task(body(contents, endless, begun)) for _ in range(LIMITS.reads)]
        await there(begun, LIMITS.reads)
        with pytest.raises(ReadingGivenUp):
            await contents.answer(Content(echo, ("late",)), leaving_when(begun))
        await asyncio.sleep(1.0)  # twice the grace
        assert not any(read.done() for read in reads)
        assert contents.count == LIMITS.reads

    run(work)


def test_signals_to_the_daemon_and_its_children_end_no_reading() -> None:
    async def work(contents: Contents) -> None:
        about_it = await body(contents, about)
        for one in (signal.SIGINT, signal.SIGTERM):
            os.kill(int(about_it.split()[0]), one)
        assert await body(contents, about) == about_it

    run(work)


def test_it_ends_when_whoever_asks_is_gone_even_if_a_reading_hangs(tmp_path: Path) -> None:
    async def work() -> None:
        reader = await ContentReader.start(Limits(threads=2))
        until_s = time.monotonic() + 60
        number = int((await reader.ask(read_frame(reader, "about"), until_s)).content.split()[0])
        hangs = asyncio.create_task(reader.ask(read_frame(reader, "deaf", tmp_path / "begun"), until_s))
        await there(tmp_path / "begun")
        assert reader._questions is not None
        reader._questions.abort()  # as the end of the daemon does
        with pytest.raises(ReadingGivenUp):
            await hangs
        while Path(f"/proc/{number}").exists():
            await asyncio.sleep(0.01)

    asyncio.run(work())


def read_frame(reader: ContentReader, name: str, *arguments: Any) -> Frame:
    call = Call(THINGS, (name, *arguments), time.monotonic() + 60)
    return Frame(reader.new_number(), Question.CALL, pickle.dumps(call))


def test_without_room_for_a_process_clients_are_told_to_try_again(monkeypatch: pytest.MonkeyPatch) -> None:
    def no_room(*_: object, **__: object) -> None:
        raise BlockingIOError(errno.EAGAIN, "Resource temporarily unavailable")

    monkeypatch.setattr("grabberd.work.process.subprocess.Popen", no_room)
    with pytest.raises(Refusal, match="cannot be started") as refused:
        run(lambda contents: body(contents, echo, "word"))
    assert (refused.value.status_code, refused.value.name) == (503, "too-many-processes")


def test_after_closing_no_process_is_started() -> None:
    async def work(contents: Contents) -> None:
        await contents.close()
        with pytest.raises(ReadingGivenUp):
            await body(contents, echo, "word")

    run(work)


def test_closing_gives_up_what_is_read(tmp_path: Path) -> None:
    begun = tmp_path / "begun"

    async def work(contents: Contents) -> None:
        read = asyncio.create_task(body(contents, endless, begun))
        await there(begun)
        await contents.close()
        with pytest.raises(ReadingGivenUp):
            await read

    run(work)
