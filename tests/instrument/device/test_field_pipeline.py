"""From a grabbed field to a slot: lines, bits, threshold, content."""

from dataclasses import replace

import numpy as np
import pytest

from grabberd.config import DeviceConfig, RingConfig, ThresholdConfig
from grabberd.core.field import PROGRESSIVE, Field, FieldOrder, double_lines
from grabberd.core.ledger import Outcome, Slot
from grabberd.errors import InputError
from grabberd.instrument.acquisition import GrabbedField, Signal, StreamInfo
from grabberd.instrument.device.field_pipeline import FieldPipeline
from grabberd.instrument.device.threshold_keeper import UNDECIDED_THRESHOLD
from grabberd_fake import FakeGrabber, JumpingClock

INFO = StreamInfo("test", "card", "PAL", 64, 32, 50.0, FieldOrder.ALTERNATE, "GREY", 8, True, True, True, 0)


def pipeline(*, bits: int = 1, threshold: int | None = 60) -> FieldPipeline:
    kind = "automatic" if threshold is None else "fixed"
    one = FieldPipeline(
        DeviceConfig(
            driver="test",
            ring=RingConfig(bits=bits),  # type: ignore[arg-type]
            threshold=ThresholdConfig(kind=kind, value=threshold),  # type: ignore[arg-type]
        )
    )
    one.opened(INFO, now_ns(0))
    return one


def grabbed(n: int, seed: int | None = None, bright: int = 200) -> GrabbedField:
    luma = np.random.default_rng(n if seed is None else seed).integers(10, 30, (32, 64)).astype(np.uint8)
    luma[10:16, 20:30] = bright
    return GrabbedField(Field.intact(luma, n % 2), 1_000_000_000 + n * 20_000_000, n, None)


def now_ns(n: int) -> int:
    return 1_010_000_000 + n * 20_000_000


def take(one: FieldPipeline, grabbed: GrabbedField, signal: Signal, now_ns: int) -> Slot:
    """The field's slot, without waiting for later ones to settle its number."""
    return [*one.take(grabbed, signal, now_ns), *one.settle()][-1]


def test_one_bit_is_doubled_and_grey_is_left_intact() -> None:
    assert take(pipeline(), grabbed(0), Signal.PRESENT, now_ns(0)).numbered.packed.y_step == 1  # type: ignore[union-attr]
    grey = take(pipeline(bits=8), grabbed(0), Signal.PRESENT, now_ns(0)).numbered
    assert grey
    assert grey.packed.y_step == 2
    assert np.array_equal(grey.packed.data[0], grabbed(0).field.luma)


def test_configured_lines_are_those_of_the_configured_bits_alone() -> None:
    ring = RingConfig(bits=1, lines="field")
    one = FieldPipeline(DeviceConfig(driver="test", ring=ring))
    asked = [(None, None), (1, None), (8, None), (1, "doubled"), (8, "doubled")]
    configured = [one.configure_ring(bits, lines) for bits, lines in asked]
    assert [(ring.bits, ring.lines) for ring in configured] == [
        (1, "field"),
        (1, "field"),
        (8, "field"),
        (1, "doubled"),
        (8, "doubled"),
    ]
    doubled = FieldPipeline(DeviceConfig(driver="test", ring=RingConfig(bits=8, lines="doubled")))
    assert doubled.configure_ring(8, None).lines == "doubled"
    assert doubled.configure_ring(6, None).lines == "field"


def test_missing_lines_are_interpolated_as_configured() -> None:
    config = DeviceConfig(
        driver="test",
        ring=RingConfig(lines="doubled", bits=8, interpolation="kernel3x3"),
        threshold=ThresholdConfig(kind="fixed", value=60),
    )
    one = FieldPipeline(config)
    one.opened(INFO)
    numbered = take(one, grabbed(0), Signal.PRESENT, now_ns(0)).numbered
    assert numbered
    wanted = double_lines(grabbed(0).field, "kernel3x3").luma
    assert np.array_equal(numbered.packed.data[0], wanted)
    assert not np.array_equal(wanted, double_lines(grabbed(0).field).luma)


def test_the_threshold_in_force_is_kept_with_every_field() -> None:
    numbered = take(pipeline(threshold=77), grabbed(0), Signal.PRESENT, now_ns(0)).numbered
    assert numbered
    assert numbered.packed.threshold == 77


