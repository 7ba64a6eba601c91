"""Runs tasks on many processes: a bounded number at a time, each exactly once.

A process that is killed breaks the whole executor and takes the tasks of the others with it. Those are tried
again one by one, so that the task that ends every process is found, and no other is blamed for it.
"""

from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from itertools import islice
from typing import Any, Generic, TypeVar

T = TypeVar("T")
R = TypeVar("R")
Tick = Callable[[Iterable[Any]], None]

TICK_S = 1.0


class TaskPool(Generic[T, R]):
    """Runs a function on the processes of an executor.

    Args:
        function: A function at module level; it and the tasks must be picklable.
        start: Creates an executor; called again after one broke.
        max_pending: Maximum number of tasks submitted and not yet done.
        tick: Called about once a second with the pending tasks.
    """

    def __init__(
        self,
        function: Callable[[T], R],
        start: Callable[[], Executor],
        max_pending: int,
        tick: Tick = lambda _: None,
    ) -> None:
        self._function = function
        self._start = start
        self._max_pending = max_pending
        self._tick = tick
        self._executor: Executor | None = None
        self._pending: dict[Future[R], T] = {}

    def close(self) -> None:
        """Cancels the tasks that wait, and waits for those that run."""
        for future in self._pending:
            future.cancel()
        self._pending.clear()
        if self._executor is not None:
            self._executor.shutdown(wait=True)
            self._executor = None

    def results(self, tasks: Iterable[T]) -> Iterator[tuple[T, R | BaseException]]:
        """Yields each task once as it ends, with its result or the error that ended it."""
        queue = iter(tasks)
        more = True
        while more:
            broken: list[T] = []
            more = yield from self._until_it_breaks(queue, broken)
            for task in broken:
                yield task, self._alone(task)

    def _until_it_breaks(
        self, queue: Iterator[T], broken: list[T]
    ) -> Generator[tuple[T, R | BaseException], None, bool]:
        """Returns False when all tasks are done; puts those that a break interrupted into `broken`."""
        pending = self._pending
        while not broken:
            for task in islice(queue, self._max_pending - len(pending)):
                self._submit(task, broken)
            if not pending:
                return bool(broken)
            for future in wait(pending, TICK_S, FIRST_COMPLETED).done:
                yield from self._ended(future, pending.pop(future), broken)
            self._tick(pending.values())
        for future, task in pending.items():
            yield from self._ended(future, task, broken)
        self.close()
        return True

    def _submit(self, task: T, broken: list[T]) -> None:
        self._executor = self._executor or self._start()
        try:
            self._pending[self._executor.submit(self._function, task)] = task
        except BrokenExecutor:
            broken.append(task)

    @staticmethod
    def _ended(future: Future[R], task: T, broken: list[T]) -> Iterator[tuple[T, R | BaseException]]:
        result = _result(future)
        if isinstance(result, BrokenExecutor):
            broken.append(task)
        else:
            yield task, result

    def _alone(self, task: T) -> R | BaseException:
        self._executor = self._executor or self._start()
        result = _result(self._executor.submit(self._function, task))
        if isinstance(result, BrokenExecutor):
            self.close()
        return result


def _result(future: Future[R]) -> R | BaseException:
    try:
        return future.result()
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # a cancelled future's too
        return error
