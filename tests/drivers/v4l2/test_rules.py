"""The files for udev and modprobe say what the driver needs."""

import re
from importlib.resources import files

import pytest

from grabberd.instrument.acquisition.device import Verdict
from grabberd_v4l2.discovery import RULE
from grabberd_v4l2.profiles import Profiles

FOLDER = files("grabberd_v4l2")
KEYS = {
    *("ACTION", "SUBSYSTEM", "KERNEL", "DRIVERS", "GOTO", "LABEL", "GROUP", "MODE", "TAG"),
    *("ENV{DEVTYPE}", "ENV{SYSTEMD_WANTS}", "ENV{PULSE_IGNORE}", "ENV{ACP_IGNORE}"),
    *("ATTR{idVendor}", "ATTR{idProduct}"),
}
PAIR = re.compile(r'([A-Za-z_]+(?:\{[A-Za-z_]+\})?)(==|!=|\+=|-=|=)"([^"]*)"')
PARAMETERS = {
    "snd-usb-audio": {"vid", "pid", "enable"},
    "tw686x": {"dma_mode"},
    "bttv": {"card"},
    "saa7134": {"card"},
}
"""Parameters of these modules in Linux 6.1 and 6.12, as modinfo lists them."""


def lines(path, comment="#"):
    text = FOLDER.joinpath(path).read_text().replace("\\\n", "")
    return [line.strip() for line in text.splitlines() if line.strip() and not line.startswith(comment)]


@pytest.fixture(scope="module")
def rules():
    """Of every rule its (key, operator, value)."""
    return [[match.groups() for match in PAIR.finditer(line)] for line in lines(f"udev/{RULE}")]


def values(rules, key):
    return [value for rule in rules for name, _, value in rule if name == key]


def test_every_rule_consists_of_known_pairs_and_nothing_else():
    for line in lines(f"udev/{RULE}"):
        assert re.fullmatch(r"[\s,]*", PAIR.sub("", line)), line
        assert {match[0] for match in PAIR.findall(line)} <= KEYS


def test_every_jump_has_one_target_further_down(rules):
    labels = {value: number for number, rule in enumerate(rules) for key, _, value in rule if key == "LABEL"}
    assert len(labels) == len(values(rules, "LABEL"))
    jumps = [(number, value) for number, rule in enumerate(rules) for key, _, value in rule if key == "GOTO"]
    assert all(labels[target] > number for number, target in jumps)


def test_rights_are_the_groups_and_nobody_elses(rules):
    assert set(values(rules, "MODE")) == {"0660", "0600"}
    assert set(values(rules, "GROUP")) == {"video", "root"}


def test_all_grabbers_on_usb_that_have_a_profile_may_be_reset(rules):
    allowed = {
        f"{vendor}:{product}"
        for rule in rules
        for vendor in values([rule], "ATTR{idVendor}")
        for product in values([rule], "ATTR{idProduct}")[0].split("|")
    }
    known = {
        one for profile in Profiles.load().by_driver.values() for one in profile.usb_ids if usable(profile)
    }
    assert known <= allowed
    assert all(re.fullmatch(r"[0-9a-f]{4}:[0-9a-f]{4}", one) for one in allowed)


def test_every_driver_that_is_of_use_starts_the_service_when_a_device_comes(rules):
    (wanting,) = [rule for rule in rules if "grabberd.service" in values([rule], "ENV{SYSTEMD_WANTS}")]
    drivers = set(values([wanting], "DRIVERS")[0].split("|"))
    assert ("TAG", "+=", "systemd") in wanting
    known = {profile.driver for profile in Profiles.load().by_driver.values() if usable(profile)}
    # /sys calls cards with SAA7146 by their maker.
    assert known - {"default", "vivid", "saa7146 v4l2"} | {"hexium*"} == drivers


def usable(profile):
    return profile.verdict is not Verdict.UNUSABLE


def test_the_options_of_modules_are_options_that_they_have():
    options = [line.lstrip("# ").split() for line in lines("modprobe/grabberd.conf", comment="\0")]
    options = [words for words in options if words[:1] == ["options"]]
    assert options
    for _, module, *parameters in options:
        assert {one.partition("=")[0] for one in parameters} <= PARAMETERS[module]


def test_only_the_sound_of_the_easycap_is_switched_off():
    (active,) = lines("modprobe/grabberd.conf")
    assert active == "options snd-usb-audio vid=0x05e1 pid=0x0408 enable=0"
