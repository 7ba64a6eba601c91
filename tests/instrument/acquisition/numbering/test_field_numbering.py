"""Which field a grabbed field is, through jitter, losses and lies."""

from random import Random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from grabberd.core.field import FieldOrder
from grabberd.core.ledger import LedgerEntry, Outcome
from grabberd.instrument.acquisition.device import Signal
from instrument.acquisition.streams import (
    MS,
    PERIOD_NS,
    START_NS,
    Numbering,
    grab,
    info,
    lost,
    numbers,
    numbers_in_time,
)


def test_fields_without_losses_are_numbered_from_zero():
    found = numbers(grab(n) for n in range(100, 150))
    assert [field.n for field in found] == list(range(50))
    assert all(field.outcome is Outcome.RECEIVED and field.reason is None for field in found)
    assert all(field.lost_before == () for field in found)


def test_steady_times_are_handed_on_unchanged():
    found = numbers(grab(n) for n in range(50))
    assert [field.time_ns for field in found] == [START_NS + n * PERIOD_NS for n in range(50)]


def test_the_times_of_a_recording_are_handed_on_as_they_are():
    found = numbers([grab(n, late_ns=n % 3 * MS) for n in range(30)], info(live=False))
    assert [field.time_ns for field in found] == [START_NS + n * PERIOD_NS + n % 3 * MS for n in range(30)]


def test_a_recording_may_begin_at_zero_and_pause_for_an_hour():
    found = numbers([grab(n, time_ns=n * PERIOD_NS) for n in (0, 1, 2, 180_000)], info(live=False))
    assert [field.n for field in found] == [0, 1, 2, 180_000]
    assert found[-1].reason is None


def test_one_parity_alone_comes_at_half_the_rate():
    stream = info(FieldOrder.ONE_PARITY, rate_hz=25.0)
    kept = [*range(10), *range(12, 25)]
    found = numbers_in_time([2 * n for n in kept], stream=stream)
    assert [field.n for field in found] == kept
    assert all(field.outcome is Outcome.RECEIVED for field in found)


def test_progressive_pictures_have_no_parity_to_be_numbered_by():
    stream = info(FieldOrder.PROGRESSIVE, rate_hz=25.0)
    kept = [*range(10), *range(13, 25)]
    found = numbers_in_time([2 * n for n in kept], stream=stream)
    assert [field.n for field in found] == kept
    assert all(field.outcome is Outcome.RECEIVED for field in found)
    assert lost(found[10].lost_before) == [(10, 3, "time gap")]


def test_a_gap_in_time_tells_of_lost_fields():
    found = numbers([grab(0), grab(1), grab(5)])
    assert found[-1].n == 5
    assert found[-1].lost_before == (LedgerEntry(2, 3, Outcome.LOST, "time gap"),)


def test_a_late_field_of_the_due_parity_is_not_a_loss():
    found = numbers([grab(0), grab(1), grab(2, late_ns=14 * MS), grab(3)])
    assert [field.n for field in found] == [0, 1, 2, 3]


def test_a_field_that_comes_early_after_a_loss_is_told_by_its_parity():
    found = numbers([grab(0), grab(1), grab(3, late_ns=-14 * MS)])
    assert lost(found[-1].lost_before) == [(2, 1, "time gap")]


def test_the_count_decides_where_time_is_between_two_steps_and_parity_cannot_tell():
    stream = info(FieldOrder.ONE_PARITY, rate_hz=25.0, counts_losses=True)
    late = 18 * MS
    found = numbers([grab(0, sequence=0), grab(2, sequence=1), grab(4, late_ns=late, sequence=3)], stream)
    assert lost(found[-1].lost_before) == [(2, 1, "sequence gap")]


def test_count_and_parity_together_overrule_the_time():
    stream = info(FieldOrder.TOP_FIRST, counts_losses=True)
    fields = [grab(0, sequence=0), grab(1, sequence=1), grab(2, parity=1, sequence=3)]
    assert lost(numbers(fields, stream)[-1].lost_before) == [(2, 1, "sequence gap")]


def test_a_count_that_does_not_count_losses_is_not_listened_to():
    found = numbers([grab(n, sequence=10 * n) for n in range(5)])
    assert [field.n for field in found] == [0, 1, 2, 3, 4]


