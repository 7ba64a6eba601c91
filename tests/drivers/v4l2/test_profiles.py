"""What is known of each driver of the kernel, and how an installer overrides it."""

import pytest

from grabberd.core.field import BOTTOM, TOP
from grabberd.instrument.acquisition import Verdict
from grabberd_v4l2.abi import Arrangement
from grabberd_v4l2.profiles import Profiles, SignalSource

DRIVERS = (
    "bttv",
    "saa7146 v4l2",
    "saa7134",
    "cx8800",
    "cx23885",
    "tw68",
    "tw686x",
    "em28xx",
    "stk1160",
    "usbtv",
    "uvcvideo",
    "vivid",
    "dt3155",
)
BUILT_IN = Profiles.load()
STICK = "uvcvideo 534d:0021"


def load(directory, **texts):
    for name, text in texts.items():
        (directory / f"{name}.yaml").write_text(text)
    return Profiles.load(directory)


# --- what is built in ---


def test_every_driver_of_a_known_card_has_a_profile():
    assert {profile.driver for profile in BUILT_IN.by_driver.values()} == {*DRIVERS, STICK, "default"}
    assert BUILT_IN.remarks == ()


@pytest.mark.parametrize("driver", DRIVERS)
def test_every_profile_asks_for_an_arrangement_and_says_what_to_think_of_it(driver):
    profile = BUILT_IN.of(driver)
    assert profile.field_orders
    assert Arrangement.ANY not in profile.field_orders
    assert profile.remarks


def test_cards_with_single_fields_are_asked_for_them_first():
    first = {driver for driver in DRIVERS if BUILT_IN.of(driver).field_orders[0] is Arrangement.ALTERNATE}
    assert first == {"bttv", "saa7146 v4l2", "vivid"}


def test_only_one_drivers_bottom_field_is_older():
    assert [driver for driver in DRIVERS if BUILT_IN.of(driver).older_parity == BOTTOM] == ["usbtv"]


def test_only_one_driver_weaves_and_says_none():
    assert [driver for driver in DRIVERS if BUILT_IN.of(driver).none_is_woven] == ["dt3155"]


def test_the_counts_of_few_drivers_tell_of_losses():
    assert {d for d in DRIVERS if BUILT_IN.of(d).trusts_sequence} == {"bttv", "uvcvideo", "vivid"}


def test_each_driver_is_asked_for_the_signal_where_it_knows_it():
    asked = {
        source: {d for d in DRIVERS if BUILT_IN.of(d).signal_source is source} for source in SignalSource
    }
    assert asked[SignalSource.ENUMINPUT] == {"bttv", "saa7134", "tw68", "tw686x", "vivid"}
    assert asked[SignalSource.QUERYSTD] == {"em28xx", "stk1160"}


def test_sticks_that_throw_fields_away_are_unusable_and_the_advice_says_what_to_use():
    profile = BUILT_IN.of("uvcvideo", "534d:0021")
    assert profile.verdict is Verdict.UNUSABLE
    assert "Bt878" in profile.advice


def test_other_devices_of_their_driver_are_cameras():
    profile = BUILT_IN.of("uvcvideo", "046d:0825")
    assert profile.verdict is Verdict.USABLE
    assert profile.trusts_sequence


def test_a_card_is_found_by_each_of_its_drivers_names():
    names = (
        "saa7146 v4l2",
        "saa7146",
        "hexium_orion",
        "hexium HV-PCI6 Orion",
        "hexium_gemini",
        "hexium gemini",
    )
    assert len({id(BUILT_IN.of(name)) for name in names}) == 1


def test_of_a_driver_that_nobody_knows_little_is_believed():
    profile = BUILT_IN.of("brandnew")
    assert profile.driver == "brandnew"
    assert profile.verdict is Verdict.DOUBTFUL
    assert not profile.trusts_sequence
    assert (profile.older_parity, profile.signal_source) == (None, SignalSource.NONE)


# --- the installer's own ---


