"""The configuration: what is accepted, and how everything that is wrong is said at once."""

from pathlib import Path

import pytest

from grabberd.config import (
    HttpConfig,
    default_config_file,
    default_state_directory,
    load_config,
    load_sound_part,
    shipped_configs,
)
from grabberd.errors import ConfigError

MINIMAL = "devices: {one: {driver: fake}}\n"


def problems_of(folder: Path, text: str) -> dict[str, str]:
    file = folder / "grabberd.yaml"
    file.write_text(text)
    with pytest.raises(ConfigError) as caught:
        load_config(file)
    assert all(problem.file == str(file) for problem in caught.value.problems)
    return {problem.key: problem.message for problem in caught.value.problems}


def test_every_shipped_configuration_loads() -> None:
    files = sorted(shipped_configs().glob("*.yaml"))
    assert default_config_file() in files
    for file in files:
        assert load_config(file).devices


def test_one_device_with_a_driver_is_enough(tmp_path: Path) -> None:
    file = tmp_path / "grabberd.yaml"
    file.write_text(MINIMAL)
    device = load_config(file).devices["one"]
    assert (device.ring.slots, device.ring.bits, device.threshold.kind) == (None, 1, "automatic")


def test_relative_paths_count_from_the_file(tmp_path: Path) -> None:
    (tmp_path / "rig.json").write_text("{}")
    file = tmp_path / "grabberd.yaml"
    file.write_text("devices: {one: {driver: fake, calibration: rig.json}}")
    assert load_config(file).devices["one"].calibration == (tmp_path / "rig.json").resolve()


def test_all_problems_are_named_at_once(tmp_path: Path) -> None:
    found = problems_of(
        tmp_path,
        """
devices:
  one:
    driver: fake
    focal: 3
    calibration: nowhere.json
    rig:
      distance: 240
      base_mm: 0.128
      views: {left: {first_column: 0, end_column: 400}, right: {first_column: 360, end_column: 720}}
http: {port: hello}
""",
    )
    assert set(found) == {
        "devices.one.focal",
        "devices.one.calibration",
        "devices.one.rig.distance",
        "devices.one.rig.base_mm",
        "devices.one.rig.views",
        "http.port",
    }


def test_an_unknown_key_is_answered_with_the_nearest_known_one(tmp_path: Path) -> None:
    found = problems_of(tmp_path, "devices: {one: {driver: fake, rig: {distance: 240}}}")
    assert found["devices.one.rig.distance"] == "unknown key; did you mean distance_mm?"


def test_a_value_in_the_wrong_unit_is_answered_with_the_right_one(tmp_path: Path) -> None:
    found = problems_of(tmp_path, "devices: {one: {driver: fake, rig: {base_mm: 0.128}}}")
    assert "this key is in millimetres" in found["devices.one.rig.base_mm"]


@pytest.mark.parametrize(
    ("keys", "at", "says"),
    [
        (
            "threshold: {map: yes}",
            "threshold.map",
            "'yes' (line 4, column 22: a text in YAML 1.2; for a truth value",
        ),
        ("threshold: {map: NO}", "threshold.map", "value write false) is not true or false"),
        (
            "rig: {distance_mm: 4:00}",
            "rig.distance_mm",
            "not '4:00' (line 4, column 24: a text in YAML 1.2; for a",
        ),
        ("rig: {distance_mm: 1_000}", "rig.distance_mm", "for a number write 1000) is not a number"),
        ("ring: {slots: 0b100000}", "ring.slots", "for a number write 32)"),
    ],
)
def test_a_word_of_yaml_1_1_is_answered_with_its_place_and_what_to_write(tmp_path, keys, at, says):
    text = f"devices:\n  one:\n    driver: fake\n    {keys}\n"
    assert says in problems_of(tmp_path, text)[f"devices.one.{at}"]


@pytest.mark.parametrize(("slots", "number"), [("0o44", 36), ("036", 36), ("+36", 36), ("3.6e1", 36)])
def test_numbers_of_yaml_1_2_are_read(tmp_path: Path, slots: str, number: int) -> None:
    file = tmp_path / "grabberd.yaml"
    file.write_text(f"devices: {{one: {{driver: fake, ring: {{slots: {slots}}}}}}}")
    assert load_config(file).devices["one"].ring.slots == number


