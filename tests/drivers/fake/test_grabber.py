"""The driver as the capture thread sees it."""

from typing import Any

import numpy as np
import pytest

from drivers.fake.taking import MS, PERIOD, MakeGrabber, numbers, sequences, steps, taken
from grabberd.core.field import FieldOrder
from grabberd.errors import DeviceLost, DeviceRefused
from grabberd.instrument.acquisition.device import Signal
from grabberd_fake import FakeGrabber, JumpingClock, read_stamp


def test_it_says_what_it_grants(grabber: MakeGrabber) -> None:
    made, _ = grabber()
    made.close()
    info = made.open()
    assert (info.driver, info.columns, info.field_rows, info.rate_hz) == ("fake", 720, 288, 50.0)
    assert (info.field_order, info.live, info.counts_losses, info.tells_signal) == (
        FieldOrder.ALTERNATE,
        True,
        True,
        True,
    )
    assert info.buffers == made.options.buffers


def test_it_admits_that_its_sequence_cannot_be_trusted_when_the_script_loses_silently(
    grabber: MakeGrabber,
) -> None:
    made = FakeGrabber(clock=JumpingClock(), scene="blank", faults=[{"at_s": 1, "kind": "lose_silently"}])
    assert not made.open().counts_losses


def test_fields_come_one_by_one_top_and_bottom_every_20_ms(grabber: MakeGrabber) -> None:
    made, _ = grabber(start_ns=7 * MS)
    fields = taken(made, 6)
    assert [item.field.parity for item in fields] == [0, 1, 0, 1, 0, 1]
    assert [(item.field.y0, item.field.y_step) for item in fields[:2]] == [(0, 2), (1, 2)]
    assert steps(fields) == [1] * 5
    assert sequences(fields) == [0, 1, 2, 3, 4, 5]
    assert all(item.damage is None for item in fields)
    assert fields[0].field.luma.shape == (288, 720)


