"""A stream whose camera goes away, or is of another standard: what is told of it."""

import pytest

from drivers.v4l2.bench import card_with, dongle
from drivers.v4l2.taking import SECOND_NS, fails, take, until_it_fails
from grabberd.errors import DeviceRefused, StreamFailed
from grabberd.instrument.acquisition import Signal
from grabberd_v4l2 import abi
from grabberd_v4l2.abi import Arrangement


@pytest.mark.parametrize("tells", ["enuminput", "querystd"])
def test_a_camera_that_is_gone_is_told_where_the_card_tells(streaming, tells):
    bench = streaming(card_with() if tells == "enuminput" else dongle())
    assert bench.info.tells_signal
    assert bench.grabber.signal() is Signal.PRESENT
    bench.card.camera = 0
    assert bench.grabber.signal() is Signal.ABSENT
    assert len(take(bench, 4)) == 4
    bench.card.camera = abi.STD_PAL
    assert bench.grabber.signal() is Signal.PRESENT


def test_nothing_is_told_of_the_signal_where_the_card_does_not_tell(streaming):
    bench = streaming(dongle(driver="usbtv", tells="none"))
    assert not bench.info.tells_signal
    bench.card.camera = 0
    assert bench.grabber.signal() is Signal.UNKNOWN


def test_no_camera_is_not_taken_for_a_camera_of_60_hz(streaming):
    bench = streaming()
    bench.card.camera = 0
    until_it_fails(bench, 5)


def test_a_camera_that_turns_to_60_hz_ends_the_stream_within_two_seconds(streaming):
    bench = streaming()
    until_it_fails(bench, 2)
    bench.card.camera = 0x1000
    before_ns = bench.kernel.time_ns
    with pytest.raises(StreamFailed, match="60 Hz"):
        until_it_fails(bench, 10)
    assert bench.kernel.time_ns - before_ns < 2 * SECOND_NS


def test_an_event_shortens_the_time_until_a_camera_of_60_hz_is_noticed(streaming):
    bench = streaming()
    take(bench, 2)
    bench.card.set_camera(0x1000)
    before_ns = bench.kernel.time_ns
    with pytest.raises(StreamFailed, match="60 Hz"):
        take(bench, 1000)
    assert bench.kernel.time_ns - before_ns < 0.4 * SECOND_NS


def test_a_decoder_that_sees_60_hz_for_a_moment_ends_nothing(streaming):
    bench = streaming()
    bench.card.set_camera(0x1000)
    bench.kernel.after(0.1, lambda: bench.card.set_camera(abi.STD_PAL))
    until_it_fails(bench, 4)


def test_a_card_that_others_set_to_ntsc_is_set_to_pal_again(streaming):
    bench = streaming(dongle(driver="usbtv", tells="none"))
    bench.card.standard = 0x1000
    with pytest.raises(StreamFailed, match="another program"):
        until_it_fails(bench, 10)
    assert bench.grabber.restart().standard == "PAL"
    assert bench.card.standard == abi.STD_PAL


def test_an_alternating_card_that_does_not_tell_the_parity_is_refused(streaming):
    bench = streaming(card_with(unlabelled={0}, orders=(Arrangement.ALTERNATE,)))
    assert "parity" in fails(bench, DeviceRefused).message
