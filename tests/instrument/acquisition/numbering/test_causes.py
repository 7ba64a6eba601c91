"""Causes of losses in a standstill: what found the driver's buffers full, and what was lost on the bus."""

import pytest

from grabberd.core.field import FieldOrder
from instrument.acquisition.streams import PERIOD_NS, Numbering, grab, info, lost


def standing_still(until_n, kept, order=FieldOrder.ALTERNATE):
    """Losses of a program that takes nothing from field 40 until field `until_n` comes."""
    numbering, first = Numbering(info(order, counts_losses=True)), int(order is FieldOrder.BOTTOM_FIRST)
    waits_for_the_next = {FieldOrder.TOP_FIRST: 0, FieldOrder.BOTTOM_FIRST: 1}.get(order)
    until_ns = grab(until_n + first).time_ns + 2 * PERIOD_NS
    for n in (one + first for one in kept):
        comes_ns = grab(n + (n % 2 == waits_for_the_next)).time_ns + 2 * PERIOD_NS
        has_waited = n >= 40 + first and comes_ns < until_ns
        if n == 40 + first:
            numbering.stood_still((until_n - 40) * PERIOD_NS)
        now_ns = until_ns if has_waited else comes_ns
        numbering.see(grab(n, sequence=n), now_ns=now_ns, in_time=not has_waited)
    return [entry for field in numbering.settled() for entry in lost(field.lost_before)]


ORDERS = pytest.mark.parametrize(
    "order", [FieldOrder.ALTERNATE, FieldOrder.TOP_FIRST, FieldOrder.BOTTOM_FIRST]
)


@ORDERS
def test_what_came_while_the_buffers_were_full_is_lost_to_the_computer(order):
    kept = [*range(48), *range(62, 90)]
    assert standing_still(61, kept, order) == [(48, 14, "computer busy")]


@ORDERS
def test_what_is_missing_among_the_fields_in_the_buffers_was_lost_on_the_bus(order):
    kept = [*range(44), *range(46, 50), *range(62, 90)]
    assert standing_still(61, kept, order) == [(44, 2, "time gap"), (50, 12, "computer busy")]


@ORDERS
def test_what_began_after_a_buffer_was_returned_was_lost_on_the_bus_as_well(order):
    kept, began_before = [*range(48), *range(70, 90)], 63 if order is FieldOrder.ALTERNATE else 64
    assert standing_still(61, kept, order) == [
        (48, began_before - 48, "computer busy"),
        (began_before, 70 - began_before, "time gap"),
    ]


def test_a_stream_that_begins_again_has_empty_buffers():
    numbering = Numbering(info())
    for n in range(40):
        numbering.see(grab(n), now_ns=grab(n).time_ns + 2 * PERIOD_NS)
    numbering.interrupt("another standard")
    for n in [*range(50, 55), *range(56, 80)]:
        if n == 50:
            numbering.stood_still(9 * PERIOD_NS)
        numbering.see(grab(n), now_ns=grab(n).time_ns + 2 * PERIOD_NS)
    losses = [entry for field in numbering.settled() for entry in lost(field.lost_before)]
    assert losses == [(40, 10, "another standard"), (55, 1, "time gap")]


BUSY = "computer busy (waited 0.1 s for a processor)"


@pytest.mark.parametrize(
    ("missing", "losses"),
    [
        (5, [(40, 5, BUSY)]),
        (1, [(40, 1, "time gap")]),
        (20, [(40, 6, BUSY), (46, 14, "time gap")]),
    ],
)
def test_all_fields_of_a_pause_are_lost_to_the_computer_which_stood_still_as_a_whole(missing, losses):
    numbering = Numbering(info(counts_losses=True))
    for n in [*range(40), *range(40 + missing, 80)]:
        if n == 40 + missing:
            numbering.driver_stood_still(5 * PERIOD_NS)
        numbering.see(grab(n, sequence=n), now_ns=grab(n).time_ns + 2 * PERIOD_NS)
    assert [entry for field in numbering.settled() for entry in lost(field.lost_before)] == losses


def test_a_field_that_a_pause_of_the_computer_may_have_held_up_is_uncertain_and_the_next_is_not():
    numbering = Numbering(info(counts_losses=True))
    for n in [*range(40), *range(45, 80)]:
        if n == 45:
            numbering.driver_stood_still(5 * PERIOD_NS)
        numbering.see(grab(n, sequence=n), now_ns=grab(n).time_ns + 2 * PERIOD_NS)
    doubts = [(field.n, field.reason) for field in numbering.settled() if field.reason]
    assert doubts == [(45, "number uncertain by up to 5")]


def test_fields_that_were_filled_before_a_pause_of_the_computer_come_before_its_losses():
    numbering = Numbering(info(counts_losses=True))
    resumed_ns = grab(49).time_ns
    for n in [*range(42), *range(49, 80)]:
        if n == 40:
            numbering.driver_stood_still(7 * PERIOD_NS)
        late = n in (40, 41)
        came_ns = grab(n).time_ns + 2 * PERIOD_NS
        numbering.see(
            grab(n, sequence=n), now_ns=max(came_ns, resumed_ns) if late else came_ns, in_time=not late
        )
    assert [lost(field.lost_before) for field in numbering.settled() if field.lost_before] == [
        [(42, 7, BUSY)]
    ]
