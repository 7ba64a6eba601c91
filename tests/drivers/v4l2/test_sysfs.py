"""What the kernel tells of video nodes and USB devices is read as it stands there."""

import threading

import pytest

from drivers.v4l2.computer import Computer
from grabberd.instrument.acquisition.device import Roots
from grabberd_v4l2.devices import usb_places, video_nodes


@pytest.fixture
def computer(tmp_path):
    return Computer(tmp_path)


def test_a_computer_without_video_has_no_nodes(tmp_path):
    nothing = Roots(tmp_path / "sys", tmp_path / "dev")
    assert video_nodes(nothing) == ()
    assert usb_places(nothing) == ()


def test_a_dongle_is_told_with_driver_links_and_place(computer):
    node = computer.plug_dongle(0, port="1-2.3", serial="0007", name="Easy Cap")
    by_id = computer.link("by-id", "usb-Easy_Cap_0007-video-index0", node)
    (found,) = video_nodes(computer.roots)
    assert (found.path, found.index, found.kernel_driver) == (node, 0, "stk1160")
    assert found.by_path == computer.dev / "v4l/by-path/pci-0000:00:14.0-usb-0:2.3:1.0-video-index0"
    assert found.by_id == by_id
    assert (found.usb.vendor_product, found.usb.port, found.usb.bus) == ("05e1:0408", "1-2.3", 1)
    assert (found.usb.serial, found.usb.speed_mbit_s, found.usb.name) == ("0007", 480.0, "Easy Cap")


def test_a_card_is_not_on_usb(computer):
    computer.plug_card(0)
    (found,) = video_nodes(computer.roots)
    assert found.usb is None
    assert str(found) == f"{computer.dev}/video0 (bttv, BT878 video)"


def test_a_device_without_a_serial_has_none(computer):
    computer.plug_dongle(0)
    assert video_nodes(computer.roots)[0].usb.serial is None


def test_nodes_come_in_the_order_of_their_numbers(computer):
    for number in (10, 9, 2):
        computer.plug_card(number, slot=f"0000:04:0{number % 10}.0")
    assert [node.path.name for node in video_nodes(computer.roots)] == ["video2", "video9", "video10"]


def test_vbi_and_radio_nodes_are_not_video(computer):
    computer.plug_card(0)
    (computer.sys / "class/video4linux/vbi0").mkdir()
    (computer.sys / "class/video4linux/radio0").mkdir()
    assert len(video_nodes(computer.roots)) == 1


def test_usb_devices_are_told_with_and_without_a_video_node(computer):
    computer.plug_usb("046D:C31C", "1-1")
    computer.plug_dongle(0, port="1-2")
    assert [str(place) for place in usb_places(computer.roots)] == [
        "USB 046d:c31c at port 1-1",
        "USB 05e1:0408 at port 1-2",
    ]


@pytest.mark.parametrize("attribute", ["idProduct", "speed", "devnum"])
def test_a_device_that_vanishes_while_it_is_read_is_none(computer, attribute):
    (computer.plug_usb("05e1:0408", "1-2") / attribute).unlink()
    assert usb_places(computer.roots) == ()


def test_places_that_come_and_go_while_they_are_read_are_there_or_not(computer):
    target = computer.plug_usb("046D:C31C", "1-1")
    there = computer.sys / "bus" / "usb" / "devices" / "9-9"
    gone = threading.Event()

    def come_and_go():
        while not gone.is_set():
            there.symlink_to(target)
            there.unlink()

    coming = threading.Thread(target=come_and_go)
    coming.start()
    try:
        assert {len(usb_places(computer.roots)) for _ in range(2000)} <= {1, 2}
    finally:
        gone.set()
        coming.join()
