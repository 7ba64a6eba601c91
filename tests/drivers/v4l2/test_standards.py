"""Standards are known by name and by the kernel's bits."""

import pytest
import videodev2

from grabberd_v4l2 import standards


@pytest.mark.parametrize("name", [name for name in standards.NAMES if name != "PAL-NC"])
def test_bits_are_the_kernels(name):
    kernels = "V4L2_STD_" + name.replace("-", "_")
    assert standards.bits(name) == getattr(videodev2, kernels)


def test_names_are_read_as_people_write_them():
    assert standards.bits("pal-b/g") == standards.bits("PAL-BG")


def test_what_has_not_50_fields_a_second_cannot_be_named():
    with pytest.raises(ValueError, match="'PAL-M' is not one of PAL"):
        standards.bits("PAL-M")
    assert all(standards.is_50_hz(bits) for bits in standards.NAMES.values())


def test_a_set_is_called_by_the_name_it_has_or_that_of_a_part_of_it():
    assert standards.name(0xFF) == "PAL"
    assert standards.name(0x07) == "PAL-BG"
    assert standards.name(0xFF06FF) == "PAL"
    assert standards.name(0xB000) == "a standard of 60 Hz"
    assert standards.name(0) == "none"


def test_a_mixture_is_surely_neither():
    assert not standards.is_50_hz(0x10FF)
    assert not standards.is_60_hz(0x10FF)
    assert standards.is_60_hz(0x1000)
    assert not standards.is_50_hz(0)
