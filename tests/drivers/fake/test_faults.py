"""The script of what goes wrong."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from grabberd_fake.faults import (
    KINDS,
    STEPS,
    Damage,
    Fail,
    Lose,
    LoseSilently,
    NoSignal,
    Recoverable,
    Repeat,
    Script,
    Stall,
    Unplug,
    Wrap,
)


@pytest.mark.parametrize(
    ("fault", "first", "fields"),
    [
        (Lose(at_field=7, count=3), 7, 3),
        (Lose(at_s=1.0), 50, 1),
        (Repeat(at_s=0.03, count=2), 2, 2),
        (Stall(at_s=0.0, duration_s=0.5), 0, 25),
        (Stall(at_s=0.7, duration_s=0.03), 35, 2),
        (Unplug(at_s=2, back_after_s=1.5), 100, 75),
        (NoSignal(at_field=3, duration_s=0.06), 3, 3),
    ],
)
def test_a_fault_holds_for_a_window_of_fields(fault: Lose, first: int, fields: int) -> None:
    assert (fault.first, fault.fields) == (first, fields)
    assert [fault.holds(n) for n in (first - 1, first, first + fields - 1, first + fields)] == [
        False,
        True,
        True,
        False,
    ]


def test_a_script_says_what_holds_for_a_field() -> None:
    damage, second = Damage(at_field=5, count=2), Damage(at_field=9)
    script = Script([damage, second, Lose(at_field=6)])
    assert [script.at(n, Damage) for n in (4, 5, 6, 7, 9)] == [None, damage, damage, None, second]
    assert [n for n in range(12) if not script.delivers(n)] == [6]


def test_only_what_the_sequence_does_not_show_is_passed_over() -> None:
    script = Script([Lose(at_field=2), LoseSilently(at_field=4, count=2), Stall(at_field=8, duration_s=0.06)])
    assert [script.uncounted(n) for n in (0, 4, 5, 6, 8, 10, 11, 50)] == [0, 0, 1, 2, 2, 4, 5, 5]
    assert not script.counts_losses()
    assert Script([Lose(at_field=2), Damage(at_field=3)]).counts_losses()


windows = st.lists(st.tuples(st.integers(0, 40), st.integers(1, 12)), max_size=5)


@given(windows, st.integers(0, 60))
def test_windows_that_overlap_are_passed_over_once(silent: list[tuple[int, int]], number: int) -> None:
    script = Script([LoseSilently(at_field=first, count=count) for first, count in silent])
    passed = {n for first, count in silent for n in range(first, first + count) if n < number}
    assert script.uncounted(number) == len(passed)


def test_every_kind_says_in_a_line_what_it_does() -> None:
    assert all((kind.__doc__ or "").strip() for kind in KINDS.values())


@pytest.mark.parametrize("kind", [Stall, Fail])
@pytest.mark.parametrize("until", STEPS)
def test_what_lasts_until_a_step_is_ended_by_it_and_by_a_harder_one(
    kind: type[Recoverable], until: str
) -> None:
    for step in STEPS:
        fault = kind(at_field=10, until=until)
        script = Script([fault])
        script.clear(step, 500)
        cleared = STEPS.index(step) >= STEPS.index(until)
        assert script.at(499, kind) is fault
        assert (script.at(500, kind) is None) is cleared
        assert script.delivers(10_000) is cleared


def test_a_step_before_a_fault_does_not_help_against_it() -> None:
    script = Script([Stall(at_field=10, until="restart")])
    script.clear("reset", 9)
    assert not script.delivers(10)


def test_what_lasts_for_a_time_is_ended_by_no_step() -> None:
    script = Script([Stall(at_field=10, duration_s=1.0)])
    script.clear("reset", 20)
    assert [script.delivers(n) for n in (59, 60)] == [False, True]
    assert script.uncounted(100) == 50


def test_what_was_mended_was_not_counted_until_then() -> None:
    script = Script([Stall(at_field=10, until="restart")])
    script.clear("restart", 25)
    assert script.uncounted(100) == 15


def test_the_sequence_begins_anew_where_the_script_has_it_pass_its_end() -> None:
    assert (Script([]).wraps_after(), Script([Wrap(at_field=30)]).wraps_after()) == (0, 30)


def test_a_grabber_has_another_node_after_each_time_it_came_back_elsewhere() -> None:
    script = Script(
        [
            Unplug(at_field=10, back_after_s=0.1, elsewhere=True),
            Unplug(at_field=30, back_after_s=0.1),
            Unplug(at_field=50, back_after_s=0.1, elsewhere=True),
        ]
    )
    assert [script.node(n) for n in (0, 14, 15, 40, 55)] == [0, 0, 1, 1, 2]
