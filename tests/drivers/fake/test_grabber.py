"""The driver as the capture thread sees it."""

from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from grabberd.acquisition.device import FieldOrder, GrabbedField, Signal
from grabberd.errors import DeviceAbsent, DeviceLost, DeviceRefused, StreamFailed
from grabberd_fake import FakeGrabber, JumpingClock, read_stamp

MakeGrabber = Callable[..., tuple[FakeGrabber, JumpingClock]]
MS = 1_000_000
PERIOD = 20 * MS


def taken(grabber: FakeGrabber, count: int, timeout_s: float = 0.1) -> list[GrabbedField]:
    """Fields as they come, each with a copy of its picture; empty dequeues are passed over."""

    def fields() -> Iterator[GrabbedField]:
        for _ in range(count):
            with grabber.dequeue(timeout_s) as got:
                for item in got:
                    picture = item.field.luma.copy()
                    yield item._replace(field=type(item.field).intact(picture, item.field.parity))

    return list(fields())


def sequences(fields: list[GrabbedField]) -> list[int | None]:
    return [item.sequence for item in fields]


def steps(fields: list[GrabbedField]) -> list[int]:
    """How many nominal steps each field comes after the one before."""
    return [(later.time_ns - earlier.time_ns) // PERIOD for earlier, later in pairwise(fields)]


def numbers(fields: list[GrabbedField]) -> list[int | None]:
    stamps = [read_stamp(item.field.luma) for item in fields]
    return [None if stamp is None else stamp.number for stamp in stamps]


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


def test_lost_fields_leave_a_gap_in_sequence_and_time(grabber: MakeGrabber) -> None:
    made, _ = grabber(faults=[{"at_field": 2, "kind": "lose", "count": 3}])
    fields = taken(made, 4)
    assert sequences(fields) == [0, 1, 5, 6]
    assert steps(fields) == [1, 4, 1]
    assert numbers(fields) == [0, 1, 5, 6]


def test_silently_lost_fields_leave_a_gap_in_time_only(grabber: MakeGrabber) -> None:
    made, _ = grabber(faults=[{"at_field": 2, "kind": "lose_silently", "count": 3}])
    fields = taken(made, 4)
    assert sequences(fields) == [0, 1, 2, 3]
    assert steps(fields) == [1, 4, 1]


def test_a_repeated_field_is_the_one_before_with_a_new_time(grabber: MakeGrabber) -> None:
    made, _ = grabber(faults=[{"at_field": 3, "kind": "repeat", "count": 2}])
    fields = taken(made, 6)
    assert numbers(fields) == [0, 1, 2, 2, 2, 5]
    assert (fields[2].field.luma == fields[4].field.luma).all()
    assert steps(fields) == [1] * 5
    assert [item.field.parity for item in fields] == [0, 1, 0, 1, 0, 1]
    assert sequences(fields) == list(range(6))


def test_a_damaged_field_is_flagged_and_half_stale(grabber: MakeGrabber) -> None:
    made, _ = grabber(faults=[{"at_field": 1, "kind": "damage", "row": 100}])
    before, damaged, after = taken(made, 3)
    assert (before.damage, after.damage) == (None, None)
    assert damaged.damage
    assert (damaged.field.luma[100:] == before.field.luma[100:]).all()
    assert (damaged.field.luma[:100] != before.field.luma[:100]).any()


def test_a_short_field_keeps_stale_rows_and_says_nothing(grabber: MakeGrabber) -> None:
    made, _ = grabber(faults=[{"at_field": 1, "kind": "short", "row": 200}])
    before, short = taken(made, 2)
    assert short.damage is None
    assert (short.field.luma[200:] == before.field.luma[200:]).all()
    assert (short.field.luma[199] != before.field.luma[199]).any()


def test_shifted_lines_are_shifted_from_their_row_on_and_nothing_says_so(grabber: MakeGrabber) -> None:
    made, _ = grabber(faults=[{"at_field": 1, "kind": "shift", "row": 50, "shift_px": -30}])
    straight, _ = grabber()
    shifted, wanted = taken(made, 2)[1], taken(straight, 2)[1]
    assert shifted.damage is None
    assert (shifted.field.luma[:50] == wanted.field.luma[:50]).all()
    assert (shifted.field.luma[50:] == np.roll(wanted.field.luma[50:], -30)).all()


def test_in_a_stall_nothing_comes_and_nothing_is_wrong(grabber: MakeGrabber) -> None:
    made, clock = grabber(faults=[{"at_field": 2, "kind": "stall", "duration_s": 1.0}])
    taken(made, 2)
    for _ in range(4):
        with made.dequeue(0.2) as fields:
            assert list(fields) == []
    assert made.signal() == Signal.PRESENT
    resumed = taken(made, 5)
    assert numbers(resumed)[0] == 52
    assert sequences(resumed)[0] == 2
    assert clock.now_ns() >= 1_050 * MS


def test_unplugged_it_is_lost_then_absent_then_there_again(grabber: MakeGrabber) -> None:
    made, clock = grabber(faults=[{"at_s": 0.2, "kind": "unplug", "back_after_s": 1.0}])
    assert len(taken(made, 10)) == 10
    with pytest.raises(DeviceLost, match="unplugged"), made.dequeue(5.0):
        pass
    assert clock.now_ns() == 210 * MS
    made.close()
    with pytest.raises(DeviceAbsent, match="unplugged"):
        made.open()
    made.close()
    clock.sleep_until_ns(1_209 * MS)
    with pytest.raises(DeviceAbsent):
        made.open()
    clock.sleep_until_ns(1_210 * MS)
    made.open()
    fields = taken(made, 3)
    assert numbers(fields) == [62, 63, 64]
    assert sequences(fields) == [0, 1, 2]


def test_unplugged_while_fields_wait_they_are_gone_with_it(grabber: MakeGrabber) -> None:
    made, clock = grabber(faults=[{"at_s": 0.2, "kind": "unplug"}])
    clock.sleep_until_ns(250 * MS)
    with pytest.raises(DeviceLost), made.dequeue(1.0):
        pass


def test_it_may_be_unplugged_from_the_start() -> None:
    clock = JumpingClock()
    made = FakeGrabber(clock=clock, scene="blank", faults=[{"at_s": 0, "kind": "unplug", "back_after_s": 3}])
    with pytest.raises(DeviceAbsent):
        made.open()
    clock.sleep_until_ns(3_010 * MS)
    assert made.open().driver == "fake"


def test_at_free_pace_an_unplugged_grabber_is_back_when_it_is_tried_again() -> None:
    made = FakeGrabber(
        clock=JumpingClock(), scene="blank", pace="free", faults=[{"at_field": 3, "kind": "unplug"}]
    )
    made.open()
    taken(made, 3)
    with pytest.raises(DeviceLost), made.dequeue(1.0):
        pass
    made.close()
    with pytest.raises(DeviceAbsent):
        made.open()
    made.open()
    assert numbers(taken(made, 1)) == [54]


@pytest.mark.parametrize(("picture", "grey"), [("blue", {41}), ("black", {16}), ("noise", set(range(256)))])
def test_without_signal_pictures_come_on_and_the_grabber_says_so(
    grabber: MakeGrabber, picture: str, grey: set[int]
) -> None:
    made, _ = grabber(faults=[{"at_field": 1, "kind": "no_signal", "duration_s": 0.04, "picture": picture}])
    told = []
    fields = []
    for _ in range(4):
        fields += taken(made, 1)
        told.append(made.signal())
    assert told == [Signal.PRESENT, Signal.ABSENT, Signal.ABSENT, Signal.PRESENT]
    assert numbers(fields) == [0, None, None, 3]
    assert set(fields[1].field.luma.ravel().tolist()) == grey
    assert steps(fields) == [1, 1, 1]
    assert sequences(fields) == [0, 1, 2, 3]


def test_the_script_runs_once_however_often_the_grabber_is_opened(grabber: MakeGrabber) -> None:
    made, _ = grabber(faults=[{"at_field": 4, "kind": "lose"}])
    taken(made, 1)
    made.close()
    made.open()
    assert numbers(taken(made, 4)) == [2, 3, 5, 6]
    made.close()
    made.open()
    assert steps(taken(made, 8)) == [1] * 7


def test_a_stream_that_failed_streams_again_after_the_step_that_helps(grabber: MakeGrabber) -> None:
    made, _ = grabber(faults=[{"at_field": 4, "kind": "fail", "until": "reopen"}])
    assert len(taken(made, 4)) == 4
    with pytest.raises(StreamFailed, match="has failed"), made.dequeue(1.0):
        pass
    with pytest.raises(StreamFailed), made.dequeue(1.0):
        pass
    with pytest.raises(StreamFailed):
        made.restart()
    made.close()
    made.open()
    assert len(taken(made, 4)) == 4


def test_one_that_only_a_reset_helps_opens_but_streams_not_before_it(grabber: MakeGrabber) -> None:
    made, _ = grabber(faults=[{"at_field": 2, "kind": "stall", "until": "reset"}])
    taken(made, 2)
    made.restart()
    assert taken(made, 3) == []
    made.close()
    made.open()
    assert taken(made, 3) == []
    made.close()
    made.reset()
    made.open()
    assert len(taken(made, 3)) == 3


@pytest.mark.parametrize(("why", "said"), [("busy", "another program"), ("rights", "may not be opened")])
def test_a_refused_grabber_opens_when_the_time_is_over(why: str, said: str) -> None:
    clock = JumpingClock()
    made = FakeGrabber(
        clock=clock, scene="blank", faults=[{"at_s": 0, "kind": "refuse", "duration_s": 3, "why": why}]
    )
    with pytest.raises(DeviceRefused, match=said):
        made.open()
    clock.sleep_until_ns(3_010 * MS)
    assert made.open().driver == "fake"


def test_a_stream_that_runs_is_not_refused(grabber: MakeGrabber) -> None:
    made, _ = grabber(faults=[{"at_field": 2, "kind": "refuse"}])
    assert len(taken(made, 10)) == 10


def test_another_standard_ends_the_stream_and_opened_again_gives_other_pictures(grabber: MakeGrabber) -> None:
    made, clock = grabber(faults=[{"at_field": 4, "kind": "standard", "duration_s": 1.0}])
    taken(made, 4)
    with pytest.raises(StreamFailed, match="standard"), made.dequeue(1.0):
        pass
    with pytest.raises(DeviceRefused, match="standard"):
        made.restart()
    made.close()
    info = made.open()
    assert (info.standard, info.field_rows) == ("NTSC", 240)
    assert taken(made, 1)[0].field.luma.shape == (240, 720)
    clock.sleep_until_ns(1_200 * MS)
    with pytest.raises(StreamFailed), made.dequeue(1.0):
        pass
    made.close()
    assert (made.open().standard, taken(made, 1)[0].field.luma.shape) == ("PAL", (288, 720))
