"""Work for many processes: each task once, whatever becomes of the processes."""

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, ProcessPoolExecutor, ThreadPoolExecutor
from functools import partial
from itertools import count
from pathlib import Path

import pytest

from grabberd_reprocess.workers import TaskPool

POISON = -1


def squared(number: int) -> int:
    return number * number


def failing(number: int) -> int:
    if number == 3:
        raise ValueError("three")
    return number


def deadly(number: int) -> int:
    if number == POISON:
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def dies_once(folder: Path, number: int) -> int:
    if number == 5 and not (folder / "died").exists():
        (folder / "died").touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def threads() -> Executor:
    return ThreadPoolExecutor(2)


def processes() -> Executor:
    return ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("spawn"))


@pytest.fixture
def pool() -> Iterator[Callable[..., TaskPool[int, int]]]:
    made: list[TaskPool[int, int]] = []

    def make(function: Callable[[int], int], start: Callable[[], Executor]) -> TaskPool[int, int]:
        made.append(TaskPool(function, start, 4))
        return made[-1]

    yield make
    for one in made:
        one.close()


def test_every_task_comes_back_once_with_its_result(pool: Callable[..., TaskPool[int, int]]) -> None:
    results = list(pool(squared, threads).results(range(50)))
    assert sorted(results) == [(number, number * number) for number in range(50)]


def test_no_tasks_start_no_process(pool: Callable[..., TaskPool[int, int]]) -> None:
    def start() -> Executor:
        raise AssertionError

    assert list(pool(squared, start).results([])) == []


def test_tasks_are_taken_as_there_is_room_and_not_before(pool: Callable[..., TaskPool[int, int]]) -> None:
    taken = count()
    tasks = (next(taken) for _ in range(100))
    results = pool(squared, threads).results(tasks)
    next(results)
    assert next(taken) <= 4 + 1


def test_an_error_is_one_tasks_result(pool: Callable[..., TaskPool[int, int]]) -> None:
    results = dict(pool(failing, threads).results(range(6)))
    assert isinstance(results.pop(3), ValueError)
    assert results == {number: number for number in (0, 1, 2, 4, 5)}


@pytest.mark.slow
def test_what_a_killed_process_had_is_done_by_another(
    pool: Callable[..., TaskPool[int, int]], tmp_path: Path
) -> None:
    results = list(pool(partial(dies_once, tmp_path), processes).results(range(12)))
    assert (tmp_path / "died").exists()
    assert sorted(results) == [(number, number) for number in range(12)]


@pytest.mark.slow
def test_only_the_task_that_ends_every_process_is_given_up(pool: Callable[..., TaskPool[int, int]]) -> None:
    tasks = [1, 2, POISON, 3, 4, 5, 6]
    results = dict(pool(deadly, processes).results(tasks))
    assert isinstance(results.pop(POISON), BrokenExecutor)
    assert results == {number: number for number in range(1, 7)}
