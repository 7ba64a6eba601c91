"""Work for many processes: orders go out as there is room for them, what became of each comes back.

A process that is killed takes others' work with it: those orders are tried again, one alone, so that the one
that ends every process it gets into is found, and no other is blamed for it.
"""

from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from itertools import islice
from typing import Any, Generic, TypeVar

O = TypeVar("O")  # noqa: E741 - an order
R = TypeVar("R")
Tick = Callable[[Iterable[Any]], None]

TICK_S = 1.0


class FanOut(Generic[O, R]):
    """A function and the processes that carry it out.

    Args:
        function: at module level; it and the orders can be pickled.
        start: makes an executor, anew where one broke.
        at_once: so many orders are under way at most, waiting ones included.
        tick: is told once a second which orders are under way.
    """

    def __init__(
        self,
        function: Callable[[O], R],
        start: Callable[[], Executor],
        at_once: int,
        tick: Tick = lambda _: None,
    ) -> None:
        self._function = function
        self._start = start
        self._at_once = at_once
        self._tick = tick
        self._executor: Executor | None = None
        self._under_way: dict[Future[R], O] = {}

    def close(self) -> None:
        """Takes back what waits, and waits for what is under way."""
        for future in self._under_way:
            future.cancel()
        self._under_way.clear()
        if self._executor is not None:
            self._executor.shutdown(wait=True)
            self._executor = None

    def results(self, orders: Iterable[O]) -> Iterator[tuple[O, R | BaseException]]:
        """Each order once, with its result or the error that ended it, in the order of their ends."""
        queue = iter(orders)
        more = True
        while more:
            broken: list[O] = []
            more = yield from self._until_it_breaks(queue, broken)
            for order in broken:
                yield order, self._alone(order)

    def _until_it_breaks(
        self, queue: Iterator[O], broken: list[O]
    ) -> Generator[tuple[O, R | BaseException], None, bool]:
        """Whether there may be more; those that were under way at a break are put into `broken`."""
        under_way = self._under_way
        while not broken:
            for order in islice(queue, self._at_once - len(under_way)):
                self._submit(order, broken)
            if not under_way:
                return bool(broken)
            for future in wait(under_way, TICK_S, FIRST_COMPLETED).done:
                yield from self._ended(future, under_way.pop(future), broken)
            self._tick(under_way.values())
        for future, order in under_way.items():
            yield from self._ended(future, order, broken)
        self.close()
        return True

    def _submit(self, order: O, broken: list[O]) -> None:
        self._executor = self._executor or self._start()
        try:
            self._under_way[self._executor.submit(self._function, order)] = order
        except BrokenExecutor:
            broken.append(order)

    @staticmethod
    def _ended(future: Future[R], order: O, broken: list[O]) -> Iterator[tuple[O, R | BaseException]]:
        result = _result(future)
        if isinstance(result, BrokenExecutor):
            broken.append(order)
        else:
            yield order, result

    def _alone(self, order: O) -> R | BaseException:
        self._executor = self._executor or self._start()
        result = _result(self._executor.submit(self._function, order))
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
