"""Cameras of 525 lines and 60 Hz: the standard is named, its lines, rate and order of fields are kept to."""

import numpy as np
import pytest

from drivers.v4l2.bench import ALL_ORDERS, Bench, card_with, dongle
from drivers.v4l2.fake_kernel import field_picture, number_in
from drivers.v4l2.taking import SECOND_NS, numbered, take, until_it_fails
from grabberd.core.field import BOTTOM, NTSC_HZ, TOP, FieldOrder
from grabberd.core.ledger import Outcome
from grabberd.errors import Cause, DeviceRefused, StreamFailed
from grabberd_v4l2 import abi
from grabberd_v4l2.abi import Arrangement

NTSC = 0x1000


def ntsc(**traits):
    """A Bt878 with a camera of 60 Hz."""
    return card_with(camera=NTSC, **traits)


def refusal(bench):
    with pytest.raises(DeviceRefused) as caught:
        bench.grabber.open()
    assert bench.nothing_is_left_behind()
    return caught.value


@pytest.mark.parametrize("order", [order.name.lower() for order in ALL_ORDERS])
@pytest.mark.parametrize("fourcc", ["GREY", "UYVY"])
def test_every_field_order_and_format_gives_fields_of_240_rows(tmp_path, order, fourcc):
    bench = Bench(tmp_path, ntsc(), standard="NTSC", field_order=order, format=fourcc)
    info = bench.grabber.open()
    one_parity = order in ("top", "bottom")
    assert (info.standard, info.columns, info.field_rows) == ("NTSC-M", 720, 240)
    assert info.rate_hz == (NTSC_HZ / 2 if one_parity else NTSC_HZ)
    for one in take(bench, 4):
        luma = one.field.luma
        assert (luma == field_picture(number_in(luma), rows=240)).all()
        assert one.field.parity == number_in(luma) % 2


def test_the_bottom_field_of_a_woven_frame_is_the_older_and_comes_first(tmp_path):
    bench = Bench(tmp_path, dongle(camera=NTSC), standard="NTSC")
    assert bench.grabber.open().field_order is FieldOrder.BOTTOM_FIRST
    with bench.grabber.dequeue(1.0) as fields:
        assert [one.field.parity for one in fields] == [BOTTOM, TOP]
        assert number_in(fields[1].field.luma) == number_in(fields[0].field.luma) + 1


def test_the_installer_has_the_last_word_on_the_older_field(tmp_path):
    bench = Bench(tmp_path, dongle(camera=NTSC), standard="NTSC", older_field="top")
    assert bench.grabber.open().field_order is FieldOrder.TOP_FIRST


@pytest.mark.parametrize(("order", "expected"), [("seq_tb", TOP), ("interlaced_bt", BOTTOM)])
def test_an_order_that_states_the_older_field_is_believed(tmp_path, order, expected):
    bench = Bench(tmp_path, ntsc(), standard="NTSC", field_order=order)
    named = {TOP: FieldOrder.TOP_FIRST, BOTTOM: FieldOrder.BOTTOM_FIRST}
    assert bench.grabber.open().field_order is named[expected]


@pytest.mark.parametrize("name", ["NTSC", "NTSC-M"])
def test_640_columns_can_be_asked_for(tmp_path, name):
    info = Bench(tmp_path, ntsc(), standard=name, size="640x480").grabber.open()
    assert (info.columns, info.field_rows) == (640, 240)


def test_columns_that_a_card_does_not_grant_are_refused_with_those_that_it_does(tmp_path):
    told = refusal(Bench(tmp_path, ntsc(columns=704), standard="NTSC", size="720x480"))
    assert "requested 720×480 (a field: 240)" in told.message
    assert "704×" in told.message


