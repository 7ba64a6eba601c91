"""From a buffer to the fields in it, for every arrangement that a driver may grant."""

import numpy as np
import pytest

from grabberd.core.field import BOTTOM, TOP, FieldOrder
from grabberd.errors import DeviceRefused
from grabberd_v4l2.abi import Arrangement
from grabberd_v4l2.fields import Granted, Layout
from grabberd_v4l2.node import Capability
from grabberd_v4l2.profiles import Profiles

PROFILES = Profiles.load()
COLUMNS = 8
WOVEN = [Arrangement.INTERLACED, Arrangement.INTERLACED_TB, Arrangement.INTERLACED_BT]
STACKED = [Arrangement.SEQ_TB, Arrangement.SEQ_BT]


def granted(field, lines=576, driver="bttv"):
    return Granted(
        columns=COLUMNS,
        lines=lines,
        bytes_per_line=COLUMNS,
        fourcc="GREY",
        field=int(field),
        standard="PAL",
        node=Capability(driver, "a card", "PCI:0000:01:00.0", 0),
        buffers=8,
    )


def layout(field, lines=576, driver="bttv", older=None):
    return Layout.of(granted(field, lines, driver), PROFILES.of(driver), older)


def frame():
    """Frame line y is grey y modulo 256, but the last column, which tells the parity."""
    grey = np.repeat(np.arange(576)[:, np.newaxis], COLUMNS, axis=1).astype(np.uint8)
    grey[:, -1] = np.arange(576) % 2
    return grey


def stacked(upper):
    return np.concatenate([frame()[upper::2], frame()[1 - upper :: 2]])


def assert_is_the_field(laid, parity):
    assert laid.parity == parity
    assert np.array_equal(laid.luma, frame()[parity::2])


# --- two fields a buffer ---


@pytest.mark.parametrize(
    ("arrangement", "older"),
    [
        (Arrangement.INTERLACED, TOP),
        (Arrangement.INTERLACED_TB, TOP),
        (Arrangement.INTERLACED_BT, BOTTOM),
        (Arrangement.SEQ_TB, TOP),
        (Arrangement.SEQ_BT, BOTTOM),
    ],
)
def test_a_frame_gives_both_fields_the_older_first(arrangement, older):
    buffer = stacked(older) if arrangement in STACKED else frame()
    found = layout(arrangement)
    fields = found.fields(buffer.ravel(), arrangement)
    assert [field.age_steps for field in fields] == [1, 0]
    assert_is_the_field(fields[0], older)
    assert_is_the_field(fields[1], 1 - older)
    assert found.order is (FieldOrder.TOP_FIRST if older == TOP else FieldOrder.BOTTOM_FIRST)
    assert (found.rate_hz, found.field_rows, found.granted.columns) == (50.0, 288, COLUMNS)
    assert found.remarks == ()


def test_the_fields_of_a_frame_are_views():
    buffer = frame().ravel()
    assert all(
        np.shares_memory(field.luma, buffer) for field in layout(Arrangement.INTERLACED).fields(buffer, 4)
    )


def test_the_profile_knows_a_driver_whose_bottom_field_is_older():
    found = layout(Arrangement.INTERLACED, driver="usbtv")
    assert found.order is FieldOrder.BOTTOM_FIRST
    assert_is_the_field(found.fields(frame().ravel(), Arrangement.INTERLACED)[0], BOTTOM)


@pytest.mark.parametrize("arrangement", WOVEN + STACKED)
@pytest.mark.parametrize("older", [TOP, BOTTOM])
def test_the_configured_order_overrules_driver_and_profile_and_moves_no_line(arrangement, older):
    upper = BOTTOM if arrangement is Arrangement.SEQ_BT else TOP
    buffer = stacked(upper) if arrangement in STACKED else frame()
    fields = layout(arrangement, driver="usbtv", older=older).fields(buffer.ravel(), arrangement)
    assert_is_the_field(fields[0], older)
    assert_is_the_field(fields[1], 1 - older)


def test_a_driver_that_weaves_and_says_none_is_believed_by_its_profile_only():
    found = layout(Arrangement.NONE, driver="dt3155")
    assert found.order is FieldOrder.TOP_FIRST
    assert_is_the_field(found.fields(frame().ravel(), Arrangement.NONE)[0], TOP)
    with pytest.raises(DeviceRefused, match="V4L2_FIELD_NONE"):
        layout(Arrangement.NONE, driver="bttv")


def test_a_stick_that_throws_a_field_away_is_refused_with_its_profiles_advice():
    with pytest.raises(DeviceRefused) as caught:
        layout(Arrangement.NONE, driver="uvcvideo")
    assert caught.value.hint == PROFILES.of("uvcvideo").advice
    assert "a card (driver uvcvideo)" in caught.value.message


def test_any_is_no_answer():
    with pytest.raises(DeviceRefused, match="V4L2_FIELD_ANY"):
        layout(Arrangement.ANY)


def test_an_odd_number_of_lines_is_no_frame():
    with pytest.raises(DeviceRefused, match="575 lines are not two fields"):
        layout(Arrangement.INTERLACED, lines=575)


# --- one field a buffer ---


def test_alternating_fields_have_the_parity_that_their_buffer_says():
    found = layout(Arrangement.ALTERNATE, lines=288)
    assert (found.order, found.rate_hz, found.field_rows) == (FieldOrder.ALTERNATE, 50.0, 288)
    for parity, said in ((BOTTOM, Arrangement.BOTTOM), (TOP, Arrangement.TOP)):
        (field,) = found.fields(frame()[parity::2].ravel(), said)
        assert_is_the_field(field, parity)
        assert field.age_steps == 0


@pytest.mark.parametrize("said", [Arrangement.ANY, Arrangement.ALTERNATE, Arrangement.INTERLACED])
def test_an_alternating_field_without_a_parity_is_refused(said):
    with pytest.raises(DeviceRefused, match="does not state its parity"):
        layout(Arrangement.ALTERNATE, lines=288).fields(frame()[::2].ravel(), said)


@pytest.mark.parametrize(
    ("arrangement", "parity", "name"), [(Arrangement.TOP, TOP, "top"), (Arrangement.BOTTOM, BOTTOM, "bottom")]
)
def test_one_parity_alone_is_accepted_and_said(arrangement, parity, name):
    found = layout(arrangement, lines=288)
    (field,) = found.fields(frame()[parity::2].ravel(), arrangement)
    assert_is_the_field(field, parity)
    assert (found.order, found.rate_hz) == (FieldOrder.ONE_PARITY, 25.0)
    assert f"only the {name} field of every frame: 25 fields a second instead of 50" in found.remarks[0]


@pytest.mark.parametrize("arrangement", [Arrangement.ALTERNATE, Arrangement.TOP])
def test_a_field_that_a_scaler_stretched_is_refused(arrangement):
    with pytest.raises(DeviceRefused, match="576 rows a field are more than the 288"):
        layout(arrangement, lines=576)


def test_missing_lines_are_said():
    (remark,) = layout(Arrangement.INTERLACED, lines=480).remarks
    assert remark == "a field has only 240 of 288 rows: the driver cuts or scales the picture"
