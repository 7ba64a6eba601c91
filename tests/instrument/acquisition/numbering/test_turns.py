"""Buffers handed over in another order than they were filled, as a list of waiting ones may be reversed."""

import pytest

from grabberd.core.field import FieldOrder
from grabberd.core.ledger import Outcome, too_high_by
from instrument.acquisition.streams import PERIOD_NS, Numbering, grab, info, lost

STREAMS = [(FieldOrder.PROGRESSIVE, 1), (FieldOrder.ALTERNATE, 1), (FieldOrder.TOP_FIRST, 2)]


def handed_over(turns, order, in_turn, counts, until=46):
    """What becomes of fields in this order, those of the buffers from 40 to `until` taken together."""
    numbering = Numbering(info(order, counts_losses=counts))
    for n in turns:
        waits = 40 <= n < until
        came_ns = grab(until - 1 if waits else n // in_turn * in_turn + in_turn - 1).time_ns
        one = grab(n, parity=0 if order is FieldOrder.PROGRESSIVE else None, sequence=n)
        numbering.see(one, now_ns=came_ns + 2 * PERIOD_NS, in_time=not waits)
    return numbering.settled()


@pytest.mark.parametrize("counts", [True, False])
@pytest.mark.parametrize(("order", "in_turn"), STREAMS)
@pytest.mark.parametrize(("first", "passed_by"), [(40, 1), (42, 1), (42, 2), (42, 3)])
def test_buffers_out_of_turn_have_uncertain_numbers_and_are_not_lost(
    first, passed_by, order, in_turn, counts
):
    end = first + (1 + passed_by) * in_turn
    turns = [*range(first), *range(first + in_turn, end), *range(first, first + in_turn), *range(end, 80)]
    found = handed_over(turns, order, in_turn, counts, until=max(end, 46))
    assert_true(found, turns)
    assert all(one.outcome is Outcome.DAMAGED for one in found[first:end])
    losses = [entry for field in found for entry in lost(field.lost_before)]
    assert all(reason.startswith("number uncertain") for _, _, reason in losses)


@pytest.mark.parametrize("counts", [True, False])
@pytest.mark.parametrize(("order", "in_turn"), STREAMS)
def test_a_buffer_that_several_have_passed_by_after_a_loss_is_not_one_more(order, in_turn, counts):
    passed_by, late, rest = (40 + in_turn * at for at in (4, 2, 6))
    turns = [*range(40), *range(passed_by, rest), *range(late, late + in_turn), *range(rest, 100)]
    assert_true(handed_over(turns, order, in_turn, counts, rest + in_turn), turns)


def assert_true(found, turns):
    """Each number is that of its field, or off by no more than it says."""
    too_high = 0
    for one, k in zip(found, turns, strict=True):
        too_high += sum(map(too_high_by, one.rebases))
        uncertain_by = int(one.reason.split(";")[0].split()[-1]) if one.outcome is Outcome.DAMAGED else 0
        assert abs(one.n - too_high - k) <= uncertain_by


def test_stamps_that_run_backward_in_time_are_not_out_of_turn():
    numbering = Numbering(info())
    for n in range(60):
        late_ns = -2 * (n - 40) * PERIOD_NS if 40 < n < 44 else 0
        numbering.see(grab(n, late_ns=late_ns), now_ns=grab(n).time_ns + 2 * PERIOD_NS)
    assert {one.outcome for one in numbering.settled()} == {Outcome.RECEIVED}
