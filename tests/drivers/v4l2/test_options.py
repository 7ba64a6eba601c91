"""What a configuration may ask of the driver."""

import pytest

from grabberd.core.field import BOTTOM
from grabberd_v4l2 import V4l2Grabber
from grabberd_v4l2.abi import Arrangement
from grabberd_v4l2.options import V4l2Options


def test_a_device_is_enough():
    options = V4l2Options.read({"device": "/dev/video0"})
    assert options.standard is None
    assert options.format == ("GREY", "NV12", "YUYV", "UYVY", "MJPG", "JPEG")
    assert (options.columns_lines, options.rate_hz) == (None, None)
    assert options.buffers == 16
    assert options.arrangement is None
    assert options.older is None
    assert options.input is None


def test_everything_can_be_said():
    options = V4l2Options.read(
        {
            "usb": "05e1:0408",
            "port": "1-2.3",
            "input": "S-Video",
            "standard": "PAL-B/G",
            "format": "UYVY",
            "field_order": "interlaced",
            "older_field": "bottom",
            "exposure_ms": 0.5,
            "buffers": 16,
            "size": "720x576",
            "rate_hz": 50,
        }
    )
    assert (options.columns_lines, options.rate_hz) == ((720, 576), 50.0)
    assert options.format == ("UYVY",)
    assert options.arrangement is Arrangement.INTERLACED
    assert options.older == BOTTOM
    assert options.exposure_ns == 500_000
    assert str(options.identity) == "USB 05e1:0408 at port 1-2.3"


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"standard": "NTSC-X"}, "standard: 'NTSC-X' is not one of PAL, PAL-BG"),
        ({"size": "1280"}, "size: '1280' is not COLUMNSxLINES, such as 1280x720"),
        ({"size": "0x480"}, "size:"),
        ({"size": [640, 480]}, "size:"),
        ({"rate_hz": 0}, "rate_hz: .* greater than or equal to 5"),
        ({"rate_hz": "fast"}, "rate_hz:"),
        ({"format": ["GREY", "RGB3"]}, "format: .* is neither one nor a list of GREY"),
        ({"format": []}, "format:"),
        ({"field_order": "any"}, "field_order: 'any' is not one of none, top, bottom, interlaced"),
        ({"older_field": "left"}, "older_field:"),
        ({"exposure_ms": 1001}, "exposure_ms: .* less than or equal to 1000"),
        ({"buffers": 4}, "buffers: .* greater than or equal to 8"),
        ({"buffers": 33}, "buffers: .* less than or equal to 32"),
        ({"buffers": "12"}, "buffers:"),
        ({"device": None}, "name the grabber"),
        ({"usb": "05e1:0408"}, "name the grabber either by device"),
        ({"input": [1]}, "input:"),
        ({"no_such_option": 1}, "no_such_option: unknown option; known are device, usb"),
    ],
)
def test_a_wrong_option_is_refused_in_words(wrong, said):
    with pytest.raises(ValueError, match=said):
        V4l2Grabber(**{"device": "/dev/video0"} | wrong)


def test_all_that_is_wrong_is_said_at_once_a_line_each():
    with pytest.raises(ValueError, match="buffers") as caught:
        V4l2Grabber(standard="NTSC-X", buffers=99, formats="GREY")
    assert len(str(caught.value).splitlines()) == 4
