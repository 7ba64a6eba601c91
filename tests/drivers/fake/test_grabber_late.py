"""The driver when its host, its clock or its way of counting is not ideal."""

import numpy as np
import pytest

from drivers.fake.taking import MS, PERIOD, MakeGrabber, numbers, sequences, steps, taken
from grabberd.core.field import FieldOrder
from grabberd_fake.options import DriverOptions


@pytest.mark.parametrize(("order", "older"), [("top_first", 0), ("bottom_first", 1)])
def test_the_fields_of_a_frame_come_together(grabber: MakeGrabber, order: str, older: int) -> None:
    made, _ = grabber(driver={"order": order})
    made.restart()
    fields = taken(made, 3)
    first = numbers(fields)[0]
    assert first is not None
    assert numbers(fields) == list(range(first, first + 6))
    assert [item.field.parity for item in fields] == [older, 1 - older] * 3
    assert steps(fields) == [1] * 5
    assert made.restart().field_order is FieldOrder(order)


def test_a_frame_is_lost_with_either_of_its_fields(grabber: MakeGrabber) -> None:
    made, _ = grabber(driver={"order": "top_first"}, faults=[{"at_field": 3, "kind": "lose"}])
    assert numbers(taken(made, 2)) == [0, 1, 4, 5]


def test_stamps_of_the_arrival_are_as_late_as_the_reader(grabber: MakeGrabber) -> None:
    made, clock = grabber(driver={"stamps": "arrival"})
    taken(made, 1)
    clock.sleep_until_ns(clock.now_ns() + 3 * PERIOD)
    (late,) = taken(made, 1)
    assert late.time_ns == clock.now_ns() - DriverOptions().arrival_ns
    assert late.time_ns >= PERIOD + 2 * PERIOD, "it was exposed two fields before"


def test_stamps_are_late_by_a_jitter_and_some_by_much_more_but_never_in_another_order(
    grabber: MakeGrabber,
) -> None:
    made, _ = grabber(driver={"jitter_ms": 2.0, "late": 0.2, "late_ms": 50.0})
    fields = taken(made, 200)
    late_ns = np.array([item.time_ns - n * PERIOD for n, item in enumerate(fields)])
    assert late_ns.min() >= 0
    assert np.median(late_ns) < 20 * MS
    assert 10 < (late_ns > 2 * MS).sum() < 160
    assert min(np.diff([item.time_ns for item in fields])) > 0


def test_the_fields_of_a_frame_may_share_a_number_or_have_none(grabber: MakeGrabber) -> None:
    made, _ = grabber(driver={"counts": "frames"})
    assert sequences(taken(made, 5)) == [0, 0, 1, 1, 2]
    made, _ = grabber(driver={"counts": "nothing"})
    assert sequences(taken(made, 2)) == [None, None]
    assert not made.restart().counts_losses


def test_a_count_may_begin_anew_or_skip(grabber: MakeGrabber) -> None:
    made, _ = grabber(faults=[{"at_field": 2, "kind": "recount", "count": 0}])
    assert sequences(taken(made, 4)) == [0, 1, 0, 1]
    made, _ = grabber(faults=[{"at_field": 2, "kind": "recount", "count": 2**32 - 1}])
    assert sequences(taken(made, 4)) == [0, 1, 2**32 - 1, 0]


def test_a_bunch_comes_at_the_end_of_its_fault(grabber: MakeGrabber) -> None:
    made, clock = grabber(faults=[{"at_field": 3, "kind": "bunch", "duration_s": 0.1}])
    taken(made, 3)
    before_ns = clock.now_ns()
    bunch = taken(made, 5, timeout_s=0.5)
    assert numbers(bunch) == [3, 4, 5, 6, 7]
    assert clock.now_ns() - before_ns == 6 * PERIOD, "the first waits for the field after the fault"
    assert steps(bunch) == [1] * 4


def test_a_frozen_program_gets_what_its_buffers_hold(grabber: MakeGrabber) -> None:
    made, clock = grabber(buffers=4, faults=[{"at_field": 3, "kind": "freeze", "duration_s": 1.0}])
    fields = taken(made, 10)
    found = numbers(fields)
    assert len(found) == 10
    assert found[:3] == [0, 1, 2]
    held = [n for n in found if n is not None and n < 53]
    assert len(held) <= 3 + 4 + 1, "one more comes while the first is given back"
    assert max(found[-1:]) > 53  # type: ignore[type-var]
    assert clock.now_ns() > 53 * PERIOD


def test_a_busy_program_comes_late(grabber: MakeGrabber) -> None:
    made, clock = grabber(faults=[{"at_field": 0, "kind": "busy", "duration_s": 1.0, "mean_ms": 100}])
    begin_ns = clock.now_ns()
    taken(made, 5)
    assert clock.now_ns() - begin_ns > 10 * PERIOD


def test_a_clock_that_is_set_stays_so(grabber: MakeGrabber) -> None:
    made, _ = grabber(faults=[{"at_field": 2, "kind": "clock_step", "by_s": 1.0}])
    assert steps(taken(made, 5)) == [1, 51, 1, 1]


def test_a_camera_that_turns_goes_on_in_the_other_phase(grabber: MakeGrabber) -> None:
    made, _ = grabber(faults=[{"at_field": 3, "kind": "turn"}])
    fields = taken(made, 6)
    assert [item.field.parity for item in fields] == [0, 1, 0, 0, 1, 0]
    assert numbers(fields) == list(range(6))
