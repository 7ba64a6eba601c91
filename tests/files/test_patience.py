"""Patience: over when its time has passed or when it is given up, and carried by the context of a call."""

from concurrent.futures import ThreadPoolExecutor
from contextvars import copy_context

import pytest

from grabberd.errors import ReadingGivenUp
from grabberd.files.reading import CURRENT, Patience, check_patience, within


class Time:
    """A clock that stands until it is set."""

    def __init__(self) -> None:
        self.s = 100.0

    def __call__(self) -> float:
        return self.s


def test_is_over_from_its_end_on() -> None:
    now_s = Time()
    patience = Patience(110.0, now_s)
    now_s.s = 109.9
    before = patience.is_over
    now_s.s = 110.0
    assert (before, patience.is_over) == (False, True)


def test_without_an_end_only_giving_up_ends_it() -> None:
    now_s = Time()
    patience = Patience(None, now_s)
    now_s.s = 1e9
    assert not patience.is_over
    patience.give_up()
    assert patience.is_over


def test_giving_up_twice_from_another_thread_ends_it_before_its_time() -> None:
    patience = Patience(110.0, Time())
    with ThreadPoolExecutor(1) as other:
        other.submit(patience.give_up).result()
        other.submit(patience.give_up).result()
    assert patience.is_over


def test_nothing_is_in_force_unless_somebody_says_so() -> None:
    assert CURRENT.get() is None


def test_is_in_force_within_the_block_alone() -> None:
    outer, inner = Patience(None), Patience(None)
    with within(outer):
        with within(inner) as entered:
            assert CURRENT.get() is entered is inner
        assert CURRENT.get() is outer
    assert CURRENT.get() is None


def test_the_one_before_is_in_force_again_after_an_error() -> None:
    with pytest.raises(ValueError, match="broken"), within(Patience(None)):
        raise ValueError("broken")
    assert CURRENT.get() is None


def test_a_part_is_over_with_the_whole_and_may_be_before_it() -> None:
    whole = Patience(None)
    part = Patience(None, outer=whole)
    short = Patience(None, outer=whole)
    short.give_up()
    assert (short.is_over, part.is_over, whole.is_over) == (True, False, False)
    whole.give_up()
    assert part.is_over


def test_a_check_ends_what_nobody_waits_for_and_lets_others_go_on_before() -> None:
    steps: list[str] = []
    patience = Patience(None, between=lambda: steps.append("others"))
    check_patience()
    with within(Patience(None, outer=patience)):
        check_patience("liner.grab")
        patience.give_up()
        with pytest.raises(ReadingGivenUp, match=r"reading liner\.grab took too long"):
            check_patience("liner.grab")
    assert steps == ["others", "others"]


def test_travels_to_a_thread_with_the_context() -> None:
    with ThreadPoolExecutor(1) as other, within(Patience(None)) as patience:
        assert other.submit(copy_context().run, CURRENT.get).result() is patience
        assert other.submit(CURRENT.get).result() is None
