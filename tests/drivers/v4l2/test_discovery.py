"""The frame grabbers of a computer are listed with what to think of them and how to name them."""

import errno
import os
from dataclasses import replace

import pytest

from drivers.v4l2.computer import Computer
from grabberd.instrument.acquisition import GRABBERS
from grabberd.instrument.acquisition.device import Verdict
from grabberd_v4l2.abi import Arrangement
from grabberd_v4l2.discovery import Answers, discover
from grabberd_v4l2.profiles import Profiles

DONGLE = Answers(
    "stk1160",
    "Easy Cap",
    captures=True,
    inputs=("Composite0", "S-Video"),
    standards=("PAL", "NTSC"),
    at_50_hz=True,
    standard_now="NTSC",
    formats=("UYVY",),
    field_orders=(Arrangement.INTERLACED,),
)
STICK = Answers(
    "uvcvideo", "AV TO USB2.0", captures=True, formats=("YUYV",), field_orders=(Arrangement.NONE,)
)
WEBCAM = Answers(
    "uvcvideo",
    "HD camera",
    captures=True,
    formats=("YUYV", "MJPG"),
    field_orders=(Arrangement.NONE,),
    pictures="YUYV 640×480 at 30; MJPG 1280×720 at 60, 30",
)
METADATA = Answers("uvcvideo", "AV stick", captures=False)


@pytest.fixture
def computer(tmp_path):
    return Computer(tmp_path)


def found(computer, answers=DONGLE):
    """All devices, the node's name or all of them answering; an errno refuses."""

    def answer(path):
        told = answers.get(path.name, DONGLE) if isinstance(answers, dict) else answers
        if isinstance(told, int):
            raise OSError(told, os.strerror(told))
        return told

    return discover(computer.roots, answer)


def test_a_computer_without_grabbers_has_none(computer):
    assert found(computer) == ()


def test_a_dongle_is_listed_with_everything_that_is_known(computer):
    node = computer.plug_dongle(0, port="1-2.3", serial="7", name="Easy Cap")
    computer.link("by-id", "usb-Easy_Cap_7-video-index0", node)
    (device,) = found(computer)
    assert (device.driver, device.card, device.verdict) == ("v4l2", "Easy Cap", Verdict.USABLE)
    assert dict(device.facts) == {
        "node": str(node),
        "kernel driver": "stk1160",
        "by-path": f"{computer.dev}/v4l/by-path/pci-0000:00:14.0-usb-0:2.3:1.0-video-index0",
        "by-id": f"{computer.dev}/v4l/by-id/usb-Easy_Cap_7-video-index0",
        "USB": "05e1:0408 Easy Cap",
        "serial": "7",
        "port": "1-2.3",
        "speed": "480 Mbit/s",
        "inputs": "Composite0, S-Video",
        "standards": "PAL, NTSC",
        "formats": "UYVY",
        "field orders": "interlaced",
    }


def test_it_is_named_by_its_link_first_and_by_all_else_too(computer):
    computer.plug_dongle(0, port="1-2")
    (device,) = found(computer)
    assert device.options == {"device": device.facts["by-path"]}
    assert device.other_options == (
        {"usb": "05e1:0408"},
        {"usb": "05e1:0408", "port": "1-2"},
        {"device": f"{computer.dev}/video0"},
    )


def test_of_two_equal_ones_none_is_named_without_port_or_serial(computer):
    computer.plug_dongle(0, port="1-2", serial="A")
    computer.plug_dongle(1, port="2-1", serial="B")
    for device in found(computer):
        assert {"usb": "05e1:0408"} not in device.other_options
        assert {"usb": "05e1:0408", "serial": device.facts["serial"]} in device.other_options


def test_what_udev_made_no_link_for_is_named_by_usb_or_node_and_that_is_said(computer):
    for number in (computer.plug_dongle(0), computer.plug_card(1)):
        computer.pull_links(number)
    dongle, card = found(computer)
    assert dongle.options == {"usb": "05e1:0408"}
    assert card.options == {"device": f"{computer.dev}/video1"}
    assert all("no link" in device.remarks[-1] for device in (dongle, card))


def test_every_way_to_name_it_is_one_that_the_driver_takes_and_finds(computer):
    computer.plug_dongle(0, port="1-2", serial="A")
    computer.plug_dongle(1, port="2-1", serial="B")
    computer.plug_card(2)
    for device in found(computer):
        for options in (device.options, *device.other_options):
            grabber = GRABBERS.create("v4l2", options)
            assert str(grabber.options.identity)
            assert device.is_meant_by("v4l2", options)


