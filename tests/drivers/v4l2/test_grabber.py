"""A grabber is opened, restarted, reset and closed, and leaves nothing behind whatever happens."""

import contextlib
import errno

import pytest

from drivers.v4l2.bench import Bench, card_with, dongle
from grabberd.errors import Cause, DeviceAbsent, DeviceError, DeviceLost, DeviceRefused, StreamFailed
from grabberd.instrument.acquisition import GRABBERS, Signal
from grabberd_v4l2 import V4l2Grabber
from grabberd_v4l2.abi import Arrangement


@pytest.fixture
def bench(tmp_path):
    return Bench(tmp_path)


def calls_of_an_open(folder):
    made = Bench(folder, buffers=8)
    made.grabber.open()
    return list(made.kernel.calls)


def refused_at(folder, number, answer):
    """A computer whose call of that number is refused."""
    made = Bench(folder, buffers=8)
    made.kernel.refuse_call, made.kernel.refuse_with = number, answer
    return made


def test_it_is_found_by_name():
    assert isinstance(GRABBERS.create("v4l2", {"device": "/dev/video0"}), V4l2Grabber)


def test_nothing_is_opened_before_it_is_asked(bench):
    assert bench.kernel.calls == []


@pytest.mark.parametrize("answer", [errno.EIO, errno.EINVAL, errno.ENODEV, errno.ENOSPC])
def test_whichever_call_is_refused_nothing_is_left_behind(tmp_path, answer):
    for number, name in enumerate(calls_of_an_open(tmp_path / "whole"), 1):
        made = refused_at(tmp_path / str(number), number, answer)
        with contextlib.suppress(DeviceError):
            made.grabber.open()
            made.grabber.close()
        assert made.nothing_is_left_behind(), name


def test_whichever_call_is_refused_it_can_be_opened_the_next_time(tmp_path):
    for number in range(1, len(calls_of_an_open(tmp_path / "whole")) + 1):
        made = refused_at(tmp_path / str(number), number, errno.EBUSY)
        with contextlib.suppress(DeviceError):
            made.grabber.open()
            made.grabber.close()
        made.grabber.open()
        with made.grabber.dequeue(1.0) as fields:
            assert fields


def test_a_node_that_vanishes_while_it_is_opened_is_absent(tmp_path):
    for number in range(1, 10):
        made = refused_at(tmp_path / str(number), number, errno.ENODEV)
        with pytest.raises(DeviceAbsent):
            made.grabber.open()


def test_a_device_that_does_not_answer_asks_for_the_next_step_of_recovery(bench):
    bench.card.answers["STREAMON"].append(errno.EIO)
    with pytest.raises(StreamFailed, match="does not respond"):
        bench.grabber.open()
    assert bench.nothing_is_left_behind()


def test_a_driver_that_does_not_recover_from_a_failed_start_is_not_started_again_before_a_replug(tmp_path):
    bench = Bench(tmp_path, dongle(driver="usbtv"))
    bench.card.answers["STREAMON"].append(errno.ENOSPC)
    with pytest.raises(DeviceRefused, match="no bandwidth"):
        bench.grabber.open()
    bench.grabber.close()
    assert bench.card.queue.memories, "the driver may still use its buffers"
    started = bench.kernel.calls.count("STREAMON")
    for _ in range(3):
        with pytest.raises(DeviceRefused, match="must not be started again") as caught:
            bench.grabber.open()
        assert "unplug it" in caught.value.hint
    assert bench.kernel.calls.count("STREAMON") == started
    bench.unplug()
    with pytest.raises(DeviceAbsent):
        bench.grabber.open()
    bench.plug()
    bench.grabber.open()
    bench.grabber.close()
    assert bench.nothing_is_left_behind()


def test_a_bus_without_bandwidth_is_named_whatever_the_driver_calls_it(bench):
    for number in (errno.ENOSPC, errno.EMSGSIZE):
        bench.card.answers["STREAMON"].append(number)
        with pytest.raises(DeviceRefused, match="no bandwidth") as caught:
            bench.grabber.open()
        assert caught.value.cause is Cause.NO_BANDWIDTH


def test_what_is_not_there_is_absent(bench):
    bench.unplug()
    with pytest.raises(DeviceAbsent, match="/dev/video0"):
        bench.grabber.open()


