"""One thread at a time has the turn, in the order in which they came; nobody keeps it for long."""

import threading
from concurrent.futures import ThreadPoolExecutor

from running import PATIENCE_S

from grabberd.server.api.readings import Turns


def test_one_at_a_time_has_it_and_all_come_to_it() -> None:
    turns, lock = Turns(held_s=3600), threading.Lock()
    steps: list[int] = []

    def work(number: int) -> None:
        turns.take()
        for _ in range(20):
            assert lock.acquire(blocking=False)
            steps.append(number)
            lock.release()
            turns.pass_on()
        turns.give()

    with ThreadPoolExecutor(4) as pool:
        list(pool.map(work, range(4)))
    assert sorted(steps) == sorted(list(range(4)) * 20)


def test_it_goes_to_who_waits_and_not_to_who_has_had_it() -> None:
    turns, order = Turns(held_s=3600), []
    turns.take()

    def other() -> None:
        turns.take()
        order.append("other")
        turns.give()

    thread = threading.Thread(target=other)
    thread.start()
    while not turns._waiting:
        pass
    turns.pass_on()
    order.append("first")
    turns.give()
    thread.join(PATIENCE_S)
    assert order == ["other", "first"]


def test_it_is_taken_from_who_does_not_hand_it_on() -> None:
    turns = Turns(held_s=0.01)
    stuck, taken = threading.Event(), threading.Event()

    def hang() -> None:
        turns.take()
        taken.set()
        stuck.wait(PATIENCE_S)
        turns.give()  # it is another's by now

    thread = threading.Thread(target=hang)
    thread.start()
    assert taken.wait(PATIENCE_S)
    turns.take()
    stuck.set()
    thread.join(PATIENCE_S)
    assert turns._owner == threading.get_ident()


def test_without_anybody_who_waits_handing_on_keeps_it() -> None:
    turns = Turns(held_s=3600)
    turns.take()
    turns.pass_on()
    assert turns._owner == threading.get_ident()
