"""A light on a line of a GPIO chip, and the kernel's interface that it is switched through."""

import errno
import shutil
import subprocess
from pathlib import Path

import pytest

from drivers.loggers.light_lines import GpioChip
from grabberd.errors import Cause, DeviceAbsent, DeviceLost, DeviceRefused
from grabberd_loggers.light import gpio_line
from grabberd_loggers.light.gpio_line import GpioLight

COMPILER = shutil.which("cc") or shutil.which("gcc")
HEADER = Path("/usr/include/linux/gpio.h")
PROGRAM = r"""
#include <linux/gpio.h>
#include <stdio.h>
#include <stddef.h>
#include <string.h>
int main(void) {
    struct gpio_v2_line_request request;
    memset(&request, 0, sizeof request);
    request.offsets[0] = 17;
    strcpy(request.consumer, "grabberd light");
    request.config.flags = GPIO_V2_LINE_FLAG_OUTPUT | GPIO_V2_LINE_FLAG_ACTIVE_LOW;
    request.config.num_attrs = 1;
    request.config.attrs[0].attr.id = GPIO_V2_LINE_ATTR_ID_OUTPUT_VALUES;
    request.config.attrs[0].mask = 1;
    request.num_lines = 1;
    printf("%lu %lu %lu %lu %lu\n", (unsigned long)GPIO_GET_CHIPINFO_IOCTL,
           (unsigned long)GPIO_V2_GET_LINEINFO_IOCTL, (unsigned long)GPIO_V2_GET_LINE_IOCTL,
           (unsigned long)GPIO_V2_LINE_GET_VALUES_IOCTL, (unsigned long)GPIO_V2_LINE_SET_VALUES_IOCTL);
    printf("%zu %zu\n", offsetof(struct gpio_v2_line_info, flags), offsetof(struct gpio_v2_line_request, fd));
    for (size_t i = 0; i < sizeof request; i++) printf("%02x", ((unsigned char *)&request)[i]);
    return 0;
}
"""


@pytest.fixture
def chip(tmp_path: Path) -> GpioChip:
    return GpioChip(tmp_path)


def test_a_line_is_taken_by_name_or_number_on_a_chip_by_label_or_path(chip: GpioChip, tmp_path: Path) -> None:
    for options in (
        {"chip": "bench", "line": "fan"},
        {"chip": "gpiochip3", "line": 2},
        {"chip": str(tmp_path / "gpiochip3"), "line": 2},
    ):
        line = chip.line(**options)
        found = line.open()
        assert found.details["chip"] == "gpiochip3 (bench)"
        assert chip.taken[-1] == (2, "grabberd light", False)
        line.close()
    assert chip.open_chips == set()


def test_it_is_switched_and_asked(chip: GpioChip) -> None:
    line = chip.line(inverted=True)
    line.open()
    assert chip.taken == [(0, "grabberd light", True)]
    line.switch(True)
    assert line.is_on()
    line.close()
    assert set(chip.value_of.values()) == {False}


def test_a_line_that_somebody_uses_is_refused_with_who_it_is(chip: GpioChip) -> None:
    with pytest.raises(DeviceRefused, match=r"line 3 of .* is used by reboot") as refused:
        chip.line(line=3).open()
    assert refused.value.cause is Cause.DEVICE_BUSY
    assert chip.open_chips == set()


@pytest.mark.parametrize(
    ("line", "words"), [(4, "its lines are 0 to 3"), ("lamb", "named are: lamp, fan, reset"), (-1, "0 to 3")]
)
def test_a_line_that_there_is_not_is_refused_with_those_that_there_are(
    chip: GpioChip, line: int | str, words: str
) -> None:
    with pytest.raises(DeviceRefused, match=words):
        chip.line(line=line).open()
    assert chip.open_chips == set()


def test_a_chip_that_there_is_not_is_absent(chip: GpioChip) -> None:
    for name in ("other", "/dev/gpiochip99"):
        with pytest.raises(DeviceAbsent, match="there is no GPIO chip") as absent:
            chip.line(chip=name).open()
        assert absent.value.hint
    assert chip.open_chips == set()


@pytest.mark.parametrize("name", ["bench", "gpiochip3"])
def test_a_chip_that_may_not_be_opened_says_who_can_change_that(chip: GpioChip, name: str) -> None:
    chip.refusal = errno.EACCES
    with pytest.raises(DeviceRefused, match="may not be opened") as refused:
        chip.line(chip=name).open()
    assert refused.value.cause is Cause.NO_RIGHTS


def test_a_chip_that_is_unplugged_is_lost(chip: GpioChip) -> None:
    line = chip.line()
    line.open()
    chip.unplug()
    with pytest.raises(DeviceLost, match="is gone"):
        line.switch(True)
    line.close()


def test_a_file_that_is_no_chip_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "gpiochip0"
    file.touch()
    with pytest.raises(DeviceRefused, match="is no GPIO chip"):
        GpioLight(chip=str(file), line=0).open()


@pytest.mark.skipif(not (COMPILER and HEADER.exists()), reason="apt-get install gcc linux-libc-dev")
def test_requests_and_structures_are_those_of_the_kernels_header(tmp_path: Path) -> None:
    source, program = tmp_path / "abi.c", tmp_path / "abi"
    source.write_text(PROGRAM)
    subprocess.run([str(COMPILER), "-o", str(program), str(source)], check=True, timeout=60)
    numbers, places, request = subprocess.run(
        [str(program)], check=True, timeout=10, capture_output=True, text=True
    ).stdout.split("\n")
    ours = (
        *(gpio_line.GET_CHIP_INFO, gpio_line.GET_LINE_INFO, gpio_line.GET_LINE),
        *(gpio_line.GET_VALUES, gpio_line.SET_VALUES),
    )
    assert [int(one) for one in numbers.split()] == list(ours)
    assert places == "72 588"
    assert gpio_line.output_request(17, "grabberd light", inverted=True).hex() == request