def test_every_field_carries_its_number_and_parity_in_its_picture(grabber: MakeGrabber) -> None:
    made, _ = grabber(start_ns=90 * MS)
    for item in taken(made, 4):
        assert read_stamp(item.field.luma) == (item.time_ns // PERIOD, item.field.parity)


def test_a_field_comes_half_a_period_after_the_middle_of_its_exposure(grabber: MakeGrabber) -> None:
    made, clock = grabber()
    with made.dequeue(1.0) as fields:
        assert clock.now_ns() - fields[0].time_ns == 10 * MS


def test_nothing_comes_before_its_time(grabber: MakeGrabber) -> None:
    made, clock = grabber()
    with made.dequeue(0.009) as fields:
        assert list(fields) == []
    assert clock.now_ns() == 9 * MS
    with made.dequeue(0.0) as fields:
        assert list(fields) == []


def test_after_reopening_it_begins_with_a_top_field_and_counts_from_zero(grabber: MakeGrabber) -> None:
    made, _ = grabber()
    taken(made, 3)
    made.close()
    made.open()
    again = taken(made, 2)
    assert [item.field.parity for item in again] == [0, 1]
    assert sequences(again) == [0, 1]
    assert numbers(again) == [4, 5]


def test_fields_wait_in_the_buffers_while_nobody_dequeues(grabber: MakeGrabber) -> None:
    made, clock = grabber(buffers=4)
    clock.sleep_until_ns(70 * MS)
    fields = taken(made, 4, timeout_s=0.0)
    assert numbers(fields) == [0, 1, 2, 3]
    assert clock.now_ns() == 70 * MS


def test_with_all_buffers_full_the_newest_are_lost_and_the_sequence_shows_it(grabber: MakeGrabber) -> None:
    made, clock = grabber(buffers=4)
    clock.sleep_until_ns(1_000 * MS)
    fields = taken(made, 6)
    assert numbers(fields) == [0, 1, 2, 3, 50, 51]
    assert sequences(fields) == [0, 1, 2, 3, 50, 51]


def test_a_buffer_in_hand_is_not_free(grabber: MakeGrabber) -> None:
    made, clock = grabber(buffers=2)
    with made.dequeue(1.0) as held:
        kept = held[0].field.luma.copy()
        clock.sleep_until_ns(1_000 * MS)
        with made.dequeue(1.0) as more:
            assert more[0].sequence == 1
            assert (held[0].field.luma == kept).all()
            with made.dequeue(0.05) as none:
                assert list(none) == []
    with made.dequeue(1.0) as fields:
        assert fields[0].sequence is not None
        assert fields[0].sequence > 50


def test_leaving_the_block_gives_the_buffer_back_for_others_to_overwrite(grabber: MakeGrabber) -> None:
    made, _ = grabber(buffers=2)
    with made.dequeue(1.0) as fields:
        view, copy = fields[0].field.luma, fields[0].field.luma.copy()
    taken(made, 2)
    assert (view != copy).any()


def test_an_error_inside_the_block_gives_the_buffer_back_too(grabber: MakeGrabber) -> None:
    made, _ = grabber(buffers=2)
    for _ in range(5):
        with pytest.raises(KeyError), made.dequeue(1.0):
            raise KeyError
    assert len(taken(made, 3)) == 3


def test_closing_twice_or_without_opening_is_safe() -> None:
    made = FakeGrabber(clock=JumpingClock(), scene="blank")
    made.close()
    made.open()
    made.close()
    made.close()
    assert made.open().driver == "fake"


def test_closing_inside_the_block_is_safe(grabber: MakeGrabber) -> None:
    made, _ = grabber()
    with made.dequeue(1.0):
        made.close()
    assert made.open().driver == "fake"


def test_nothing_can_be_dequeued_before_opening_and_after_closing(grabber: MakeGrabber) -> None:
    made, _ = grabber()
    made.close()
    for closed in (made, FakeGrabber(scene="blank")):
        with pytest.raises(DeviceLost, match="not open"), closed.dequeue(0.1):
            pass
        assert closed.signal() == Signal.UNKNOWN


def test_it_cannot_be_opened_twice(grabber: MakeGrabber) -> None:
    made, _ = grabber()
    with pytest.raises(DeviceRefused, match="open already"):
        made.open()


def test_at_free_pace_fields_come_as_fast_as_they_are_read_and_none_is_lost() -> None:
    clock = JumpingClock(1_000 * MS)
    made = FakeGrabber(clock=clock, scene="blank", pace="free", buffers=2)
    made.open()
    fields = taken(made, 40)
    assert fields[0].time_ns == 1_000 * MS
    assert steps(fields) == [1] * 39
    assert sequences(fields) == list(range(40))
    assert clock.now_ns() == 1_000 * MS


def test_at_free_pace_a_slow_reader_loses_nothing() -> None:
    clock = JumpingClock()
    made = FakeGrabber(clock=clock, scene="blank", pace="free")
    made.open()
    first = taken(made, 1)
    clock.sleep_until_ns(60_000 * MS)
    assert steps(first + taken(made, 3)) == [1, 1, 1]


def test_the_same_options_and_clock_give_the_same_pictures() -> None:
    def pictures(**options: Any) -> list[np.ndarray]:
        made = FakeGrabber(clock=JumpingClock(), pace="free", **options)
        made.open()
        return [item.field.luma for item in taken(made, 5)]

    assert all((a == b).all() for a, b in zip(pictures(), pictures(), strict=True))
    assert all((a != b).any() for a, b in zip(pictures(), pictures(seed=1), strict=True))


def test_with_a_real_clock_it_keeps_its_pace() -> None:
    made = FakeGrabber(scene="blank")
    made.open()
    fields = taken(made, 3, timeout_s=1.0)
    assert steps(fields) == [1, 1]
    made.close()


def test_it_says_whether_a_field_was_waiting_when_it_was_asked(grabber: MakeGrabber) -> None:
    made, clock = grabber()
    found = []
    for late_ns in (0, 0, 3 * PERIOD, 0, 0, 0):
        clock.sleep_until_ns(clock.now_ns() + late_ns)
        with made.dequeue(1.0) as fields:
            assert fields
        found.append(made.found_empty)
    assert found == [True, True, False, False, False, True]
