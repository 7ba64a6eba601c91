"""Changes of what numbers and times go by: each is told once, and nothing else is."""

import pytest

from acquisition.streams import PERIOD_NS, Numbering, grab, info, numbers_in_time
from grabberd.acquisition import FieldOrder, Rebase
from grabberd.acquisition.numbering import FieldNumbering

WAY_NS = 2 * PERIOD_NS


def in_time(grabbed_fields, stream=None):
    """The fields as numbered, each (field, camera's number) arriving in time."""
    numbering = Numbering(stream or info(counts_losses=True))
    for n, grabbed in grabbed_fields:
        numbering.see(grabbed, now_ns=grab(n).time_ns + WAY_NS)
    return numbering.settled()


def rebases(fields):
    return [(event.n, event.kind) for field in fields for event in field.rebases]


def reasons(fields):
    return [event.reason for field in fields for event in field.rebases]


def test_a_steady_stream_has_none():
    fields = in_time((n, grab(n, sequence=n)) for n in range(200))
    assert rebases(fields) == []


def test_losses_and_jitter_are_none():
    kept = [n for n in range(200) if n not in (50, 51, 90)]
    late = {n: (n * 7919) % 8_000_000 for n in kept}
    assert rebases(numbers_in_time(kept, late)) == []


@pytest.mark.parametrize("by_s", [3600.0, -3600.0, 0.5, -0.5])
def test_a_clock_that_is_set_is_told_once_with_its_step(by_s):
    def stamped(n):
        return grab(n, sequence=n, late_ns=round(by_s * 1e9) if n >= 120 else 0)

    fields = in_time((n, stamped(n)) for n in range(300))
    ((n, kind),) = rebases(fields)
    assert kind is Rebase.CLOCK
    assert 120 <= n <= 130
    assert reasons(fields) == [f"the clock of the timestamps was set by {by_s:+.3f} s"]


def test_stamps_that_fail_for_long_and_come_back_are_told_twice():
    fields = in_time((n, grab(n, sequence=n, time_ns=0 if 100 <= n < 150 else None)) for n in range(250))
    assert rebases(fields) == [(104, Rebase.ARRIVALS), (150, Rebase.TIMESTAMPS)]
    assert "zero timestamp" in reasons(fields)[0]


def test_a_single_bad_stamp_is_none():
    fields = in_time((n, grab(n, sequence=n, time_ns=0 if n == 100 else None)) for n in range(150))
    assert rebases(fields) == []


@pytest.mark.parametrize("order", [FieldOrder.ALTERNATE, FieldOrder.TOP_FIRST])
def test_a_count_that_restarts_is_told(order):
    fields = in_time(
        ((n, grab(n, sequence=n + 5000 if n < 60 else n - 60)) for n in range(100)),
        info(order, counts_losses=True),
    )
    assert rebases(fields) == [(60, Rebase.COUNT)]
    assert reasons(fields) == ["the driver's count has restarted, to 0"]


def test_a_count_that_skips_although_nothing_is_missing_is_told():
    fields = in_time((n, grab(n, sequence=n if n < 60 else n + 900)) for n in range(100))
    assert rebases(fields) == [(60, Rebase.COUNT)]
    assert [field.n for field in fields] == list(range(100))


def test_a_count_that_wraps_is_none():
    fields = in_time((n, grab(n, sequence=(2**32 - 50 + n) % 2**32)) for n in range(100))
    assert rebases(fields) == []


def test_a_driver_that_counts_too_much_throughout_is_told_of_once():
    stream = info(FieldOrder.TOP_FIRST, counts_losses=True)
    fields = in_time(((n, grab(n, sequence=3 * n)) for n in range(100)), stream)
    assert [kind for _, kind in rebases(fields)] == [Rebase.COUNT]


def test_a_camera_in_the_other_phase_is_told():
    fields = in_time((n, grab(n, sequence=n, parity=(n + (n >= 60)) % 2)) for n in range(100))
    assert rebases(fields) == [(60, Rebase.PHASE)]


def test_first_stamps_that_were_late_are_told():
    numbering, late_ns = Numbering(), 60_000_000
    for n in range(60):
        grabbed = grab(n, late_ns=late_ns if n < 20 else 0)
        numbering.see(grabbed, now_ns=grabbed.time_ns + WAY_NS)
    fields = numbering.settled()
    assert [kind for _, kind in rebases(fields)] == [Rebase.BEGIN]
    assert reasons(fields) == ["the first timestamps were late by 60 ms"]


def test_a_restarted_stream_counts_anew_and_that_is_none():
    numbering = FieldNumbering(info(counts_losses=True))
    found = []
    for n in range(60):
        found += numbering.number(grab(n, sequence=n), now_ns=grab(n).time_ns + WAY_NS)
    found += numbering.interrupt("unplugged")
    for n in range(200, 260):
        found += numbering.number(grab(n, sequence=n - 200), now_ns=grab(n).time_ns + WAY_NS)
    assert rebases(found + numbering.settle()) == []
