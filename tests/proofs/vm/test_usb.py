"""USB: finding, resetting and replugging, with devices that the kernel believes in."""

from collections.abc import Iterator

import pytest

from proofs.vm.guest import bus
from proofs.vm.machine import Machine
from proofs.vm.tables import Tables

TABLET = "0627:0001"
"""What QEMU calls its tablet."""


@pytest.fixture
def easycap(timed: Machine) -> Iterator[Machine]:
    """A device with the numbers of an EasyCAP is plugged in."""
    timed.call(bus.plug_in_easycap, serial="")
    yield timed
    timed.call(bus.unplug_easycap)


def test_what_is_plugged_in_is_found_in_sys_and_by_libusb_alike(timed: Machine) -> None:
    places = timed.call(bus.places)
    assert sorted(place["usb"] for place in places) == sorted(timed.call(bus.seen_by_libusb))
    tablet = next(place for place in places if place["usb"] == TABLET)
    assert (tablet["port"], tablet["mbit_s"]) == ("1-1", 480.0)


def test_a_reset_brings_a_device_back_at_its_port(timed: Machine, tables: Tables) -> None:
    before = timed.call(bus.kernel_resets)
    reset = timed.call(bus.reset, vendor_product=TABLET)
    _add(tables, "reset of a device", reset["seconds"])
    assert reset["port"] == "1-1"
    assert reset["seconds"] < 10
    assert timed.call(bus.kernel_resets) == before + 1


def test_a_device_is_found_again_after_a_replug(timed: Machine, tables: Tables) -> None:
    timed.qmp.command("device_del", id="tablet")
    _add(tables, "pulling a plug, seen", timed.call(bus.wait_until, vendor_product=TABLET, there=False))
    timed.qmp.wait_for("DEVICE_DELETED")
    timed.qmp.command("device_add", driver="usb-tablet", id="tablet", bus="xhci.0", port="1")
    _add(tables, "plugging it in, seen", timed.call(bus.wait_until, vendor_product=TABLET, there=True))
    assert any(place["usb"] == TABLET for place in timed.call(bus.places))


def test_a_reset_of_what_is_not_there_says_so(timed: Machine) -> None:
    assert "no USB device is" in timed.call(bus.reset, vendor_product="05e1:0408")["refused"]


def test_an_easycap_is_known_by_its_numbers_and_reset_where_it_is(easycap: Machine) -> None:
    place = next(one for one in easycap.call(bus.places) if one["usb"] == bus.EASYCAP)
    assert place["mbit_s"] == 480.0
    assert easycap.call(bus.reset, vendor_product=bus.EASYCAP)["port"] == place["port"]


def _add(tables: Tables, what: str, seconds: float) -> None:
    tables.add("USB", what=what, seconds=f"{seconds:.2f}")
