"""A process that runs functions for this one, whatever these do to it."""

import os
import signal
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from grabberd.errors import InputError, ReadingGivenUp, StorageError
from grabberd.files.reading import Patience, within
from grabberd.work.child import Limits
from grabberd.work.process import LONGEST_S, NoAnswer, Process, Processes, ask_each

HERE = __name__
pytestmark = pytest.mark.usefixtures("importable")


def echo(question: Any) -> Any:
    return [question, os.getpid()]


def die(question: Any) -> Any:
    return os._exit(3) if question == "die" else question


def refuse(question: Any) -> Any:
    raise InputError("no", "ask otherwise")


def break_down() -> None:
    raise ZeroDivisionError("by nothing")


def halfway(progress: Callable[[float], None]) -> bytes:
    progress(0.25)
    progress(0.5)
    return b"\0done"


def ponder(asked: str) -> None:
    Path(asked).touch()
    time.sleep(600)


def count(to: int) -> Iterator[bytes]:
    for number in range(to):
        yield bytes([number]) * 40_000


def stop_short() -> Iterator[bytes]:
    yield bytes(100_000)
    os._exit(1)


def name_of(path: Path, word: str) -> str:
    if path.name == "fatal":
        signal.raise_signal(signal.SIGSEGV)
    if path.name == "slow":
        time.sleep(600)
    return f"{word} {path.name}"


@pytest.fixture
def process() -> Iterator[Process]:
    with closing(Process(Limits())) as one:
        yield one


def test_a_function_answers_with_any_value_or_bytes(process: Process) -> None:
    assert process.call(f"{HERE}:echo", {"a": [1, None]}) == [{"a": [1, None]}, process.pid]
    assert process.call("os:urandom", 0) == b""


def test_the_share_that_is_done_is_reported_before_the_answer(process: Process) -> None:
    shares: list[float] = []
    assert process.call(f"{HERE}:halfway", progress=shares.append) == b"\0done"
    assert shares == [0.25, 0.5]


def test_what_is_long_comes_in_pieces(process: Process) -> None:
    pieces = list(process.stream(f"{HERE}:count", 5))
    assert b"".join(pieces) == b"".join(count(5))
    assert len(pieces) == 3, "two of 40 kB make one that is worth asking for"


def test_a_stream_that_stops_short_does_not_pass_for_whole(process: Process) -> None:
    with pytest.raises(NoAnswer):
        list(process.stream(f"{HERE}:stop_short"))


def test_a_fault_of_the_function_is_one_here(process: Process) -> None:
    with pytest.raises(RuntimeError, match="ZeroDivisionError: by nothing"):
        process.call(f"{HERE}:break_down")
    assert process.call(f"{HERE}:echo", 1)[0] == 1


def test_a_process_that_cannot_send_its_answer_ends(process: Process) -> None:
    with pytest.raises(NoAnswer):
        process.call("os:closerange", 3, 256)


def test_whoever_waits_gives_up_in_time(process: Process, tmp_path: Path) -> None:
    with pytest.raises(NoAnswer):
        process.call(f"{HERE}:ponder", str(tmp_path / "asked"), longest_s=0.1)


def test_a_patience_that_is_over_ends_the_waiting(process: Process, tmp_path: Path) -> None:
    with within(Patience(time.monotonic() + 0.1)), pytest.raises(ReadingGivenUp):
        process.call(f"{HERE}:ponder", str(tmp_path / "asked"))


def test_each_file_has_its_own_answer_whatever_the_others_do(tmp_path: Path) -> None:
    paths = [tmp_path / name for name in ("one", "fatal", "slow", "two")]
    found = dict(
        ask_each(Limits(), f"{HERE}:name_of", paths, lambda path: 1.0 + 59 * (path.name != "slow"), "a")
    )
    assert found == dict(zip(paths, ["a one", None, None, "a two"], strict=True))


def test_one_stays_for_the_next_question(processes: Processes) -> None:
    first, second = (processes.ask(f"{HERE}:echo", one, "echoes") for one in ({"a": 1}, "ø"))
    assert [first[0], second[0]] == [{"a": 1}, "ø"]
    assert first[1] == second[1] != os.getpid()


def test_what_it_refuses_is_refused_here(processes: Processes) -> None:
    with pytest.raises(InputError, match="no") as refused:
        processes.ask(f"{HERE}:refuse", {}, "refuses")
    assert refused.value.hint == "ask otherwise"


def test_one_that_has_ended_meanwhile_is_started_again(processes: Processes) -> None:
    with pytest.raises(StorageError, match="that dies does not answer"):
        processes.ask(f"{HERE}:die", "die", "dies")
    assert processes.ask(f"{HERE}:die", "go on", "dies") == "go on"


def test_one_that_waited_too_long_ends_by_itself_and_nobody_notices() -> None:
    with closing(_Ending(idle_s=0.05)) as hasty:
        first = hasty.ask(f"{HERE}:echo", 1, "echoes")
        process = hasty._kept[f"{HERE}:echo"].process
        assert process is not None
        process._process.wait(30)
        assert hasty.ask(f"{HERE}:echo", 2, "echoes")[1] != first[1]


class _Ending(Processes):
    close = Processes.end


def test_none_is_left_when_the_daemon_stops(processes: Processes) -> None:
    number = processes.ask(f"{HERE}:echo", 1, "echoes")[1]
    processes.end()
    assert not Path(f"/proc/{number}").exists()


def test_the_daemon_does_not_wait_for_an_answer_when_it_stops(processes: Processes, tmp_path: Path) -> None:
    asked = tmp_path / "asked"
    with ThreadPoolExecutor(1) as pool:
        answer = pool.submit(processes.ask, f"{HERE}:ponder", str(asked), "ponders")
        while not asked.exists():
            assert not answer.done()
        processes.end()
        with pytest.raises(StorageError, match="ponders does not answer"):
            answer.result(LONGEST_S / 2)