def test_a_recordings_first_field_is_packed_with_its_own_threshold() -> None:
    one = pipeline(threshold=None)
    one.opened(replace(INFO, driver="recording", live=False))
    numbered = take(one, grabbed(0, bright=100), Signal.PRESENT, now_ns(0)).numbered
    assert numbered
    assert 20 < numbered.packed.threshold < 100
    assert numbered.packed.threshold == one.thresholds.in_force.level


def test_a_picture_without_signal_is_not_chosen_by() -> None:
    one = pipeline(threshold=None)
    one.opened(replace(INFO, driver="recording", live=False))
    take(one, grabbed(0, bright=100), Signal.ABSENT, now_ns(0))
    assert one.thresholds.in_force.level == UNDECIDED_THRESHOLD


def test_without_signal_the_picture_is_kept_and_marked() -> None:
    slot = take(pipeline(), grabbed(0), Signal.ABSENT, now_ns(0))
    assert (slot.outcome, slot.reason) == (Outcome.NO_SIGNAL, "no signal")
    assert slot.numbered
    assert slot.numbered.packed.rows


def test_an_old_picture_delivered_again_is_damaged() -> None:
    one = pipeline()
    take(one, grabbed(0, seed=5), Signal.PRESENT, now_ns(0))
    take(one, grabbed(1, seed=6), Signal.PRESENT, now_ns(1))
    again = take(one, grabbed(2, seed=5), Signal.PRESENT, now_ns(2))
    assert (again.outcome, again.reason) == (Outcome.DAMAGED, "repeated")
    assert again.numbered is not None, "it is kept all the same"


@pytest.mark.parametrize("stamped", [True, False])
def test_a_buffer_that_is_handed_over_twice_is_no_field(stamped: bool) -> None:
    one, late_ns = pipeline(), 0 if stamped else 3_000_000
    for n in (0, 1, 2):
        take(one, grabbed(n), Signal.PRESENT, now_ns(n))
        again = grabbed(n)._replace(time_ns=grabbed(n).time_ns + late_ns)
        assert one.take(again, Signal.PRESENT, now_ns(n) + late_ns) == []
    after = take(one, grabbed(3), Signal.PRESENT, now_ns(3))
    assert (after.n, after.outcome, after.rebases) == (3, Outcome.RECEIVED, ())


@pytest.mark.parametrize("was_in_time", [True, False])
def test_an_old_picture_that_comes_at_once_is_no_field_unless_it_may_have_waited(was_in_time: bool) -> None:
    """Of a driver that neither stamps nor counts."""
    one = pipeline()
    one.opened(replace(INFO, counts_losses=False), now_ns(0))
    for n in range(4):
        one.take(grabbed(n)._replace(sequence=0), Signal.PRESENT, now_ns(n), in_time=was_in_time)
    again = grabbed(3)._replace(sequence=0, time_ns=grabbed(3).time_ns + 1_000_000)
    slots = [*one.take(again, Signal.PRESENT, now_ns(3) + 1_000_000, in_time=False), *one.settle()]
    assert [slot.n for slot in slots if slot.reason == "repeated"] == ([] if was_in_time else [4])


def test_an_interruptions_reason_is_that_of_the_fields_it_cost() -> None:
    one = pipeline()
    take(one, grabbed(0), Signal.PRESENT, now_ns(0))
    one.interrupted("unplugged")
    one.opened(INFO)
    slot = take(one, grabbed(100), Signal.PRESENT, now_ns(100))
    assert slot.n == 100
    assert [(entry.count, entry.reason) for entry in slot.lost_before] == [(99, "unplugged")]


def test_a_field_in_doubt_is_not_in_the_ring_before_its_number_is_settled() -> None:
    one = pipeline()
    uncounted = [grabbed(n)._replace(sequence=None) for n in range(20)]
    for n in range(10):
        assert len(one.take(uncounted[n], Signal.PRESENT, now_ns(n))) == 1
    assert one.take(uncounted[13], Signal.PRESENT, now_ns(13)) == []
    assert one.ring.newest.n == 9  # type: ignore[union-attr]
    later = [slot for n in range(14, 20) for slot in one.take(uncounted[n], Signal.PRESENT, now_ns(n))]
    assert [slot.n for slot in later] == list(range(13, 20))
    assert [(entry.first_n, entry.count) for entry in later[0].lost_before] == [(10, 3)]