def test_an_installer_overrides_key_by_key(tmp_path):
    profile = load(tmp_path, mine="driver: bttv\nolder: bottom\n").of("bttv")
    assert profile.older_parity == BOTTOM
    assert profile.trusts_sequence
    assert profile.field_orders == BUILT_IN.of("bttv").field_orders


def test_an_installer_may_describe_a_driver_that_nobody_knew(tmp_path):
    profiles = load(tmp_path, new="driver: newcard\nverdict: usable\ntrusts_sequence: true\n")
    assert profiles.of("newcard").trusts_sequence
    assert profiles.of("newcard").verdict is Verdict.USABLE
    assert profiles.of("newcard").field_orders == BUILT_IN.of("default").field_orders


def test_a_card_known_by_another_name_is_overridden_by_that_name_too(tmp_path):
    profiles = load(tmp_path, mine="driver: hexium_orion\nolder: bottom\n")
    assert profiles.of("saa7146 v4l2").older_parity == BOTTOM
    assert profiles.of("saa7146 v4l2").field_orders[0] is Arrangement.ALTERNATE


def test_an_installer_may_describe_one_device_of_a_driver(tmp_path):
    profiles = load(tmp_path, mine="driver: uvcvideo 1234:5678\ntrusts_sequence: false\n")
    assert not profiles.of("uvcvideo", "1234:5678").trusts_sequence
    assert profiles.of("uvcvideo", "1234:5678").field_orders == BUILT_IN.of("uvcvideo").field_orders
    assert profiles.of("uvcvideo", "046d:0825").trusts_sequence


def test_without_a_directory_the_built_in_ones_are_used(tmp_path):
    assert Profiles.load(tmp_path / "nowhere").by_driver == BUILT_IN.by_driver


def test_what_is_no_yaml_file_is_not_read(tmp_path):
    (tmp_path / "README").write_text("not: [a profile")
    assert Profiles.load(tmp_path).remarks == ()


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("driver: bttv\nolder: middle\n", "older"),
        ("driver: bttv\nfavourite: yes\n", "favourite: Extra inputs are not permitted"),
        ("driver: bttv\nfield_orders: [alternate, woven]\n", "woven: none of none, top, bottom"),
        ("driver: bttv\nfield_orders: [any]\n", "any: none of none, top"),
        ("driver: bttv\nfield_orders: alternate\n", "a list of field orders is expected"),
        ("driver: bttv\ntime_sigma_ms: -1\n", "time_sigma_ms"),
        ("driver: [bttv\n", "flow sequence"),
        ("- bttv\n", "it has no key 'driver'"),
        ("", "it has no key 'driver'"),
        ("older: bottom\n", "it has no key 'driver'"),
        ("driver: bttv\nolder: \x01\n", "special characters"),
    ],
)
def test_a_broken_file_is_named_and_the_built_in_profile_is_used(tmp_path, text, complaint):
    profiles = load(tmp_path, broken=text, good="driver: usbtv\nolder: top\n")
    (remark,) = profiles.remarks
    assert str(tmp_path / "broken.yaml") in remark
    assert complaint in remark
    assert "\n" not in remark
    assert profiles.of("bttv") == BUILT_IN.of("bttv")
    assert profiles.of("usbtv").older_parity == TOP


def test_everything_that_is_wrong_with_a_file_is_said_at_once(tmp_path):
    (remark,) = load(tmp_path, broken="driver: bttv\nolder: 1\nfavourite: x\nverdict: nice\n").remarks
    assert all(key in remark for key in ("older", "favourite", "verdict"))


def test_a_file_that_is_no_text_is_named(tmp_path):
    (tmp_path / "broken.yaml").write_bytes(b"driver: \xff\xfe")
    assert "broken.yaml" in Profiles.load(tmp_path).remarks[0]


def test_a_word_that_a_key_does_not_know_is_told_with_those_that_it_does(tmp_path):
    (remark,) = load(tmp_path, usbtv="driver: usbtv\nafter_gap: first\n").remarks
    assert "'older' or 'both'" in remark