@pytest.mark.parametrize("sequence", [lambda n: n, lambda n: n // 2])
def test_either_numbering_of_alternating_fields_is_understood(sequence):
    kept = [0, 1, 2, 3, 4, 7, 8, 10]
    fields = [grab(n, sequence=sequence(n)) for n in kept]
    assert [field.n for field in numbers(fields, info(counts_losses=True))] == kept


@pytest.mark.parametrize("order", [FieldOrder.TOP_FIRST, FieldOrder.BOTTOM_FIRST])
@pytest.mark.parametrize("late_ns", [-15 * MS, 19 * MS])
def test_a_frame_may_be_late_by_a_whole_field_before_another_one_is_missed(order, late_ns):
    first = 0 if order is FieldOrder.TOP_FIRST else 1
    late = {6 + first: late_ns, 7 + first: late_ns}
    kept = [n for n in range(first, 40 + first) if n - first not in (16, 17)]
    found = numbers_in_time(kept, late, info(order))
    assert [field.n for field in found] == [*range(16), *range(18, 40)]
    assert all(field.outcome is Outcome.RECEIVED for field in found)


def test_a_count_that_the_parity_contradicts_is_not_believed_however_well_the_time_fits():
    fields = [grab(n, sequence=n) for n in range(6)] + [grab(7, sequence=8, late_ns=12 * MS)]
    fields += [grab(n, sequence=n + 1) for n in range(8, 20)]
    found = numbers(fields, info(FieldOrder.TOP_FIRST, counts_losses=True))
    assert [field.n for field in found] == [*range(6), *range(7, 20)]
    assert lost(found[6].lost_before) == [(6, 1, "time gap")]


def test_a_count_tells_of_a_loss_however_early_the_next_field_comes():
    fields = [grab(n, sequence=n) for n in range(6)] + [grab(7, sequence=7, late_ns=-33 * MS)]
    fields += [grab(n, sequence=n) for n in range(8, 20)]
    found = numbers(fields, info(counts_losses=True))
    assert {field.outcome for field in found} == {Outcome.RECEIVED}
    assert lost(found[6].lost_before) == [(6, 1, "sequence gap")]


@pytest.mark.parametrize("late_ms", [28, 30])
def test_a_stamp_may_be_late_by_a_field_and_a_half_where_the_driver_counts(late_ms):
    late = {6: late_ms * MS, 7: 28 * MS}
    fields = [grab(n, sequence=n, late_ns=late.get(n, 0)) for n in range(12)]
    found = numbers(fields, info(FieldOrder.TOP_FIRST, counts_losses=True))
    assert [field.n for field in found] == list(range(12))
    assert all(field.outcome is Outcome.RECEIVED for field in found)


def test_a_count_that_stands_still_through_a_long_gap_is_not_believed():
    fields = [grab(n, sequence=n) for n in range(6)] + [grab(n, sequence=n - 4) for n in range(10, 14)]
    found = numbers(fields, info(FieldOrder.TOP_FIRST, counts_losses=True))
    assert lost(found[6].lost_before) == [(6, 4, "time gap")]


@pytest.mark.parametrize(
    ("order", "rate_hz", "short"), [(FieldOrder.ALTERNATE, 50.0, 2), (FieldOrder.ONE_PARITY, 25.0, 1)]
)
def test_a_count_that_is_a_whole_field_of_its_parity_off_the_time_is_not_believed(order, rate_hz, short):
    every = round(50 / rate_hz)
    fields = [grab(every * n, sequence=n) for n in range(6)]
    fields += [grab(every * n, sequence=n - short) for n in range(8, 24)]
    found = numbers(fields, info(order, rate_hz=rate_hz, counts_losses=True))
    assert [field.n for field in found] == [*range(6), *range(8, 24)]
    assert lost(found[6].lost_before) == [(6, 2, "time gap")]


def test_what_is_missing_after_an_interruption_is_lost_for_its_reason():
    numbering = Numbering(info(counts_losses=True))
    for n in range(10):
        numbering.number(grab(n, sequence=n))
    numbering.interrupt("unplugged")
    after = grab(3010, late_ns=9 * MS, sequence=0)
    found = numbering.number(after)
    assert lost(found.lost_before) == [(10, 3000, "unplugged")]
    assert found.time_ns == after.time_ns, "after an interruption nothing is left to smooth it with"
    assert lost(numbering.number(grab(3012, sequence=2)).lost_before) == [(3011, 1, "time gap")]


def test_what_an_interruption_cost_is_told_by_the_arrival_where_a_new_clock_tells_nothing():
    numbering, way_ns = Numbering(info()), 33_000_000
    for n in range(10):
        numbering.see(grab(n), now_ns=grab(n).time_ns + way_ns)
    numbering.interrupt("unplugged")
    for n in range(40, 60):
        numbering.see(grab(n, time_ns=0), now_ns=grab(n).time_ns + way_ns)
    number = numbering.settled()[10]
    assert number.n == 40
    assert lost(number.lost_before) == [(10, 30, "unplugged")]
    assert number.reason == "time predicted (zero timestamp)"


def test_what_an_interruption_cost_is_unknown_without_a_stamp_and_an_arrival():
    numbering = Numbering(info())
    for n in range(10):
        numbering.number(grab(n))
    numbering.interrupt("unplugged")
    assert numbering.number(grab(40, time_ns=0)).n == 10


def test_an_interruption_is_excused_once():
    numbering = Numbering(info())
    numbering.number(grab(0))
    numbering.interrupt("stalled")
    numbering.number(grab(1))
    assert lost(numbering.number(grab(5)).lost_before) == [(2, 3, "time gap")]


def test_a_field_that_really_came_late_tells_of_a_gap():
    numbering = Numbering(info())
    for n in range(10):
        numbering.see(grab(n), now_ns=grab(n).time_ns)
    assert numbering.number(grab(61), now_ns=grab(61).time_ns).n == 61


def test_an_interruption_that_cost_nothing_leaves_no_entry():
    numbering = Numbering(info())
    numbering.number(grab(0))
    numbering.interrupt("stalled")
    assert numbering.number(grab(1)).lost_before == ()


def test_damage_that_the_driver_or_the_content_tells_of_is_entered():
    numbering = Numbering(info())
    by_driver = numbering.number(grab(0, damage="short buffer"))
    by_content = numbering.number(grab(1), damage="repeated")
    assert (by_driver.outcome, by_driver.reason) == (Outcome.DAMAGED, "short buffer")
    assert (by_content.outcome, by_content.reason) == (Outcome.DAMAGED, "repeated")


def test_fields_without_a_signal_are_numbered_but_not_received():
    numbering = Numbering(info())
    found = [numbering.number(grab(n), signal) for n, signal in enumerate(Signal)]
    assert [field.outcome for field in found] == [Outcome.RECEIVED, Outcome.NO_SIGNAL, Outcome.RECEIVED]


def test_fields_that_never_came_without_a_signal_were_not_lost():
    numbering = Numbering(info())
    numbering.number(grab(0))
    found = numbering.number(grab(25, damage="the driver flags an error"), Signal.ABSENT)
    assert found.lost_before == (LedgerEntry(1, 24, Outcome.NO_SIGNAL, "no signal"),)
    assert (found.outcome, found.reason) == (Outcome.NO_SIGNAL, "number uncertain by up to 24; no signal")


def test_a_driver_that_delivers_nothing_without_a_signal_has_lost_nothing():
    numbering = Numbering(info())
    numbering.number(grab(0))
    numbering.interrupt("no signal")
    found = numbering.number(grab(101), Signal.PRESENT)
    assert found.lost_before == (LedgerEntry(1, 100, Outcome.NO_SIGNAL, "no signal"),)


def test_what_an_interruption_cost_is_lost_for_its_reason_whatever_the_signal():
    numbering = Numbering(info())
    numbering.number(grab(0))
    numbering.interrupt("unplugged")
    found = numbering.number(grab(25), Signal.ABSENT)
    assert found.lost_before == (LedgerEntry(1, 24, Outcome.LOST, "unplugged"),)


def test_a_single_field_of_the_wrong_parity_is_damaged_and_moves_nothing():
    found = numbers([grab(0), grab(1), grab(2), grab(3, parity=0), grab(4), grab(5)])
    assert [field.n for field in found] == [0, 1, 2, 3, 4, 5]
    assert found[3].outcome is Outcome.DAMAGED
    assert found[3].reason == "parity contradicts time"
    assert [field.outcome for field in found[4:]] == [Outcome.RECEIVED] * 2


def test_a_camera_that_comes_back_in_the_other_phase_is_followed():
    turned = [grab(n, parity=1 - n % 2) for n in range(4, 30)]
    found = numbers([grab(n) for n in range(4)] + turned)
    assert [field.n for field in found] == list(range(30))
    assert {field.outcome for field in found} == {Outcome.RECEIVED}


gaps = st.lists(st.integers(0, 6), min_size=1, max_size=120)


def kept_fields(gaps_between):
    n, kept = 0, [0]
    for gap in gaps_between:
        n += 1 + gap
        kept.append(n)
    return kept


@settings(max_examples=200)
@given(gaps, st.integers(0, 14 * MS), st.floats(-200e-6, 200e-6), st.randoms(use_true_random=False))
def test_random_losses_are_recovered_exactly_through_jitter_and_drift(gaps_between, pp_ns, drift, random):
    kept = kept_fields(gaps_between)
    kept += range(kept[-1] + 1, kept[-1] + 11)
    late_ns = {n: random.randint(0, pp_ns) + round(n * PERIOD_NS * drift) for n in kept}
    found = numbers_in_time(kept, late_ns)
    if any("uncertain" in (field.reason or "") for field in found):
        may_be_off = max(
            int(field.reason.split(";")[0].split()[-1]) for field in found if field.outcome is Outcome.DAMAGED
        )
        assert all(abs(field.n - n) <= may_be_off for field, n in zip(found, kept, strict=True))
        return
    assert [field.n for field in found] == kept
    missing = [n for field in found for entry in field.lost_before for n in range(entry.first_n, entry.end_n)]
    assert missing == sorted(set(range(kept[-1])) - set(kept))


@given(st.integers(0, 2**32 - 1), gaps, st.booleans(), st.randoms(use_true_random=False))
def test_losses_are_recovered_when_timestamps_fail_but_the_driver_counts(start, gaps_between, shared, random):
    kept = [*range(6), *(n + 6 for n in kept_fields(gaps_between))]
    counts = [(start + n // (1 + shared)) % 2**32 for n in kept]
    fields = [
        grab(n, sequence=count, time_ns=0 if n > 6 and random.random() < 0.3 else None)
        for n, count in zip(kept, counts, strict=True)
    ]
    assert [field.n for field in numbers(fields, info(counts_losses=True))] == kept


def test_an_hour_of_jittered_fields_ends_at_the_right_time():
    numbering = Numbering(info())
    for n in range(180_000):
        found = numbering.number(grab(n, late_ns=(n * 7919) % 8 * MS))
    assert found.n == 179_999
    assert abs(found.time_ns - START_NS - 179_999 * PERIOD_NS - 3.5 * MS) < MS


def test_what_the_buffers_could_not_hold_while_nobody_asked_is_lost_to_a_busy_computer():
    numbering = Numbering(info())
    for n in [*range(20), *range(30, 34)]:
        numbering.see(grab(n), now_ns=grab(n).time_ns + 2 * PERIOD_NS)
    numbering.stood_still(8 * PERIOD_NS)
    for n in [*range(34, 42), *range(45, 60)]:
        numbering.see(grab(n), now_ns=max(grab(n).time_ns, grab(45).time_ns) + 2 * PERIOD_NS)
    for n in range(61, 80):
        numbering.see(grab(n), now_ns=grab(n).time_ns + 2 * PERIOD_NS)
    losses = [entry for field in numbering.settled() for entry in lost(field.lost_before)]
    # Four fields in a row do not tell whether ten are missing before them or whether they have waited.
    first = (20, 10, "number uncertain by up to 10")
    assert losses == [first, (42, 3, "computer busy"), (60, 1, "time gap")]


def test_a_short_standstill_fills_no_buffers():
    numbering = Numbering(info())
    numbering.see(grab(0))
    numbering.stood_still(5 * PERIOD_NS)
    for n in range(2, 20):
        numbering.see(grab(n))
    assert lost(numbering.settled()[1].lost_before) == [(1, 1, "time gap")]


def test_a_single_field_between_two_interruptions_has_its_number():
    numbering = Numbering(info())
    for kept in (range(40), [48], range(57, 80)):
        for n in kept:
            numbering.see(grab(n), now_ns=grab(n).time_ns + 2 * PERIOD_NS)
        numbering.interrupt("another standard")
    found = numbering.settled()
    assert [field.n for field in found] == [*range(40), 48, *range(57, 80)]
    assert {field.outcome for field in found} == {Outcome.RECEIVED}


def test_a_stream_that_begins_on_an_overloaded_computer_is_right_when_the_load_is_gone():
    numbering = Numbering(info(counts_losses=False))
    kept = [n for n in range(400) if n not in (100, 101, 250, 251)]
    random = Random(0)
    for n in kept:
        waited_ns = random.randint(80, 120) * MS if n < 250 else 0
        numbering.see(grab(n, sequence=n), now_ns=grab(n).time_ns + 10 * MS + waited_ns)
    found = numbering.settled()
    uncertain = {field.n for field in found if "uncertain" in (field.reason or "")}
    wrong = [n for field, n in zip(found, kept, strict=True) if field.n != n and field.n not in uncertain]
    assert wrong == []
    assert len(uncertain) <= 20
    assert all(abs(field.time_ns - grab(field.n).time_ns) < PERIOD_NS for field in found)
