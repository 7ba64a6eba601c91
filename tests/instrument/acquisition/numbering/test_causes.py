"""Causes of losses in a standstill: what found the driver's buffers full, and what was lost on the bus."""

import pytest

from grabberd.core.field import FieldOrder
from grabberd.core.ledger import NO_SIGNAL
from grabberd.instrument.acquisition.device import Signal
from grabberd.instrument.acquisition.numbering import FieldNumbering
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
        (20, [(40, 6, f"unclear: time gap, or {BUSY}"), (46, 14, "time gap")]),
    ],
)
def test_all_fields_of_a_pause_and_no_more_are_lost_to_the_computer_which_stood_still_as_a_whole(
    missing, losses
):
    numbering = Numbering(info(counts_losses=True))
    for n in [*range(40), *range(40 + missing, 80)]:
        came_ns = grab(n).time_ns + 2 * PERIOD_NS
        if n == 40 + missing:
            numbering.driver_stood_still(5 * PERIOD_NS, came_ns)
        numbering.see(grab(n, sequence=n), now_ns=came_ns)
    assert [entry for field in numbering.settled() for entry in lost(field.lost_before)] == losses


def test_a_field_that_a_pause_of_the_computer_may_have_held_up_is_uncertain_and_the_next_is_not():
    numbering = Numbering(info(counts_losses=True))
    for n in [*range(40), *range(45, 80)]:
        came_ns = grab(n).time_ns + 2 * PERIOD_NS
        if n == 45:
            numbering.driver_stood_still(5 * PERIOD_NS, came_ns)
        numbering.see(grab(n, sequence=n), now_ns=came_ns)
    doubts = [(field.n, field.reason) for field in numbering.settled() if field.reason]
    assert doubts == [(45, "number uncertain by up to 5")]


def test_fields_that_were_filled_before_a_pause_of_the_computer_come_before_its_losses():
    numbering = Numbering(info(counts_losses=True))
    resumed_ns = grab(49).time_ns
    for n in [*range(42), *range(49, 80)]:
        if n == 40:
            numbering.driver_stood_still(7 * PERIOD_NS, resumed_ns)
        late = n in (40, 41)
        came_ns = grab(n).time_ns + 2 * PERIOD_NS
        numbering.see(
            grab(n, sequence=n), now_ns=max(came_ns, resumed_ns) if late else came_ns, in_time=not late
        )
    assert [lost(field.lost_before) for field in numbering.settled() if field.lost_before] == [
        [(42, 7, BUSY)]
    ]


def paused(until_n, kept, again=None):
    """Losses of a program that stands still from field 40 until `until_n`, perhaps with its driver, and once
    more for three periods before field `again`.
    """
    numbering, until_ns = Numbering(info(counts_losses=True)), grab(until_n).time_ns + 2 * PERIOD_NS
    for n in kept:
        if n == 40:
            numbering.driver_stood_still((until_n - 40) * PERIOD_NS, until_ns)
        if n == again:
            numbering.driver_stood_still(3 * PERIOD_NS, until_ns)
        came_ns = grab(n).time_ns + 2 * PERIOD_NS
        late = n >= 40 and came_ns < until_ns
        numbering.see(grab(n, sequence=n), now_ns=until_ns if late else came_ns, in_time=not late)
    return [entry for field in numbering.settled() for entry in lost(field.lost_before)]


def test_a_long_loss_amid_a_pause_may_be_of_the_driver_or_of_the_bus():
    kept = [*range(42), *range(47, 80)]
    assert paused(52, kept) == [(42, 5, "unclear: time gap, or computer busy (waited 0.2 s for a processor)")]


def test_a_short_pause_does_not_let_the_long_one_before_be_forgotten():
    kept = [*range(42), *range(47, 80)]
    assert paused(52, kept, again=47) == [
        (42, 5, "unclear: time gap, or computer busy (waited 0.2 s for a processor)")
    ]


def test_a_pause_ends_before_what_a_hub_holds_back_meanwhile():
    numbering = Numbering(info(counts_losses=True))
    for n in [*range(40), *range(50, 90)]:
        came_ns, held = grab(n).time_ns + 2 * PERIOD_NS, range(50, 62)
        if n == 50:
            numbering.driver_stood_still(14 * PERIOD_NS, grab(54).time_ns)
        now_ns = grab(62).time_ns + 2 * PERIOD_NS if n in held else came_ns
        numbering.see(grab(n, sequence=n), now_ns=now_ns, in_time=n not in held[1:])
    losses = [entry for field in numbering.settled() for entry in lost(field.lost_before)]
    assert losses == [(40, 10, "unclear: time gap, or computer busy (waited 0.3 s for a processor)")]


