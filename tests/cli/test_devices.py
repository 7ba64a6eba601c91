"""`grabberd devices` as an installer meets it: what is there, what to think of it, what to write."""

import json
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from drivers.v4l2.computer import Computer
from grabberd.cli.app import app
from grabberd.cli.devices_listing import print_listing, yaml_of
from grabberd.config import load_config
from grabberd.instrument.acquisition import GRABBERS
from grabberd.instrument.acquisition.device import FoundDevice, Verdict
from grabberd_v4l2.discovery import Answers, discover

BARN = """
from grabberd.instrument.acquisition.device import FoundDevice, Verdict

CARD = FoundDevice(
    "barn",
    "Bt878 in the barn",
    {"path": "/dev/v4l/by-path/pci-0000:04:00.0-video-index0"},
    Verdict.RECOMMENDED,
    ("Single fields at 50 Hz.",),
    {"node": "/dev/video0", "standards": "PAL, NTSC"},
    ({"path": "/dev/video0"},),
)
STICK = FoundDevice("barn", "AV [bold]stick\\x1b[31m", {"path": "/dev/video1"}, Verdict.UNUSABLE)

def look():
    return CARD, STICK
"""


@pytest.fixture
def barn(tmp_path, monkeypatch):
    """A driver that finds both devices."""
    info = tmp_path / "barn-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: barn\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[grabberd.discovery]\nbarn = barn_devices:look\n")
    (tmp_path / "barn_devices.py").write_text(BARN)
    monkeypatch.syspath_prepend(tmp_path)
    yield
    sys.modules.pop("barn_devices", None)


@pytest.fixture
def config(tmp_path) -> Path:
    file = tmp_path / "grabberd.yaml"
    file.write_text("devices: {grabber: {driver: barn, options: {path: /dev/video0, gain: 2}}}")
    return file


def run(*words: object) -> Result:
    return CliRunner().invoke(app, ["devices", *(str(word) for word in words)], env={"COLUMNS": "80"})


@pytest.mark.usefixtures("barn")
def test_a_grabber_is_shown_with_verdict_facts_and_remarks():
    shown = run().output
    assert "Bt878 in the barn  recommended\n" in shown
    assert "  standards  PAL, NTSC" in shown
    assert "• Single fields at 50 Hz." in shown


@pytest.mark.usefixtures("barn")
def test_the_listing_fits_into_80_columns():
    assert max(len(line.rstrip()) for line in run().output.splitlines()) <= 80


@pytest.mark.usefixtures("barn")
def test_a_name_that_a_device_gives_itself_cannot_format_or_colour_anything():
    shown = run().output
    assert "AV [bold]stick [31m  unusable" in shown
    assert "\x1b" not in shown


@pytest.mark.usefixtures("barn")
def test_what_is_not_configured_is_printed_as_yaml_to_paste_and_nothing_unusable(tmp_path):
    file = tmp_path / "pasted.yaml"
    file.write_text("devices:\n" + run().output.partition("\ndevices:\n")[2])
    (device,) = [one for one in load_config(file).devices.values() if one.driver == "barn"]
    assert device.options == {"path": "/dev/v4l/by-path/pci-0000:04:00.0-video-index0"}


@pytest.mark.usefixtures("barn")
def test_a_configured_device_is_shown_as_such_and_not_to_be_written_again(config):
    shown = run("--config", config).output
    assert "configured as grabber" in shown
    assert "driver: barn" not in shown


@pytest.mark.usefixtures("barn")
def test_a_configured_device_that_is_not_there_is_said(config, tmp_path):
    config.write_text("devices: {grabber: {driver: barn, options: {path: /dev/video7}}}")
    assert "not found" in run("--config", config).output


