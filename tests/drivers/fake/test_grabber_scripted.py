"""The driver as the capture thread sees it, while the script makes it fail."""

from pathlib import Path

import numpy as np
import pytest

from drivers.fake.taking import MS, PERIOD, MakeGrabber, numbers, sequences, steps, taken
from grabberd.errors import DeviceAbsent, DeviceLost, DeviceRefused, StreamFailed
from grabberd.instrument.acquisition.device import Signal
from grabberd_fake import FakeGrabber, JumpingClock


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


@pytest.mark.parametrize(
    ("why", "said"),
    [("busy", "another program"), ("rights", "may not be opened"), ("bandwidth", "has no room")],
)
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


@pytest.mark.parametrize(
    ("says", "said"),
    [("zero", [0, 0]), ("backward", [20 * MS, 0]), ("another_clock", [3_600_060 * MS, 3_600_080 * MS])],
)
def test_wrong_times_are_those_of_the_script_alone(grabber: MakeGrabber, says: str, said: list[int]) -> None:
    fault = {"at_field": 3, "kind": "timestamp", "says": says, "duration_s": 0.04}
    made, _ = grabber(faults=[fault])
    fields = taken(made, 6)
    assert [item.time_ns for item in fields] == [0, PERIOD, 2 * PERIOD, *said, 5 * PERIOD]
    assert numbers(fields) == sequences(fields) == list(range(6))


def test_the_sequence_passes_its_end_with_the_field_of_the_script(grabber: MakeGrabber) -> None:
    made, _ = grabber(faults=[{"at_field": 2, "kind": "wrap"}])
    assert sequences(taken(made, 4)) == [2**32 - 2, 2**32 - 1, 0, 1]
    made.restart()
    assert sequences(taken(made, 4)) == [2**32 - 2, 2**32 - 1, 0, 1]


def test_in_a_storm_nobody_waits_and_nothing_comes_but_fields_do_wait(grabber: MakeGrabber) -> None:
    made, clock = grabber(faults=[{"at_field": 2, "kind": "storm", "duration_s": 0.1}])
    taken(made, 2)
    clock.sleep_until_ns(50 * MS)
    with made.dequeue(5.0) as fields:
        assert list(fields) == []
    assert clock.now_ns() == 50 * MS
    clock.sleep_until_ns(150 * MS)
    assert numbers(taken(made, 6, timeout_s=0.0)) == [2, 3, 4, 5, 6, 7]


def test_at_free_pace_a_storm_passes_by_itself() -> None:
    fault = {"at_field": 2, "kind": "storm", "duration_s": 0.1}
    made = FakeGrabber(clock=JumpingClock(), scene="blank", pace="free", faults=[fault])
    made.open()
    assert numbers(taken(made, 10)) == [0, 1, 2, 3, 4, 5, 6, 7, 8]


def test_at_a_dead_input_nothing_comes_and_the_signal_is_said_to_be_absent(grabber: MakeGrabber) -> None:
    made, clock = grabber(faults=[{"at_field": 2, "kind": "dead_input", "duration_s": 0.1}])
    taken(made, 2)
    clock.sleep_until_ns(60 * MS)
    assert made.signal() == Signal.ABSENT
    with made.dequeue(0.02) as fields:
        assert list(fields) == []
    assert numbers(taken(made, 2, timeout_s=1.0)) == [7, 8]
    assert made.signal() == Signal.PRESENT


def test_it_says_under_which_node_it_is_there(grabber: MakeGrabber) -> None:
    fault = {"at_field": 2, "kind": "unplug", "back_after_s": 0.1, "elsewhere": True}
    made, clock = grabber(faults=[fault])
    made.close()
    clock.sleep_until_ns(200 * MS)
    assert made.open().details["node"] == "simulated1"


def test_a_script_with_a_cue_begins_with_the_field_after_it(grabber: MakeGrabber, tmp_path: Path) -> None:
    faults = [{"at_field": 1, "kind": "lose_silently", "count": 2}, {"at_field": 5, "kind": "unplug"}]
    made, _ = grabber(faults=faults, cue=str(tmp_path / "cue"))
    assert numbers(taken(made, 12)) == list(range(12))
    (tmp_path / "cue").touch()
    after = taken(made, 3)
    assert numbers(after) == [12, 15, 16]
    assert sequences(after) == [12, 13, 14]
    with pytest.raises(DeviceLost), made.dequeue(1.0):
        pass