@pytest.mark.parametrize(("later", "cause"), [(0.1, "computer busy"), (0.6, "time gap")])
def test_what_begins_barely_after_a_buffer_is_returned_may_have_found_none(later, cause):
    numbering, until_ns = Numbering(info(counts_losses=True)), grab(49).time_ns - round(later * PERIOD_NS)
    for n in [*range(48), *range(49, 90)]:
        came_ns = grab(n).time_ns + 2 * PERIOD_NS
        if n == 40:
            numbering.stood_still(until_ns - grab(40).time_ns)
        waited = n >= 40 and came_ns < until_ns
        numbering.see(grab(n, sequence=n), now_ns=until_ns if waited else came_ns, in_time=not waited)
    assert [entry for field in numbering.settled() for entry in lost(field.lost_before)] == [(48, 1, cause)]


def test_of_a_loss_that_goes_on_after_a_pause_only_what_came_within_it_may_be_of_the_driver():
    assert paused(52, [*range(42), *range(56, 80)]) == [
        (42, 12, "unclear: time gap, or computer busy (waited 0.2 s for a processor)"),
        (54, 2, "time gap"),
    ]


def test_a_loss_after_a_pause_is_none_of_it_however_long():
    assert paused(48, [*range(50), *range(60, 80)]) == [(50, 10, "time gap")]


def test_a_field_without_a_signal_says_nothing_of_those_lost_while_it_waited():
    numbering = Numbering(info(counts_losses=True))
    for n in [*range(48), *range(62, 90)]:
        if n == 40:
            numbering.stood_still(21 * PERIOD_NS)
        has_waited, signal = 40 <= n < 48, Signal.ABSENT if n >= 62 else Signal.PRESENT
        now_ns = grab(61 if has_waited else n).time_ns + 2 * PERIOD_NS
        numbering.see(grab(n, sequence=n), signal, now_ns=now_ns, in_time=not has_waited)
    losses = [entry for field in numbering.settled() for entry in lost(field.lost_before)]
    assert losses == [(48, 14, f"unclear: {NO_SIGNAL}, or computer busy")]


def test_a_buffer_that_is_handed_over_twice_has_had_its_turn():
    numbering, found = FieldNumbering(info(counts_losses=True)), []
    until_ns = grab(49).time_ns + 2 * PERIOD_NS
    for n in [*range(47), *range(50, 80)]:
        came_ns = grab(n).time_ns + 2 * PERIOD_NS
        has_waited = 40 <= n < 47
        if n == 40:
            numbering.stood_still(9 * PERIOD_NS)
        now_ns = until_ns if has_waited else came_ns
        # At once, also if the next one comes later.
        numbering.returned_ns = until_ns if 40 < n <= 50 else grab(n - 1).time_ns + 2 * PERIOD_NS
        found += numbering.number(grab(n, sequence=n), now_ns=now_ns, in_time=not has_waited)
        if n == 44:
            numbering.returned_ns = until_ns
            numbering.skip(n % 2, until_ns)
    losses = [entry for field in found + numbering.settle() for entry in lost(field.lost_before)]
    assert losses == [(47, 3, "computer busy")]


def test_a_computer_that_may_have_stood_still_while_fields_waited_is_one_cause_of_a_loss_meanwhile():
    """Fields that waited do not show it, and a pause shorter than the buffers last explains no loss alone."""
    stream = info(counts_losses=True)
    numbering, until_ns = Numbering(stream), grab(47).time_ns + 2 * PERIOD_NS
    for n in [*range(41), *range(46, 80)]:
        came_ns, waited = grab(n).time_ns + 2 * PERIOD_NS, n in (40, 46)
        if n == 40:
            numbering.paused(7 * PERIOD_NS, until_ns)
        numbering.see(grab(n, sequence=n), now_ns=until_ns if waited else came_ns, in_time=not waited)
    losses = [entry for field in numbering.settled() for entry in lost(field.lost_before)]
    assert losses == [(41, 5, "unclear: time gap, or computer busy (waited 0.1 s for a processor)")]
