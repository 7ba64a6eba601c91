"""Drivers that can look for devices tell what is there."""

import sys

import pytest

from grabberd.errors import DriverMissing
from grabberd.instrument.acquisition import device
from grabberd.instrument.acquisition.device import FoundDevice, Verdict

DRIVER = """
from grabberd.instrument.acquisition.device import FoundDevice, Verdict

def look():
    return [FoundDevice("barn", f"card {number}", {"path": number}, Verdict.USABLE) for number in (2, 1)]
"""
DONGLE = FoundDevice(
    "v4l2",
    "EasyCAP",
    {"device": "/dev/v4l/by-path/a"},
    Verdict.USABLE,
    other_options=({"usb": "05e1:0408", "port": "1-2"}, {"device": "/dev/video0"}),
)


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Installs a package that offers to look for devices."""

    def installed(*entries):
        info = tmp_path / "barn-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text("Metadata-Version: 2.1\nName: barn\nVersion: 1.0\n")
        (info / "entry_points.txt").write_text("\n".join(["[grabberd.discovery]", *entries]))
        (tmp_path / "barn_discovery.py").write_text(DRIVER)
        monkeypatch.syspath_prepend(tmp_path)

    yield installed
    sys.modules.pop("barn_discovery", None)


def test_what_a_driver_finds_is_listed_in_its_order(install):
    install("barn = barn_discovery:look")
    assert [one.card for one in device.discover() if one.driver == "barn"] == ["card 2", "card 1"]


@pytest.mark.parametrize("entry", ["barn = a_module_nobody_has:look", "barn = barn_discovery:gone"])
def test_a_driver_that_cannot_look_is_named(install, entry):
    install(entry)
    with pytest.raises(DriverMissing, match="'barn' cannot search for devices"):
        device.discover()


@pytest.mark.parametrize(
    "options",
    [
        {"device": "/dev/v4l/by-path/a"},
        {"device": "/dev/video0", "buffers": 12},
        {"usb": "05E1:0408", "port": "1-2"},
    ],
)
def test_a_device_is_meant_by_each_of_its_names(options):
    assert DONGLE.is_meant_by("v4l2", options)


@pytest.mark.parametrize("options", [{}, {"device": "/dev/video1"}, {"usb": "05e1:0408", "port": "1-3"}])
def test_a_device_is_not_meant_by_the_name_of_another(options):
    assert not DONGLE.is_meant_by("v4l2", options)


def test_a_device_is_not_meant_by_another_driver():
    assert not DONGLE.is_meant_by("other", DONGLE.options)


def test_entries_come_by_their_number_and_a_folder_that_is_missing_has_none(tmp_path):
    for name in ("video10", "video9", "media0"):
        (tmp_path / name).mkdir()
    assert [entry.name for entry in device.by_number(tmp_path, "video*")] == ["video9", "video10"]
    assert device.by_number(tmp_path / "nowhere", "video*") == []


def test_an_attribute_is_the_text_without_its_end_and_empty_where_it_is_missing(tmp_path):
    (tmp_path / "label").write_bytes(b"milk line\n\0")
    assert device.attribute(tmp_path / "label") == "milk line"
    assert device.attribute(tmp_path / "name") == ""
