"""What every driver promises to the capture thread; the suite runs over all of them."""

from importlib.metadata import EntryPoint
from itertools import pairwise

import numpy as np
import pytest

from acquisition.streams import numbers
from contract.drivers import DRIVERS, FIELDS, RATES_HZ, copied
from grabberd.acquisition import FieldOrder, Outcome, Signal, StreamInfo
from grabberd.errors import DeviceError, DeviceRefused, StreamEnded
from grabberd.field import PROGRESSIVE


@pytest.fixture(params=DRIVERS)
def name(request):
    return request.param


@pytest.fixture
def grabber(name, tmp_path):
    made = DRIVERS[name](tmp_path)
    yield made
    made.close()


@pytest.fixture
def info(grabber):
    return grabber.open()


def take(grabber, count=FIELDS):
    taken = []
    while len(taken) < count:
        with grabber.dequeue(1.0) as fields:
            assert fields, "nothing came within a second"
            taken.extend(copied(field) for field in fields)
    return taken


def test_it_says_what_was_granted(info, name):
    assert isinstance(info, StreamInfo)
    assert info.driver in ("fake", "replay", "v4l2")
    assert info.rate_hz == RATES_HZ.get(name, 50.0)
    assert info.buffers >= 1


def test_its_fields_are_what_was_granted(grabber, info):
    for grabbed in take(grabber):
        luma = grabbed.field.luma
        assert luma.shape == (info.field_rows, info.columns)
        assert luma.dtype == np.uint8
        assert grabbed.damage is None


def test_its_rows_lie_on_the_frame_lines_of_their_parity(grabber, info):
    for field in (grabbed.field for grabbed in take(grabber)):
        assert (field.y0, field.y_step) in ((field.parity, 2), (0, 1))


def test_its_parities_alternate_from_the_older(grabber, info):
    parities = [grabbed.field.parity for grabbed in take(grabber)]
    if not info.field_order.has_parity:
        assert len(set(parities)) == 1
        assert (parities[0] == PROGRESSIVE) == (info.field_order is FieldOrder.PROGRESSIVE)
        return
    assert all(a != b for a, b in pairwise(parities))
    if info.field_order is FieldOrder.TOP_FIRST:
        assert parities[0] == 0
    if info.field_order is FieldOrder.BOTTOM_FIRST:
        assert parities[0] == 1


def test_its_times_are_whole_nanoseconds_one_period_apart(grabber, info):
    times = [grabbed.time_ns for grabbed in take(grabber)]
    assert all(isinstance(time_ns, int) for time_ns in times)
    assert np.abs(np.diff(times) - 1e9 / info.rate_hz).max() < 1_000


def test_its_count_grows_by_one_a_field_or_a_frame(grabber, info):
    counts = [grabbed.sequence for grabbed in take(grabber)]
    steps = np.diff(counts).tolist()
    frames_share_a_number = info.field_order is FieldOrder.ALTERNATE and 0 in steps
    assert steps == ([0, 1] * FIELDS)[: len(steps)] if frames_share_a_number else set(steps) == {1}


def test_its_fields_are_numbered_without_a_gap(grabber, info):
    found = numbers(take(grabber), info, grabber.signal())
    assert [field.n for field in found][:FIELDS] == list(range(FIELDS))
    assert {field.outcome for field in found} == {Outcome.RECEIVED}
    assert {field.reason for field in found} == {None}


def test_its_pictures_differ_from_field_to_field(grabber, info):
    pictures = [grabbed.field.luma.tobytes() for grabbed in take(grabber, 12)]
    assert len(set(pictures)) == len(pictures)


def fail_inside(grabber):
    with grabber.dequeue(1.0) as fields:
        assert fields
        raise ZeroDivisionError


def test_leaving_the_block_gives_the_buffer_back_also_after_an_error(grabber, info):
    for _ in range(min(3 * info.buffers, FIELDS // 2 - 1)):
        with pytest.raises(ZeroDivisionError):
            fail_inside(grabber)
    assert take(grabber, 1)


def test_its_signal_can_be_asked_at_any_time(grabber):
    assert grabber.signal() in tuple(Signal)
    info = grabber.open()
    take(grabber, 1)
    assert grabber.signal() is (Signal.PRESENT if info.tells_signal else Signal.UNKNOWN)


def test_nothing_comes_from_a_driver_that_is_not_open(grabber):
    with pytest.raises(DeviceError, match="not open") as caught, grabber.dequeue(0.0):
        pass
    assert caught.value.hint


def test_nothing_comes_from_a_driver_that_was_closed(grabber, info):
    take(grabber, 1)
    grabber.close()
    with pytest.raises(DeviceError), grabber.dequeue(0.0):
        pass


def test_it_can_be_closed_twice_and_without_having_been_open(grabber):
    grabber.close()
    grabber.open()
    grabber.close()
    grabber.close()


def test_it_can_be_restarted_while_it_is_open(grabber, info):
    take(grabber, 3)
    assert grabber.restart() == info
    assert len(take(grabber, 3)) >= 3


def test_what_is_not_open_cannot_be_restarted(grabber):
    with pytest.raises(DeviceError, match="not open") as caught:
        grabber.restart()
    assert caught.value.hint


def test_a_reset_leaves_it_closed_and_able_to_be_opened_or_says_why_it_cannot(grabber, info):
    grabber.close()
    if info.driver == "fake":
        grabber.reset()
    else:  # a recording, and a card that is not on USB
        with pytest.raises(DeviceRefused) as caught:
            grabber.reset()
        assert caught.value.hint
    assert grabber.open() == info
    take(grabber, 1)


def test_it_can_be_opened_again(grabber, info):
    take(grabber, 3)
    grabber.close()
    assert grabber.open() == info
    assert len(take(grabber, 3)) >= 3


def test_a_recording_ends_and_a_device_does_not(grabber, info):
    take(grabber, FIELDS)
    if info.driver != "replay":
        assert take(grabber, 1)
        return
    for _ in range(2):
        with pytest.raises(StreamEnded), grabber.dequeue(1.0):
            pass


@pytest.mark.parametrize(
    "name",
    [
        "fake",
        "capture_in_real_time",
        "single_fields",
        "v4l2_alternate_grey",
        "v4l2_woven_yuyv",
        "v4l2_camera_jpeg",
    ],
)
def test_nothing_comes_before_it_is_due(tmp_path, name):
    grabber = DRIVERS[name](tmp_path)
    grabber.open()
    take(grabber, 1)
    with grabber.dequeue(0.001) as fields:
        assert len(fields) == 0
    assert take(grabber, 1)


@pytest.mark.parametrize(
    "driver",
    ["grabberd_fake:FakeGrabber", "grabberd_replay:ReplayGrabber", "grabberd_v4l2:V4l2Grabber"],
)
def test_an_unknown_option_is_refused_by_name(driver):
    made = EntryPoint("it", driver, "grabberd.drivers").load()
    with pytest.raises((ValueError, TypeError), match="no_such_option"):
        made(no_such_option=1)