@pytest.mark.parametrize("order", ["alternate", "interlaced", "top"])
def test_fields_come_a_sixtieth_of_a_second_apart_and_are_numbered(tmp_path, order):
    bench = Bench(tmp_path, ntsc(), standard="NTSC", field_order=order)
    bench.info = bench.grabber.open()
    fields = take(bench, 60)
    steps = np.diff([one.time_ns for one in fields])
    assert np.abs(steps - 1e9 / bench.info.rate_hz).max() < 1_000
    found = numbered(bench, fields)
    assert [one.n for one in found] == list(range(len(found)))
    assert {one.outcome for one in found} == {Outcome.RECEIVED}


def test_a_lost_frame_is_two_fields_that_are_lost(tmp_path):
    bench = Bench(tmp_path, dongle(camera=NTSC), standard="NTSC")
    bench.info = bench.grabber.open()
    bench.card.lost = {20}
    found = numbered(bench, take(bench, 80))
    losses = [(entry.first_n, entry.count) for one in found for entry in one.lost_before]
    assert losses == [(40, 2)]


def test_the_exposure_may_not_exceed_a_field(tmp_path):
    assert "0 to 16.7 ms" in refusal(Bench(tmp_path, ntsc(), standard="NTSC", exposure_ms=18)).message


def test_a_camera_of_the_other_standard_is_refused_with_both_remedies(tmp_path):
    told = refusal(Bench(tmp_path / "60", ntsc()))
    assert "signal is of 60 Hz (NTSC), but the card is set to 50 Hz (PAL)" in told.message
    assert "connect a PAL camera" in told.hint
    assert "'standard: NTSC', and the rig's lines to 480" in told.hint
    assert told.cause is Cause.WRONG_STANDARD
    told = refusal(Bench(tmp_path / "50", card_with(), standard="NTSC"))
    assert "signal is of 50 Hz (PAL), but the card is set to 60 Hz (NTSC)" in told.message
    assert "'standard: PAL', and the rig's lines to 576" in told.hint


def test_a_camera_that_turns_to_50_hz_ends_the_stream_within_two_seconds(tmp_path):
    bench = Bench(tmp_path, ntsc(), standard="NTSC")
    bench.grabber.open()
    until_it_fails(bench, 2)
    bench.card.camera = abi.STD_PAL
    before_ns = bench.kernel.time_ns
    with pytest.raises(StreamFailed, match="is of 50 Hz"):
        until_it_fails(bench, 10)
    assert bench.kernel.time_ns - before_ns < 2 * SECOND_NS


def test_a_card_that_others_set_to_pal_is_set_to_ntsc_again(tmp_path):
    bench = Bench(tmp_path, dongle(driver="usbtv", tells="none", camera=NTSC), standard="NTSC")
    bench.grabber.open()
    bench.card.standard = abi.STD_PAL
    with pytest.raises(StreamFailed, match="another program has set the card to PAL"):
        until_it_fails(bench, 10)
    assert bench.grabber.restart().standard == "NTSC-M"


def test_no_camera_is_not_taken_for_a_camera_of_50_hz(tmp_path):
    bench = Bench(tmp_path, ntsc(), standard="NTSC")
    bench.grabber.open()
    bench.card.camera = 0
    until_it_fails(bench, 3)


def test_a_card_that_stays_at_50_hz_is_refused(tmp_path):
    bench = Bench(tmp_path, ntsc(), standard="NTSC")
    bench.card.standard = abi.STD_PAL
    bench.card.set_standard = lambda standard: None
    bench.card.set_input = lambda index: setattr(bench.card, "input", index)
    assert "was set to NTSC but is at PAL (50 Hz)" in refusal(bench).message


def test_a_usbtv_closes_a_frame_bottom_first_at_either_rate(tmp_path):
    bench = Bench(tmp_path, dongle(driver="usbtv", tells="none", camera=NTSC), standard="NTSC")
    assert bench.grabber.open().field_order is FieldOrder.BOTTOM_FIRST
    assert bench.card.order is Arrangement.INTERLACED
