"""Questions answered by a process of their own."""

import os
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from grabberd.errors import InputError, StorageError
from grabberd.work.own_process import LONGEST_S, OwnProcesses

HERE = "from grabberd.work.own_process import answer_with; "
ECHO = HERE + "import os; answer_with(lambda question: [question, os.getpid()])"
DIES_ONCE = HERE + "import os; answer_with(lambda question: os._exit(3) if question == 'die' else question)"


def test_it_stays_for_the_next_question(processes: OwnProcesses) -> None:
    first, second = processes.ask(ECHO, {"a": 1}, "echoes"), processes.ask(ECHO, "ø", "echoes")
    assert [first[0], second[0]] == [{"a": 1}, "ø"]
    assert first[1] == second[1] != os.getpid()


def test_what_it_refuses_is_refused_here(processes: OwnProcesses) -> None:
    program = (
        "from grabberd.errors import InputError\n"
        "from grabberd.work.own_process import answer_with\n"
        "def refuse(question):\n"
        "    raise InputError('no', 'ask otherwise')\n"
        "answer_with(refuse)\n"
    )
    with pytest.raises(InputError, match="no") as refused:
        processes.ask(program, {}, "refuses")
    assert refused.value.hint == "ask otherwise"


def test_one_that_has_ended_meanwhile_is_started_again(processes: OwnProcesses) -> None:
    with pytest.raises(StorageError, match="that dies does not answer"):
        processes.ask(DIES_ONCE, "die", "dies")
    assert processes.ask(DIES_ONCE, "go on", "dies") == "go on"


def test_one_that_waited_too_long_ends_by_itself_and_nobody_notices(processes: OwnProcesses) -> None:
    hasty = "from grabberd.work import own_process; own_process.IDLE_S = 0.05; " + ECHO
    first = processes.ask(hasty, 1, "echoes")
    process = processes._processes[hasty]._running
    assert process is not None
    process.wait(30)
    assert processes.ask(hasty, 2, "echoes")[1] != first[1]


def test_a_program_that_cannot_run_is_said_to_give_no_answer(processes: OwnProcesses) -> None:
    with pytest.raises(StorageError, match="does not answer"):
        processes.ask("raise SystemExit(3)", {}, "fails")


def test_none_is_left_when_the_daemon_stops(processes: OwnProcesses) -> None:
    processes.ask(ECHO, 1, "echoes")
    running = processes._processes[ECHO]._running
    assert running is not None
    processes.end()
    assert running.poll() is not None


def test_the_daemon_does_not_wait_for_an_answer_when_it_stops(
    processes: OwnProcesses, tmp_path: Path
) -> None:
    asked = tmp_path / "asked"
    ponder = f"lambda _: [pathlib.Path({str(asked)!r}).touch(), time.sleep(600)]"
    ponders = f"{HERE}import pathlib, time; answer_with({ponder})"
    with ThreadPoolExecutor(1) as pool:
        answer = pool.submit(processes.ask, ponders, 1, "ponders")
        while not asked.exists():
            assert not answer.done()
        processes.end()
        with pytest.raises(StorageError, match="ponders does not answer"):
            answer.result(LONGEST_S / 2)
