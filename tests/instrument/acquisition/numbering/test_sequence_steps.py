"""A driver's own count of fields, whichever way it counts."""

import pytest

from grabberd.instrument.acquisition.numbering.arrivals import SequenceSteps


def steps(counts, alternate=True, parities=None):
    sequence = SequenceSteps(alternate)
    parities = parities or [i % 2 for i in range(len(counts))]
    return [sequence.step(count, parity) for count, parity in zip(counts, parities, strict=True)]


def test_without_a_count_there_is_no_answer():
    assert steps([None, None, 3, None, 5]) == [None] * 5


def test_fields_of_woven_frames_are_counted_at_once():
    assert steps([4, 5, 8, 9], alternate=False) == [None, 1, 3, 1]


def test_a_count_for_each_field_is_learnt_from_three_single_steps():
    parities = [0, 1, 0, 1, 0, 0]
    assert steps([10, 11, 12, 13, 14, 16], parities=parities) == [None, None, None, 1, 1, 2]


def test_single_steps_that_a_loss_interrupts_teach_nothing():
    assert steps([10, 11, 13, 14], parities=[0, 1, 1, 0]) == [None] * 4


@pytest.mark.parametrize(("ahead", "step"), [(2**31 - 1, 2**31 - 1), (2**31, None), (2**32 - 1, None)])
def test_a_count_half_a_wrap_ahead_or_more_has_run_backward(ahead, step):
    assert steps([5, (5 + ahead) % 2**32], alternate=False) == [None, step]


def test_a_number_for_both_fields_of_a_frame_is_learnt_from_a_pair():
    assert steps([7, 7, 8, 8, 9]) == [None, 1, 1, 1, 1]


def test_losses_show_where_both_fields_of_a_frame_share_a_number():
    counts, parities = [7, 7, 8, 9, 9, 11], [0, 1, 0, 0, 1, 1]
    assert steps(counts, parities=parities) == [None, 1, 1, 2, 1, 4]


def test_a_frame_may_begin_with_the_bottom_field():
    assert steps([7, 7, 8, 8], parities=[1, 0, 1, 0]) == [None, 1, 1, 1]


@pytest.mark.parametrize("last", [2**32 - 1, 2**32 - 2])
def test_the_count_may_wrap(last):
    assert steps([last, (last + 2) % 2**32], alternate=False) == [None, 2]


@pytest.mark.parametrize("wrap", [2**16, 2**17])
@pytest.mark.parametrize("lost", [0, 40])
def test_a_count_of_16_bits_wraps_every_22_minutes_and_one_of_frames_every_44(wrap, lost):
    sequence = SequenceSteps(alternate=False)
    sequence.step(wrap - 1 - lost // 2, 0)
    assert sequence.step((lost + 1) // 2, 1) == 1 + lost
    assert not sequence.restarted


def test_a_count_that_begins_anew_from_elsewhere_has_not_wrapped():
    sequence = SequenceSteps(alternate=False)
    sequence.step(30_000, 0)
    assert sequence.step(1, 1) is None
    assert sequence.restarted


def test_the_shared_count_may_wrap():
    assert steps([2**32 - 1, 2**32 - 1, 0, 0]) == [None, 1, 1, 1]


def test_a_count_that_runs_backward_or_stands_tells_nothing():
    assert steps([100, 3, 3], alternate=False) == [None, None, None]


def test_after_an_interruption_the_count_may_begin_anew():
    sequence = SequenceSteps(alternate=False)
    sequence.step(100, 0)
    sequence.forget()
    assert sequence.step(103, 1) is None
    assert sequence.step(104, 0) == 1


def test_a_number_that_is_repeated_once_is_forgotten():
    counts = [*range(10), 9, *range(10, 40)]
    assert steps(counts)[-15:] == [1] * 15
