"""What a USB bus can carry, and the reset of a hung grabber."""

import errno
from types import SimpleNamespace

import pytest
from usb.backend import IBackend
from usb.core import USBError

from drivers.v4l2.computer import Computer
from grabberd.errors import DeviceAbsent, DeviceRefused
from grabberd_v4l2.devices import Identity, usb_places, video_nodes
from grabberd_v4l2.discovery import libusb, remarks_on, reset_of


class Bus(IBackend):
    """What libusb would find on a computer; resetting notes the port or fails as told."""

    def __init__(self, computer, failure=None):
        self.computer, self.failure, self.reset_ports = computer, failure, []

    def enumerate_devices(self):
        return list(usb_places(self.computer.roots))

    def get_device_descriptor(self, dev):
        vendor, product = (int(word, 16) for word in dev.vendor_product.split(":"))
        return SimpleNamespace(
            bus=dev.bus, address=dev.address, idVendor=vendor, idProduct=product, **dict.fromkeys(FIELDS, 0)
        )

    def open_device(self, dev):
        return dev

    def close_device(self, dev_handle):
        pass

    def reset_device(self, dev_handle):
        if self.failure:
            raise USBError("no", errno=self.failure)
        self.reset_ports.append(dev_handle.port)


FIELDS = [
    *("bLength", "bDescriptorType", "bcdUSB", "bDeviceClass", "bDeviceSubClass", "bDeviceProtocol"),
    *("bMaxPacketSize0", "bcdDevice", "iManufacturer", "iProduct", "iSerialNumber", "bNumConfigurations"),
    *("port_number", "port_numbers", "speed"),
]
"""The rest of a device descriptor, of no interest here."""


@pytest.fixture
def computer(tmp_path):
    computer = Computer(tmp_path)
    computer.plug_card(0)
    computer.plug_dongle(1, port="1-2")
    computer.plug_dongle(2, port="2-1", driver="usbtv", vendor_product="1b71:3002")
    return computer


def remarks(computer, number):
    nodes = video_nodes(computer.roots)
    return list(remarks_on(nodes[number], nodes))


@pytest.mark.parametrize("options", [{"usb": "05e1:0408"}, {"device": "/dev/video1"}])
def test_the_grabber_that_is_meant_is_reset_and_no_other(computer, options):
    bus = Bus(computer)
    reset_of(Identity.from_options(**options), computer.roots, lambda: bus)
    assert bus.reset_ports == ["1-2"]


def test_a_hung_grabber_without_a_node_is_reset_by_its_name(computer):
    computer.pull(1)
    bus = Bus(computer)
    reset_of(Identity(usb="05e1:0408"), computer.roots, lambda: bus)
    assert bus.reset_ports == ["1-2"]


def test_a_card_cannot_be_reset(computer):
    with pytest.raises(DeviceRefused, match="cannot be reset by software"):
        reset_of(Identity.from_options(device="/dev/video0"), computer.roots, lambda: Bus(computer))


def test_without_libusb_there_is_no_reset_and_that_is_said(computer):
    with pytest.raises(DeviceRefused, match=r"libusb-1\.0 is missing") as caught:
        reset_of(Identity(usb="05e1:0408"), computer.roots, lambda: None)
    assert "everything but the reset works" in caught.value.hint


@pytest.mark.parametrize("number", [errno.EACCES, errno.EPERM])
def test_without_rights_the_udev_rule_is_named(computer, number):
    with pytest.raises(DeviceRefused, match="/dev/bus/usb/001/") as caught:
        reset_of(Identity(usb="05e1:0408"), computer.roots, lambda: Bus(computer, number))
    assert "72-grabberd.rules" in caught.value.hint


@pytest.mark.parametrize("number", [errno.ENODEV, errno.ENOENT])
def test_a_device_that_comes_back_as_another_one_was_reset(computer, number):
    reset_of(Identity(usb="05e1:0408"), computer.roots, lambda: Bus(computer, number))


def test_a_reset_that_fails_leaves_the_plug(computer):
    with pytest.raises(DeviceRefused, match="could not be reset") as caught:
        reset_of(Identity(usb="05e1:0408"), computer.roots, lambda: Bus(computer, errno.EIO))
    assert "unplug it" in caught.value.hint


def test_what_is_not_there_cannot_be_reset(computer):
    for identity in (Identity(usb="dead:beef"), Identity.from_options(device="/dev/video9")):
        with pytest.raises(DeviceAbsent):
            reset_of(identity, computer.roots, lambda: Bus(computer))


def test_a_device_that_goes_between_look_and_reset_is_absent(computer):
    bus = Bus(Computer(computer.sys / "another"))
    with pytest.raises(DeviceAbsent, match="just disappeared"):
        reset_of(Identity(usb="05e1:0408"), computer.roots, lambda: bus)


def test_of_two_equal_ones_none_is_reset(computer):
    computer.plug_dongle(3, port="1-3")
    bus = Bus(computer)
    with pytest.raises(DeviceRefused, match="2 USB devices"):
        reset_of(Identity(usb="05e1:0408"), computer.roots, lambda: bus)
    assert bus.reset_ports == []


def test_this_computers_libusb_knows_no_grabber_that_is_not_there(computer):
    if libusb() is None:
        pytest.skip("libusb-1.0 is not installed")
    with pytest.raises(DeviceAbsent, match="just disappeared"):
        reset_of(Identity(usb="05e1:0408"), computer.roots)


def test_a_dongle_a_bus_needs_no_remark(computer):
    assert [remarks(computer, number) for number in range(3)] == [[], [], []]


def test_two_dongles_on_one_bus_are_remarked_on_both(computer):
    computer.plug_dongle(3, port="1-4.1", driver="usbtv", vendor_product="1b71:3002")
    assert "shares USB bus 1 with" in remarks(computer, 1)[0]
    assert f"{computer.dev}/video3" in remarks(computer, 1)[0]
    assert f"{computer.dev}/video1" in remarks(computer, 3)[0]


def test_the_other_nodes_of_the_same_device_take_no_more_of_the_bus(computer):
    interface = (computer.sys / "class/video4linux/video1").resolve().parent.parent
    computer.add_node(3, interface, "stk1160", index=1)
    assert remarks(computer, 1) == []


def test_usb_1_1_is_too_slow(computer):
    computer.plug_dongle(3, port="3-1", speed="12")
    assert "12 Mbit/s (USB 1.1)" in remarks(computer, 3)[0]
