"""Changes of what numbers and times go by: each is told once, and nothing else is."""

import pytest

from grabberd.core.field import FieldOrder
from grabberd.core.ledger import UNCERTAIN, Outcome, Rebase, too_high_by
from grabberd.instrument.acquisition.numbering import FieldNumbering
from instrument.acquisition.streams import MS, PERIOD_NS, Numbering, grab, info, numbers_in_time

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
    late_ns = 60_000_000
    numbering = Numbering(asked_ns=late_ns)
    for n in range(60):
        grabbed = grab(n, late_ns=late_ns if n < 20 else 0)
        numbering.see(grabbed, now_ns=grabbed.time_ns + WAY_NS)
    fields = numbering.settled()
    assert [kind for _, kind in rebases(fields)] == [Rebase.BEGIN]
    assert reasons(fields) == ["the first timestamps were late by 60 ms"]


@pytest.mark.parametrize("by_ms", [-30, -40, -60, -80, -100, 40, 60])
@pytest.mark.parametrize("set_at", [40, 90, 150])
def test_a_clock_that_is_set_by_a_few_fields_is_told_as_such_also_in_a_new_stream(by_ms, set_at):
    fields = in_time((n, grab(n, late_ns=by_ms * 1_000_000 if n >= set_at else 0)) for n in range(300))
    assert [field.n for field in fields] == list(range(300))
    assert [kind for _, kind in rebases(fields)] == [Rebase.CLOCK]
    late_ms = [(field.time_ns - grab(field.n).time_ns) / 1e6 for field in fields]
    assert max(map(abs, late_ms)) < 31


@pytest.mark.parametrize("by_ms", [-80, -60, -40])
@pytest.mark.parametrize("pause", [5, 6, 15])
def test_a_clock_that_is_set_back_while_fields_wait_spoils_few_of_them(by_ms, pause):
    stream = info()
    numbering = Numbering(stream)
    lost = range(400 + stream.buffers, 400 + pause)
    for n in (one for one in range(1500) if one not in lost):
        grabbed = grab(n, late_ns=by_ms * 1_000_000 if n >= 401 else 0)
        due_ns = grab(400 + pause).time_ns if 400 <= n < 400 + pause else grab(n).time_ns
        numbering.see(grabbed, now_ns=due_ns + WAY_NS)
    fields = numbering.settled()
    assert sum(field.outcome is Outcome.DAMAGED for field in fields) < 40
    assert [kind for _, kind in rebases(fields)] == [Rebase.CLOCK]
    assert fields[-1].time_ns == pytest.approx(grab(1499).time_ns, abs=5_000_000)


def test_a_restarted_stream_counts_anew_and_that_is_none():
    numbering = FieldNumbering(info(counts_losses=True))
    found = []
    for n in range(60):
        found += numbering.number(grab(n, sequence=n), now_ns=grab(n).time_ns + WAY_NS)
    found += numbering.interrupt("unplugged")
    for n in range(200, 260):
        found += numbering.number(grab(n, sequence=n - 200), now_ns=grab(n).time_ns + WAY_NS)
    assert rebases(found + numbering.settle()) == []


def test_a_doubt_that_ends_tells_by_how_many_the_numbers_are_off():
    """Stamps of arrivals that are late by as many fields pass for lost ones; arrivals in time tell later."""
    numbering, late = Numbering(), {60 + i: 6 for i in range(4)}
    for n in range(200):
        behind_ns = late.get(n, 0) * PERIOD_NS if n < 64 else 0
        behind_ns = behind_ns or (max(0, 6 - 0.5 * (n - 64)) * PERIOD_NS if 64 <= n < 76 else 0)
        grabbed = grab(n, late_ns=round(behind_ns))
        numbering.see(grabbed, now_ns=grabbed.time_ns + WAY_NS)
    fields = numbering.settled()
    off = fields[-1].n - 199
    told = sum(too_high_by(event) for field in fields for event in field.rebases)
    assert off == told
    assert fields[-1].outcome is Outcome.RECEIVED


def test_a_field_that_is_damaged_for_another_reason_says_that_its_number_is_uncertain_too():
    numbering = Numbering()
    numbering.number(grab(0))
    found = numbering.number(grab(25, damage="short: 3 lines"))
    assert (found.outcome, found.reason) == (
        Outcome.DAMAGED,
        f"{UNCERTAIN} 24; short: 3 lines",
    )


def test_stamps_of_before_the_epoch_leave_the_times_to_the_arrivals():
    """A clock that is set back by more than it shows gives no time; the camera then changes its rate."""
    numbering, longer_ns = Numbering(), 20_000
    for n in range(1600):
        exposed_ns = grab(n).time_ns + max(n - 150, 0) * longer_ns
        time_ns = exposed_ns if n < 100 else exposed_ns - 2 * grab(0).time_ns
        numbering.see(grab(n, time_ns=time_ns), now_ns=exposed_ns + WAY_NS)
    last = numbering.settled()[-1]
    assert (last.n, last.reason) == (1599, "time predicted (zero timestamp)")
    assert last.time_ns == pytest.approx(grab(1599).time_ns + 1449 * longer_ns, abs=PERIOD_NS // 2)


@pytest.mark.parametrize(
    ("order", "fields", "counts", "uncertain"),
    [
        (FieldOrder.ALTERNATE, 4, True, 56),
        (FieldOrder.ALTERNATE, 4, False, 12),
        (FieldOrder.PROGRESSIVE, 1, False, 12),
    ],
)
def test_a_clock_that_is_set_back_by_just_the_fields_that_are_lost_leaves_the_arrivals_to_tell(
    order, fields, counts, uncertain
):
    """Stamps, parity and a count that has missed the loss go on as if nothing had happened."""
    numbering, kept = Numbering(info(order, counts_losses=counts)), [*range(60), *range(60 + fields, 120)]
    for place, n in enumerate(kept):
        stamped = grab(n, late_ns=-fields * PERIOD_NS if n >= 60 else 0, sequence=place if counts else None)
        numbering.see(stamped, now_ns=grab(n).time_ns + WAY_NS)
    found = numbering.settled()
    doubtful = [one for one in found if UNCERTAIN in (one.reason or "")]
    assert len(doubtful) == uncertain
    assert all(one.n == n for one, n in zip(found, kept, strict=True) if one not in doubtful)


@pytest.mark.parametrize("held_from", [4, 7, 9])
def test_a_clock_that_is_set_while_a_hub_holds_fields_back_is_no_loss_if_the_count_has_none(held_from):
    """A queue drains without a loss, and what comes right after it has not waited."""
    numbering = Numbering(info(FieldOrder.PROGRESSIVE, counts_losses=True), asked_ns=PERIOD_NS // 2)
    held, until_ns = range(held_from, held_from + 8), grab(held_from + 10).time_ns + WAY_NS
    kept = [*range(held_from + 8), *range(held_from + 11, held_from + 60)]
    for n in kept:
        now_ns = until_ns + (n - held_from) * MS // 2 if n in held else grab(n).time_ns + WAY_NS
        stamped = grab(n, late_ns=PERIOD_NS if n >= held_from else 0, sequence=n)
        numbering.see(stamped, now_ns=now_ns, in_time=n not in held[1:])
    found = numbering.settled()
    assert [one.n for one in found] == kept
    assert max(abs(one.time_ns - grab(n).time_ns) for one, n in zip(found, kept, strict=True)) < MS
