"""The backlog between recorder and writer: what it keeps, refuses and forgets."""

import threading
from collections.abc import Callable

import pytest

from grabberd.instrument.acquisition import Backlog

PATIENCE_S = 30.0


def filled(count: int, capacity: int = 4) -> Backlog[int]:
    backlog: Backlog[int] = Backlog(capacity)
    for item in range(count):
        assert backlog.append(item)
    return backlog


def test_items_come_out_in_the_order_they_went_in() -> None:
    backlog = filled(3)
    assert backlog.from_index(0, 0) == [0, 1, 2]
    assert backlog.from_index(2, 0) == [2]
    assert [backlog.at(index, 0) for index in range(3)] == [0, 1, 2]


def test_an_item_is_refused_while_the_writer_is_a_whole_capacity_behind() -> None:
    backlog = filled(4)
    assert backlog.room == 0
    assert not backlog.append(4)
    backlog.written(1)
    assert backlog.append(4)
    assert backlog.deepest == 4


def test_what_is_written_stays_until_there_is_more_than_the_capacity() -> None:
    backlog = filled(4)
    backlog.written(4)
    assert backlog.at(0, 0) == 0
    for item in (4, 5):
        backlog.append(item)
    backlog.written(2)
    assert backlog.oldest() == (2, 2)
    with pytest.raises(LookupError):
        backlog.at(1, 0)
    assert backlog.at(5, 0) == 5


def test_what_nobody_will_ask_for_any_more_is_dropped() -> None:
    backlog = filled(4)
    backlog.drop()
    assert (backlog.end, backlog.from_index(4, 0)) == (4, [])
    with pytest.raises(LookupError):
        backlog.at(3, 0)


def test_what_is_not_written_is_never_forgotten() -> None:
    backlog = filled(4)
    backlog.written(1)
    backlog.append(4)
    assert backlog.from_index(1, 0) == [1, 2, 3, 4]


def test_nothing_comes_after_the_end() -> None:
    backlog = filled(2)
    assert backlog.at(2, 0) is None
    backlog.close()
    assert backlog.closed
    assert backlog.at(2, timeout_s=60) is None, "a closed backlog does not keep anybody waiting"
    assert backlog.from_index(2, timeout_s=60) == []
    assert backlog.end == 2


def test_an_empty_backlog_has_no_oldest() -> None:
    with pytest.raises(LookupError):
        filled(0).oldest()


class NotedCondition(threading.Condition):
    """A condition that tells when somebody waits on it."""

    def __init__(self) -> None:
        super().__init__()
        self.waited_for = threading.Event()

    def wait(self, timeout: float | None = None) -> bool:
        self.waited_for.set()
        return super().wait(timeout)


@pytest.mark.parametrize(
    ("wait", "found"),
    [(lambda one: one.at(2, 10 * PATIENCE_S), 2), (lambda one: one.from_index(2, 10 * PATIENCE_S), [2])],
)
@pytest.mark.parametrize("ends", [False, True])
def test_whoever_waits_is_woken_by_the_next_item_and_by_the_end(
    wait: Callable[[Backlog[int]], object], found: object, ends: bool
) -> None:
    backlog, results = filled(2), list[object]()
    backlog._changed = condition = NotedCondition()
    thread = threading.Thread(target=lambda: results.append(wait(backlog)), daemon=True)
    thread.start()
    assert condition.waited_for.wait(PATIENCE_S)
    if ends:
        backlog.close()
    else:
        backlog.append(2)
    thread.join(PATIENCE_S)
    nothing = [] if isinstance(found, list) else None
    assert results == [nothing if ends else found]