@pytest.mark.usefixtures("barn")
def test_json_has_everything(config):
    document = json.loads(run("--config", config, "--json").stdout)
    assert {"fake", "replay", "v4l2"} <= set(document["drivers"])
    assert document["devices"] == {
        "grabber": {"driver": "barn", "options": {"path": "/dev/video0", "gain": 2}}
    }
    card, stick = [one for one in document["found"] if one["driver"] == "barn"]
    assert (card["verdict"], card["configured_as"]) == ("recommended", ["grabber"])
    assert (stick["verdict"], stick["configured_as"]) == ("unusable", [])
    assert card["other_options"] == [{"path": "/dev/video0"}]


def test_nothing_found_says_what_to_look_at(capsys, config):
    print_listing(["barn"], load_config(config), [])
    shown = capsys.readouterr().out
    assert "No frame grabber was found" in shown
    assert "modprobe" in shown


def test_a_name_belongs_to_the_check():
    assert run("grabber").exit_code == 2


def test_what_the_v4l2_driver_finds_is_yaml_that_it_takes(tmp_path):
    computer = Computer(tmp_path / "computer")
    computer.plug_dongle(0, port="1-2")
    computer.plug_card(1)
    computer.pull_links(computer.plug_dongle(2, port="2-1.4", serial="0007"))
    answers = Answers("bttv", "card: Bt878 # two", True, ("In",), ("PAL",), True, "PAL", ("GREY",))
    found = discover(computer.roots, lambda path: answers)
    file = tmp_path / "pasted.yaml"
    file.write_text(yaml_of(found, {"grabber": None}))
    devices = load_config(file).devices
    assert list(devices) == ["grabber-2", "grabber-3", "grabber-4"]
    for one, device in zip(found, devices.values(), strict=True):
        assert device.options == one.options
        GRABBERS.create(device.driver, device.options)


def test_devices_get_names_that_are_free():
    device = FoundDevice("barn", "card", {"path": "/dev/video0"}, Verdict.USABLE)
    assert "  grabber-3:" in yaml_of([device], ["grabber", "grabber-2"])


@pytest.fixture
def found_loggers(tmp_path, monkeypatch):
    """A driver that finds one serial port."""
    info = tmp_path / "ports-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: ports\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[grabberd.logger_discovery]\nports = found_ports:look\n")
    (tmp_path / "found_ports.py").write_text(
        "from grabberd.instrument.acquisition.device import FoundDevice, Verdict\n"
        "def look():\n"
        "    return [FoundDevice('serial', 'usb-FTDI [bold]', {'port': '/dev/ttyUSB7'}, Verdict.USABLE)]\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    yield
    sys.modules.pop("found_ports", None)


LOGGER = """
loggers:
  vacuum:
    driver: serial
    options: {port: /dev/ttyUSB7, columns: [p1]}
    channels: {pulsation: {column: p1, unit: kPa, sigma_kpa: 0.3}}
"""


@pytest.mark.usefixtures("found_loggers")
def test_what_may_be_a_logger_is_listed_with_the_command_to_listen_to_it(tmp_path):
    file = tmp_path / "grabberd.yaml"
    file.write_text("devices: {grabber: {driver: fake}}")
    shown = run("--config", file).output
    assert "usb-FTDI [bold]" in shown
    assert "grabberd logger serial:" in shown
    assert "Drivers of loggers: csv, fake, fake_light, gpio, iio, mqtt, rts, serial." in shown


@pytest.mark.usefixtures("found_loggers")
def test_configured_loggers_are_listed_with_their_channels(tmp_path):
    file = tmp_path / "grabberd.yaml"
    file.write_text("devices: {grabber: {driver: fake}}" + LOGGER)
    shown = run("--config", file).output
    assert "configured as vacuum" in shown
    assert "pulsation" in shown
    document = json.loads(run("--config", file, "--json").stdout)
    assert document["loggers"]["vacuum"]["driver"] == "serial"
    (port,) = [one for one in document["found_loggers"] if one["options"] == {"port": "/dev/ttyUSB7"}]
    assert port["configured_as"] == ["vacuum"]
    assert "serial" in document["logger_drivers"]