@pytest.mark.parametrize(("bits", "lines"), [(8, None), (1, "field")])
def test_arming_for_other_bits_or_lines_exchanges_the_ring(bits: int, lines: str | None) -> None:
    one = pipeline()
    reader = one.ring.reader()
    before = one.ring
    configured = one.configure_ring(bits, lines)
    assert configured is one.ring is not before
    assert reader.ended
    assert one.configure_ring(bits, lines) is configured, "it is configured for them already"


def test_a_progressive_picture_has_all_its_lines_so_none_are_doubled() -> None:
    one = pipeline()
    one.opened(replace(INFO, field_order=FieldOrder.PROGRESSIVE, standard=""), now_ns(0))
    whole = [grabbed(n)._replace(field=Field.progressive(grabbed(n).field.luma)) for n in range(3)]
    slots = [take(one, picture, Signal.PRESENT, now_ns(n)) for n, picture in enumerate(whole)]
    kept = [slot.numbered.packed for slot in slots if slot.numbered]
    assert [(packed.rows, packed.y_step, packed.parity) for packed in kept] == [(32, 1, PROGRESSIVE)] * 3
    assert [slot.n for slot in slots] == [0, 1, 2]
    assert (one.ring.bits, one.ring.lines) == (1, "field")
    assert one.configure_ring(1, None) is one.ring
    with pytest.raises(InputError, match="lacks no lines"):
        one.configure_ring(1, "doubled")


@pytest.mark.parametrize(
    ("rate_hz", "slots"), [(25.0, 32), (50.0, 32), (59.94, 38), (100.0, 64), (120.0, 77)]
)
def test_the_ring_lasts_for_as_long_at_any_rate_but_has_32_slots_at_least(rate_hz: float, slots: int) -> None:
    one = FieldPipeline(DeviceConfig(driver="test"))
    one.opened(replace(INFO, rate_hz=rate_hz), now_ns(0))
    assert one.ring.slots == slots
    configured = FieldPipeline(DeviceConfig(driver="test", ring=RingConfig(slots=20)))
    configured.opened(replace(INFO, rate_hz=rate_hz), now_ns(0))
    assert configured.ring.slots == 20


def liner(count: int, **spoiled: object) -> list[GrabbedField]:
    """Fields of the simulated camera; `spoiled` is a fault of field 8."""
    grabber = FakeGrabber(pace="free", clock=JumpingClock(1_000_000_000), faults=[{"at_field": 8, **spoiled}])
    grabber.open()
    fields = []
    while len(fields) < count:
        with grabber.dequeue(1.0) as some:
            fields += [one._replace(field=replace(one.field, luma=one.field.luma.copy())) for one in some]
    return fields


def test_what_the_picture_tells_of_damage_is_the_reason() -> None:
    one = pipeline()
    slots = [take(one, field, Signal.UNKNOWN, field.time_ns) for field in liner(10, kind="shift")]
    assert [slot.outcome for slot in slots] == [Outcome.RECEIVED] * 8 + [Outcome.DAMAGED, Outcome.RECEIVED]
    assert slots[8].reason
    assert slots[8].reason.startswith("shifted by 40 px from line 28")


@pytest.mark.parametrize(
    ("picture", "words"),
    [
        ("blue", "a flat picture"),
        ("black", "a flat picture"),
        ("noise", "snow"),
        ("bars", "bars"),
    ],
)
def test_no_signal_is_seen_in_the_picture_whatever_the_driver_says(picture: str, words: str) -> None:
    one = pipeline()
    fields = liner(20, kind="no_signal", picture=picture, duration_s=0.2)
    slots = [take(one, field, Signal.PRESENT, field.time_ns) for field in fields[:18]]
    assert [slot.outcome for slot in slots[8:]] == [Outcome.NO_SIGNAL] * 10
    assert {slot.reason for slot in slots[8:]} == {f"no signal: {words}"}
    assert all(slot.numbered is not None for slot in slots[8:])
    assert one.no_picture == f"no signal: {words}"
    take(one, fields[18], Signal.PRESENT, fields[18].time_ns)
    assert one.no_picture is None


def test_a_recording_is_not_looked_at() -> None:
    one = pipeline()
    one.opened(replace(INFO, driver="recording", live=False))
    outcomes = [take(one, grabbed(n, seed=5), Signal.UNKNOWN, now_ns(n)).outcome for n in range(4)]
    assert outcomes == [Outcome.RECEIVED] * 4
    assert one.no_picture is None