@pytest.mark.parametrize(
    ("views", "says"),
    [
        ("left: {first_column: 0, end_column: 400}", "overlap"),
        ("left: {first_column: 300, end_column: 300}", "has no columns"),
        ("right: {first_column: 360, end_column: 800}", "the picture has 720"),
    ],
)
def test_impossible_views_are_refused(tmp_path: Path, views: str, says: str) -> None:
    found = problems_of(tmp_path, f"devices: {{one: {{driver: fake, rig: {{views: {{{views}}}}}}}}}")
    assert any(says in message for message in found.values())


def test_a_missing_calibration_is_named_with_its_full_path(tmp_path: Path) -> None:
    found = problems_of(tmp_path, "devices: {one: {driver: fake, calibration: nowhere.json}}")
    assert str(tmp_path / "nowhere.json") in found["devices.one.calibration"]


def test_a_fixed_threshold_needs_its_value_and_no_other_has_one(tmp_path: Path) -> None:
    for threshold in ("{kind: fixed}", "{kind: automatic, value: 60}"):
        found = problems_of(tmp_path, f"devices: {{one: {{driver: fake, threshold: {threshold}}}}}")
        assert "kind fixed requires 'value'" in found["devices.one.threshold"]


def test_a_map_of_thresholds_is_for_automatic_and_one_bit(tmp_path: Path) -> None:
    fixed = "threshold: {kind: fixed, value: 60, map: true}"
    found = problems_of(tmp_path, f"devices: {{one: {{driver: fake, {fixed}}}}}")
    assert "'map' requires kind automatic" in found["devices.one.threshold"]
    grey = "ring: {bits: 8}, threshold: {map: true}"
    found = problems_of(tmp_path, f"devices: {{one: {{driver: fake, {grey}}}}}")
    assert "threshold.map needs ring.bits: 1, not 8" in found["devices.one"]


@pytest.mark.parametrize("text", ["devices: [", "devices: {one: {driver: fake, driver: replay}}", "\x00"])
def test_what_is_no_yaml_or_says_a_thing_twice_is_refused(tmp_path: Path, text: str) -> None:
    assert set(problems_of(tmp_path, text)) == {"(file)"}


def test_a_missing_file_is_a_problem_like_any_other(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="No such file"):
        load_config(tmp_path / "nowhere.yaml")


@pytest.mark.parametrize("text", ["", "[]", "devices: {}", "devices: {'B B': {driver: fake}}"])
def test_a_configuration_without_usable_devices_is_refused(tmp_path: Path, text: str) -> None:
    assert problems_of(tmp_path, text)


