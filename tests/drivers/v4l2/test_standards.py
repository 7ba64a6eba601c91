"""Standards are known by name and by the kernel's bits."""

import pytest
import videodev2

from grabberd.core.field import BOTTOM, TOP
from grabberd_v4l2 import formats


@pytest.mark.parametrize("name", [name for name in formats.NAMES if name != "PAL-NC"])
def test_bits_are_the_kernels(name):
    kernels = "V4L2_STD_" + name.replace("-", "_")
    assert formats.bits(name) == getattr(videodev2, kernels)


def test_names_are_read_as_people_write_them():
    assert formats.bits("pal-b/g") == formats.bits("PAL-BG")


def test_an_unknown_name_is_refused_with_those_that_are_known():
    with pytest.raises(ValueError, match="'PAL-X' is not one of PAL"):
        formats.bits("PAL-X")


@pytest.mark.parametrize("name", formats.NAMES)
def test_every_standard_has_625_lines_at_50_hz_or_525_at_60_as_the_kernel_sorts_them(name):
    is_60_hz = bool(formats.bits(name) & videodev2.V4L2_STD_525_60)
    assert formats.scan(formats.bits(name)) == (formats.SCAN_525 if is_60_hz else formats.SCAN_625)


def test_a_frame_has_576_or_480_lines_and_its_older_field_is_that_of_the_documentation():
    assert formats.SCAN_625 == (576, 50.0, TOP)
    assert formats.SCAN_525 == (480, 60_000 / 1001, BOTTOM)
    assert (formats.SCAN_625.period_ns, formats.SCAN_525.period_ns) == (20_000_000, 16_683_333)


def test_a_set_is_called_by_the_name_it_has_or_that_of_a_part_of_it():
    assert formats.name(0xFF) == "PAL"
    assert formats.name(0x07) == "PAL-BG"
    assert formats.name(0xFF06FF) == "PAL"
    assert formats.name(0xB000) == "NTSC"
    assert formats.name(0x1000) == "NTSC-M"
    assert formats.name(0xF900) == "NTSC"
    assert formats.name(0) == "none"


def test_a_mixture_is_surely_neither():
    assert formats.scan(0x10FF) is None
    assert formats.scan(0) is None