@pytest.mark.parametrize(
    ("driver", "verdict"),
    [("bttv", "recommended"), ("stk1160", "usable"), ("usbtv", "doubtful"), ("uvcvideo", "usable")],
)
def test_the_verdict_is_that_of_the_drivers_profile(computer, driver, verdict):
    computer.plug_dongle(0)
    (device,) = found(computer, Answers(driver, "card", True, (), ("PAL",), True, "PAL", ("GREY",)))
    assert device.verdict == verdict
    assert len(device.remarks) >= 1


def test_a_stick_that_throws_a_field_away_is_unusable_and_its_metadata_node_is_not_listed(computer):
    computer.plug_dongle(0, driver="uvcvideo", vendor_product="534d:0021")
    interface = (computer.sys / "class/video4linux/video0").resolve().parent.parent
    computer.add_node(1, interface, "uvcvideo", index=1)
    (device,) = found(computer, {"video0": STICK, "video1": METADATA})
    assert device.verdict is Verdict.UNUSABLE
    assert any("throws one field" in remark for remark in device.remarks)
    assert any("Bt878" in remark for remark in device.remarks)


def test_all_channels_of_one_card_are_listed(computer):
    device = computer.sys / "devices/pci0000:00/0000:05:00.0"
    for number in range(4):
        computer.add_node(number, device, "tw686x", path_id="pci-0000:05:00.0", index=number)
    assert len({one.options["device"] for one in found(computer)}) == 4


def test_a_digital_camera_is_usable_and_its_sizes_and_rates_are_listed(computer):
    computer.plug_dongle(0, driver="uvcvideo", vendor_product="046d:0825")
    (device,) = found(computer, WEBCAM)
    assert device.verdict is Verdict.USABLE
    assert device.facts["pictures a second"] == "YUYV 640×480 at 30; MJPG 1280×720 at 60, 30"
    assert any("'size', 'rate_hz'" in remark for remark in device.remarks)


def test_a_node_with_neither_a_standard_nor_progressive_pictures_is_unusable(computer):
    computer.plug_card(0)
    (device,) = found(computer, Answers("strange", "card", True, formats=("GREY",)))
    assert device.verdict is Verdict.UNUSABLE
    assert any("grants no progressive pictures" in remark for remark in device.remarks)


def test_a_card_without_50_hz_names_the_option_for_its_standards(computer):
    computer.plug_card(0)
    (device,) = found(computer, Answers("bttv", "card", True, ("In",), ("NTSC",), False, "NTSC", ("GREY",)))
    assert device.verdict is Verdict.RECOMMENDED
    assert any("only NTSC: set the option 'standard'" in remark for remark in device.remarks)


def test_a_card_without_a_format_that_can_be_read_is_unusable(computer):
    computer.plug_card(0)
    answers = Answers("bttv", "card", True, ("In",), ("PAL",), True, "PAL", (), ("MJPG",))
    (device,) = found(computer, answers)
    assert device.verdict is Verdict.UNUSABLE
    assert any("only MJPG" in remark for remark in device.remarks)


def test_a_camera_none_of_whose_pictures_can_be_taken_is_unusable(computer):
    computer.plug_dongle(0, "uvcvideo")
    (one,) = found(computer, replace(WEBCAM, pictures="MJPG 0×480 at 30", can_be_taken=False))
    assert one.verdict is Verdict.UNUSABLE
    assert any("MJPG 0×480 at 30" in remark for remark in one.remarks)


def test_a_dongle_at_usb_1_1_speed_is_unusable(computer):
    computer.plug_dongle(0, speed="12")
    (device,) = found(computer)
    assert device.verdict is Verdict.UNUSABLE
    assert any("USB 1.1" in remark for remark in device.remarks)


def test_a_driver_that_starts_in_ntsc_is_remarked_on(computer):
    computer.plug_dongle(0)
    (device,) = found(computer)
    assert any("set to NTSC now" in remark for remark in device.remarks)


def test_two_dongles_on_one_bus_are_remarked_on(computer):
    computer.plug_dongle(0, port="1-2")
    computer.plug_dongle(1, port="1-3")
    assert all(any("shares USB bus 1" in word for word in one.remarks) for one in found(computer))


@pytest.mark.parametrize(("number", "says"), [(errno.EACCES, "group video"), (errno.EIO, "error")])
def test_one_that_cannot_be_asked_is_listed_with_the_reason(computer, number, says):
    computer.plug_dongle(0)
    (device,) = found(computer, number)
    assert device.verdict is Verdict.USABLE
    assert says in device.remarks[0]
    assert device.facts["kernel driver"] == "stk1160"
    assert "formats" not in device.facts


def test_a_broken_profile_is_named(computer, tmp_path):
    computer.plug_dongle(0)
    (tmp_path / "mine.yaml").write_text("driver: [")
    (device,) = discover(computer.roots, lambda path: DONGLE, Profiles.load(tmp_path))
    assert any("mine.yaml is not used" in remark for remark in device.remarks)