def test_an_open_grabber_is_not_opened_again_nor_reset(bench):
    bench.grabber.open()
    for attempt in (bench.grabber.open, bench.grabber.reset):
        with pytest.raises(DeviceRefused, match="is open"):
            attempt()
    with bench.grabber.dequeue(1.0) as fields:
        assert fields


def test_closing_stops_unmaps_frees_and_closes_in_this_order(bench):
    bench.grabber.open()
    before = len(bench.kernel.calls)
    bench.grabber.close()
    assert bench.kernel.calls[before:] == ["STREAMOFF", "REQBUFS"]
    assert bench.card.queue.memories == []
    assert bench.nothing_is_left_behind()


def test_closing_inside_a_block_is_no_harm(bench):
    bench.grabber.open()
    with bench.grabber.dequeue(1.0) as fields:
        bench.grabber.close()
        assert not fields[0].field.luma.any()
    assert bench.nothing_is_left_behind()


def test_a_card_that_refuses_to_stop_is_closed_all_the_same(bench):
    bench.grabber.open()
    for name in ("STREAMOFF", "REQBUFS"):
        bench.card.answers[name].append(errno.EIO)
    bench.grabber.close()
    assert bench.nothing_is_left_behind()


def test_a_restart_keeps_the_descriptor_and_makes_everything_else_anew(bench):
    info = bench.grabber.open()
    kept = list(bench.kernel.descriptors)
    before = len(bench.kernel.calls)
    assert bench.grabber.restart() == info
    again = bench.kernel.calls[before:]
    assert again[:2] == ["STREAMOFF", "REQBUFS"]
    assert "open" not in again
    assert again[-1] == "STREAMON"
    assert list(bench.kernel.descriptors) == kept
    bench.grabber.close()
    assert bench.nothing_is_left_behind()


def test_a_restart_drops_what_was_waiting(bench):
    bench.grabber.open()
    bench.kernel.sleep(0.2)
    bench.grabber.restart()
    with bench.grabber.dequeue(0.0) as fields:
        assert not fields


def test_a_restart_that_fails_can_be_tried_again(bench):
    bench.grabber.open()
    bench.card.answers["STREAMON"].append(errno.EINVAL)
    with pytest.raises(StreamFailed):
        bench.grabber.restart()
    assert bench.grabber.signal() is Signal.UNKNOWN
    with pytest.raises(StreamFailed, match="does not stream"), bench.grabber.dequeue(0.0):
        pass
    bench.grabber.restart()
    with bench.grabber.dequeue(1.0) as fields:
        assert fields


def test_a_restart_of_a_card_that_is_gone_has_lost_it(bench):
    bench.grabber.open()
    bench.unplug()
    with pytest.raises(DeviceLost):
        bench.grabber.restart()
    bench.grabber.close()
    assert bench.nothing_is_left_behind()


def test_a_restart_that_is_granted_something_else_is_refused(bench):
    bench.grabber.open()
    bench.card.orders = (Arrangement.INTERLACED,)
    with pytest.raises(DeviceRefused, match="a different stream"):
        bench.grabber.restart()
    bench.grabber.close()
    assert bench.nothing_is_left_behind()


def test_what_has_changed_around_a_card_does_not_hinder_its_restart(tmp_path):
    made = Bench(tmp_path, dongle())
    made.grabber.open()
    made.computer.plug_dongle(5, port="1-3")
    assert any("shares USB bus" in remark for remark in made.grabber.restart().remarks)


def test_a_card_in_a_slot_cannot_be_reset(bench):
    with pytest.raises(DeviceRefused, match="not on USB"):
        bench.grabber.reset()


def test_a_dongle_that_is_not_there_cannot_be_reset(tmp_path):
    made = Bench(tmp_path, dongle(), usb="05e1:0408")
    made.unplug()
    with pytest.raises(DeviceAbsent):
        Bench(tmp_path / "other", dongle(), usb="1b71:3002").grabber.reset()


def test_two_grabbers_do_not_know_each_other(tmp_path):
    one, other = Bench(tmp_path / "1"), Bench(tmp_path / "2", card_with(driver="tw68"))
    assert one.grabber.open() != other.grabber.open()
    one.grabber.close()
    with other.grabber.dequeue(1.0) as fields:
        assert fields
