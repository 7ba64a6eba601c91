"""A light on a GPIO line of a real kernel, whose chip is simulated: what is switched stands on the line."""

from collections.abc import Iterator

import pytest

from proofs.vm.guest import gpio
from proofs.vm.machine import Machine


@pytest.fixture
def chip(timed: Machine) -> Iterator[Machine]:
    """A chip that the kernel simulates is plugged in."""
    if not timed.call(gpio.plug_in):
        pytest.skip("this kernel has no gpio-sim")
    yield timed
    if timed.call(gpio.is_plugged_in):
        timed.call(gpio.unplug)


def test_what_is_said_of_the_light_stands_on_the_line(chip: Machine) -> None:
    run = chip.call(gpio.switched, seconds=3.0)
    assert [one > 0 for one in run["told"]] == run["seen"]
    assert {True, False} == set(run["seen"])
    assert run["after"] is False
    assert run["quickest_us"] < 5000


def test_an_inverted_light_is_on_while_its_line_is_low(chip: Machine) -> None:
    run = chip.call(gpio.switched, seconds=2.0, inverted=True)
    assert [not one for one in run["seen"]] == [one > 0 for one in run["told"]]


def test_wrong_lines_and_chips_are_named(chip: Machine) -> None:
    assert "0 to 3" in chip.call(gpio.refusal, line=9)["message"]
    assert "named are: lamp" in chip.call(gpio.refusal, line="lamb")["message"]
    assert "there is no GPIO chip" in chip.call(gpio.refusal, chip="other")["message"]
    assert chip.call(gpio.refusal, chip="/dev/null")["kind"] == "DeviceRefused"
    assert "is used by grabberd light" in chip.call(gpio.of_a_line_in_use)["message"]
    assert chip.call(gpio.refusal) is None


def test_a_chip_that_goes_away_is_lost(chip: Machine) -> None:
    said = chip.call(gpio.lost)
    assert said["kind"] == "DeviceLost"
    assert "is gone" in said["message"]