def test_the_state_directory_is_systemds_then_the_users(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STATE_DIRECTORY", "/var/lib/grabberd:/var/lib/other")
    assert default_state_directory() == Path("/var/lib/grabberd")
    monkeypatch.delenv("STATE_DIRECTORY")
    monkeypatch.setenv("XDG_STATE_HOME", "/home/somebody/state")
    assert default_state_directory() == Path("/home/somebody/state/grabberd")


@pytest.mark.parametrize("name", ["a" * 5000, "~nobody-of-this-name/x", "a\\0b", "loop"])
def test_a_path_that_leads_nowhere_is_a_problem_of_its_key(tmp_path: Path, name: str) -> None:
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    text = f'devices: {{a: {{driver: fake, calibration: "{name}"}}}}'
    assert any("calibration" in str(one) for one in problems_of(tmp_path, text))


def test_a_file_without_keys_is_told_in_plain_words(tmp_path: Path) -> None:
    for text, says in (
        ("", "grabberd.yaml is empty: "),
        ("# later\n", "is empty: "),
        ("- a\n", "has no keys"),
    ):
        assert says in problems_of(tmp_path, text)["(file)"]


def test_a_folder_in_place_of_the_file_is_called_one(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="a folder, not a file") as caught:
        load_config(tmp_path)
    assert "name a configuration file" in caught.value.hint


def test_a_name_that_is_none_is_answered_with_what_names_are_made_of(tmp_path: Path) -> None:
    found = problems_of(tmp_path, "devices: {'B B': {driver: fake}}")
    assert "small letters" in found["devices.B B"]


def test_a_missing_key_is_said_so(tmp_path: Path) -> None:
    assert problems_of(tmp_path, "devices: {one: {}}")["devices.one.driver"] == "this key is missing"


SEVERAL = """
devices:
  typo: {driver: fake, options: {speed: 3}, rig: {distance: 240}}
  sound: {driver: nonsuch, ring: {bits: 8}}
loggers:
  vacuum: {driver: lpt, chanels: {}}
http: {port: hello}
"""


def test_what_is_sound_of_a_configuration_is_kept_for_further_checks(tmp_path: Path) -> None:
    file = tmp_path / "grabberd.yaml"
    file.write_text(SEVERAL)
    config, problems, loggers = load_sound_part(file)
    assert config is not None
    assert {problem.key for problem in problems} == {
        "devices.typo.rig.distance",
        "loggers.vacuum.chanels",
        "loggers.vacuum.channels",
        "http.port",
    }
    assert config.devices["sound"].ring.bits == 8
    assert config.devices["typo"].options == {"speed": 3}
    assert loggers == {"vacuum": ("lpt", {})}


@pytest.mark.parametrize("text", ["devices: 3", "device: {one: {driver: fake}}", "devices: {one: 3}"])
def test_where_nothing_is_sound_the_problems_remain(tmp_path: Path, text: str) -> None:
    file = tmp_path / "grabberd.yaml"
    file.write_text(text)
    found = load_sound_part(file)
    assert found.config is None
    assert found.problems


def test_a_configuration_without_problems_is_sound_as_a_whole(tmp_path: Path) -> None:
    file = tmp_path / "grabberd.yaml"
    file.write_text(MINIMAL)
    assert load_sound_part(file).config == load_config(file)


@pytest.mark.parametrize(
    ("http", "url"),
    [
        ({}, "http://127.0.0.1:8050"),
        ({"port": 8051}, "http://127.0.0.1:8051"),
        ({"host": "0.0.0.0", "hosts": ["barn.local"]}, "http://127.0.0.1:8050"),
        ({"host": "::", "port": 80}, "http://[::1]:80"),
        ({"host": "192.168.1.5"}, "http://192.168.1.5:8050"),
        ({"host": "0.0.0.0", "tls": True}, "https://127.0.0.1:8050"),
        ({"host": "0.0.0.0", "tls": True, "hosts": ["barn.local"]}, "https://barn.local:8050"),
    ],
)
def test_programs_on_this_computer_find_the_daemon_at_its_configured_address(
    tmp_path: Path, http: dict[str, object], url: str
) -> None:
    (tmp_path / "pem").touch()
    if http.pop("tls", False):
        http["tls"] = {"certificate": str(tmp_path / "pem"), "key": str(tmp_path / "pem")}
    assert HttpConfig.model_validate(http).url == url


@pytest.mark.parametrize(
    ("places", "problem"),
    [
        ([(45, 37), (46, 38), (314, 508)], "marks 1 and 2 are 1.41 px apart"),
        ([(45, 37), (314, 508), (404, 66)], "the right view has a single mark"),
        ([(45, 37), (314, 570)], "mark 2 at column 314, line 570 lies less than 15 px inside a view"),
        ([(45, 37), (355, 508)], "mark 2 at column 355"),
        ([(45, 37), (314, 508)], None),
        ([], None),
    ],
)
def test_marks_that_cannot_be_located_are_refused_with_the_reason(
    tmp_path: Path, places: list[tuple[int, int]], problem: str | None
) -> None:
    marks = ", ".join(f"{{x_px: {x}, y_px: {y}}}" for x, y in places)
    text = f"devices: {{one: {{driver: fake, marks: [{marks}]}}}}\n"
    if problem:
        (message,) = problems_of(tmp_path, text).values()
        assert problem in message
    else:
        (tmp_path / "grabberd.yaml").write_text(text)
        assert len(load_config(tmp_path / "grabberd.yaml").devices["one"].marks) == len(places)
