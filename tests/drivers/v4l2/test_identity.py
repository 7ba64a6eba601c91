"""A grabber is found by what it is, under whatever node it has now."""

from pathlib import Path

import pytest

from drivers.v4l2.computer import Computer
from grabberd.errors import DeviceAbsent, DeviceRefused
from grabberd_v4l2.devices import Identity, find_node

BY_PATH = "/dev/v4l/by-path/pci-0000:00:14.0-usb-0:2:1.0-video-index0"


@pytest.fixture
def computer(tmp_path):
    return Computer(tmp_path)


def test_a_link_by_path_leads_to_the_node_of_today(computer):
    identity = Identity.from_options(device=BY_PATH)
    computer.plug_dongle(0)
    assert find_node(identity, computer.roots) == computer.dev / "video0"
    computer.pull(0)
    computer.plug_dongle(3)
    assert find_node(identity, computer.roots) == computer.dev / "video3"


def test_vendor_and_product_find_the_node_of_today(computer):
    identity = Identity.from_options(usb="05E1:0408")
    computer.plug_card(0)
    computer.plug_dongle(1)
    assert find_node(identity, computer.roots) == computer.dev / "video1"
    computer.pull(1)
    computer.plug_dongle(2)
    assert find_node(identity, computer.roots) == computer.dev / "video2"


def test_a_node_is_itself(computer):
    node = computer.plug_card(0)
    assert find_node(Identity.from_options(device="/dev/video0"), computer.roots) == node
    assert find_node(Identity.from_options(device=str(node)), computer.roots) == node


@pytest.mark.parametrize("more", [{"port": "1-3"}, {"serial": "B"}, {"port": "1-3", "serial": "B"}])
def test_port_and_serial_tell_equal_grabbers_apart(computer, more):
    computer.plug_dongle(0, port="1-2", serial="A")
    computer.plug_dongle(1, port="1-3", serial="B")
    identity = Identity.from_options(usb="05e1:0408", **more)
    assert find_node(identity, computer.roots) == computer.dev / "video1"


def test_equal_grabbers_are_refused_and_listed_with_their_ports(computer):
    computer.plug_dongle(0, port="1-2")
    computer.plug_dongle(1, port="1-3.1")
    with pytest.raises(
        DeviceRefused, match=r"2 grabbers are USB 05e1:0408: .*port 1-2.*port 1-3\.1"
    ) as caught:
        find_node(Identity.from_options(usb="05e1:0408"), computer.roots)
    assert 'port: "1-2"' in caught.value.hint


def test_only_the_first_node_of_a_device_has_its_pictures(computer):
    computer.plug_dongle(0, driver="uvcvideo", vendor_product="534d:0021")
    interface = (computer.sys / "class/video4linux/video0").resolve().parent.parent
    computer.add_node(1, interface, "uvcvideo", path_id="pci-0000:00:14.0-usb-0:2:1.0", index=1)
    assert find_node(Identity.from_options(usb="534d:0021"), computer.roots) == computer.dev / "video0"


def test_what_is_absent_is_said_with_what_is_there_instead(computer):
    computer.plug_dongle(4, driver="usbtv", vendor_product="1b71:3002", port="1-4")
    for options in ({"device": BY_PATH}, {"usb": "05e1:0408"}, {"usb": "1b71:3002", "port": "1-5"}):
        with pytest.raises(DeviceAbsent) as caught:
            find_node(Identity.from_options(**options), computer.roots)
        assert f"{computer.dev}/video4 (usbtv, USB 1b71:3002 at port 1-4)" in caught.value.hint


def test_nothing_at_all_is_said_too(computer):
    with pytest.raises(DeviceAbsent) as caught:
        find_node(Identity.from_options(device="/dev/video0"), computer.roots)
    assert "no video nodes at present" in caught.value.hint


def test_a_device_without_a_node_lacks_its_module(computer):
    computer.plug_usb("05e1:0408", "1-2")
    with pytest.raises(
        DeviceAbsent, match=r"USB 05e1:0408 at port 1-2 is plugged in, but no kernel driver"
    ) as caught:
        find_node(Identity.from_options(usb="05e1:0408"), computer.roots)
    assert "dmesg" in caught.value.hint


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({}, "either by device"),
        ({"device": "/dev/video0", "usb": "05e1:0408"}, "either by device"),
        ({"device": "/dev/video0", "port": "1-2"}, "belong to usb"),
        ({"device": "video0"}, "not an absolute path"),
        ({"usb": "05e1"}, "VENDOR:PRODUCT"),
        ({"usb": "0x05e1:0x0408"}, "VENDOR:PRODUCT"),
        ({"usb": "05e1:0408", "port": "2"}, "not a USB port"),
        ({"usb": "05e1:0408", "serial": 7}, "quotation marks"),
        ({"serial": "7"}, "either by device"),
    ],
)
def test_an_identity_that_cannot_be_is_refused_before_anything_is_opened(options, says):
    with pytest.raises(ValueError, match=says):
        Identity.from_options(**options)


def test_it_is_called_by_its_name():
    assert str(Identity(device=Path("/dev/video0"))) == "/dev/video0"
    assert str(Identity(usb="05e1:0408", port="1-2", serial="7")) == "USB 05e1:0408 at port 1-2 with serial 7"
