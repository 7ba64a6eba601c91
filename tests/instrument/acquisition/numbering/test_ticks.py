"""Devices that stamp and deliver by the kernel's tick: their first fields have certain numbers, too."""

import pytest

from grabberd.core.field import NTSC_HZ, FieldOrder
from grabberd.core.ledger import Outcome
from grabberd.instrument.acquisition.numbering import FieldNumbering
from instrument.acquisition.streams import START_NS, grab, info
from instrument.acquisition.ticks import TickedDevice

STREAMS = [
    (FieldOrder.ALTERNATE, NTSC_HZ),
    (FieldOrder.BOTTOM_FIRST, NTSC_HZ),
    (FieldOrder.TOP_FIRST, NTSC_HZ),
    (FieldOrder.PROGRESSIVE, 60.0),
    (FieldOrder.PROGRESSIVE, 40.0),
    (FieldOrder.PROGRESSIVE, 30.0),
]


def numbered(device, since_ns=None):
    """What was dequeued, and what it was numbered as."""
    numbering, taken = FieldNumbering(device.info, since_ns), list(device.run())
    found = [one for each in taken for one in numbering.number(each.grabbed, now_ns=each.now_ns)]
    return taken, found + numbering.settle()


@pytest.mark.parametrize("varies_ms", [0.5, 2.0, 3.0, 4.0])
@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(("order", "rate_hz"), STREAMS)
def test_every_field_has_its_number_whenever_the_stream_was_asked_for(order, rate_hz, seed, varies_ms):
    """Arrivals vary by more than a quarter of a period, and by less than tells that stamps are not theirs."""
    device = TickedDevice(rate_hz, order, seed=seed, asked_ms=seed, varies_ms=varies_ms, buffers=150)
    taken, found = numbered(device)
    assert [one.n for one in found] == [each.n for each in taken]
    assert {one.outcome for one in found} == {Outcome.RECEIVED}


@pytest.mark.parametrize("order", [FieldOrder.ALTERNATE, FieldOrder.PROGRESSIVE])
def test_it_is_known_before_more_fields_wait_than_the_buffers_hold(order):
    device = TickedDevice(60.0, order, varies_ms=3.0)
    numbering = FieldNumbering(device.info)
    released = [len(numbering.number(each.grabbed, now_ns=each.now_ns)) for each in device.run()]
    assert sum(released[:16]) > 0
    assert released[20:] == [1] * len(released[20:])


@pytest.mark.parametrize("counts", [False, True])
def test_losses_are_told_with_their_place(counts):
    device = TickedDevice(60.0, lost=(40, 41, 90), counts=counts)
    taken, found = numbered(device, device.asked_ns)
    assert [one.n for one in found] == [each.n for each in taken]
    assert [entry[:2] for one in found for entry in one.lost_before] == [(40, 2), (90, 1)]


@pytest.mark.parametrize(("order", "rate_hz"), STREAMS)
def test_a_device_that_wakes_late_now_and_then_loses_nothing(order, rate_hz):
    device = TickedDevice(rate_hz, order, late=0.03, varies_ms=1.0, buffers=400)
    taken, found = numbered(device, device.asked_ns)
    assert [one.n for one in found] == [each.n for each in taken]
    assert sum(one.outcome is Outcome.RECEIVED for one in found) == len(taken)


@pytest.mark.parametrize(("order", "in_turn"), [(FieldOrder.ALTERNATE, 1), (FieldOrder.TOP_FIRST, 2)])
@pytest.mark.parametrize(("slower", "counts"), [(1.0, False), (1.005, False), (1.005, True)])
def test_times_do_not_run_away_from_fields_while_ticks_as_long_as_periods_pass_them(
    order, in_turn, slower, counts
):
    numbering = FieldNumbering(info(order, rate_hz=NTSC_HZ, counts_losses=counts))
    period_ns, tick_ns, found = slower * 1e9 / NTSC_HZ, 16_667_000, []
    for n in range(3500):
        newest = n // in_turn * in_turn + in_turn - 1
        came_ns = START_NS + round(newest * period_ns)
        stamp_ns = came_ns // tick_ns * tick_ns - round((newest - n) * period_ns)
        found += numbering.number(grab(n, time_ns=stamp_ns, sequence=n), now_ns=came_ns)
    assert [one.n for one in found] == list(range(len(found)))
    assert {one.outcome for one in found} == {Outcome.RECEIVED}
    assert all(abs(one.time_ns - START_NS - one.n * period_ns) < 1.3 * period_ns for one in found)
