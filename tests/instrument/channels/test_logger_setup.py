"""Loggers from the configuration: drivers, channels, and all problems at once."""

from datetime import date
from pathlib import Path

import pytest

from grabberd.config import load_config
from grabberd.core.channels import Quantity
from grabberd.errors import ConfigError
from grabberd.instrument.channels.logger_setup import LoggerSetup, set_up_loggers

DEVICES = "devices: {cup1: {driver: fake}, cup2: {driver: fake}}\n"


def set_up(folder: Path, loggers: str) -> dict[str, LoggerSetup]:
    file = folder / "grabberd.yaml"
    file.write_text(f"{DEVICES}loggers:\n{loggers}")
    return set_up_loggers(load_config(file), file)


def problems_of(folder: Path, loggers: str) -> dict[str, str]:
    with pytest.raises(ConfigError) as caught:
        set_up(folder, loggers)
    return {problem.key: problem.message for problem in caught.value.problems}


def test_a_logger_is_made_from_its_driver_and_options_but_not_opened(tmp_path: Path) -> None:
    found = set_up(
        tmp_path,
        """
  vacuum:
    driver: serial
    options: {port: /dev/serial/by-id/nowhere, columns: [time_ms, "p1 [V]"]}
    delay_ms: 2.5
    channels:
      pulsation: {column: p1, gain: 25, sigma_kpa: 0.3, calibrated: 2026-05-01, devices: [cup1]}
""",
    )
    one = found["vacuum"]
    (channel,) = one.channels
    assert (channel.name, channel.quantity, channel.devices) == ("pulsation", Quantity.PULSATION, ("cup1",))
    assert channel.calibrated == date(2026, 5, 1).isoformat()
    assert one.config.delay_ns == 2_500_000


def test_a_channel_of_another_name_says_what_it_measures(tmp_path: Path) -> None:
    found = set_up(
        tmp_path,
        """
  vacuum:
    driver: fake
    channels:
      front: {quantity: pulsation, column: pulsation, sigma_kpa: 0.3, devices: [cup1]}
      rear: {quantity: pulsation, column: pulsation, sigma_kpa: 0.3, devices: [cup2]}
      milk_line: {column: milk_line, sigma_kpa: 0.3}
""",
    )
    assert [channel.quantity.value for channel in found["vacuum"].channels] == ["pulsation"] * 2 + [
        "milk_line"
    ]


def test_without_loggers_there_are_none(tmp_path: Path) -> None:
    file = tmp_path / "grabberd.yaml"
    file.write_text(DEVICES)
    assert set_up_loggers(load_config(file), file) == {}


def test_problems_of_all_loggers_are_named_at_once(tmp_path: Path) -> None:
    found = problems_of(
        tmp_path,
        """
  one: {driver: serial, options: {baud: 3}, channels: {liner: {column: p1, sigma_kpa: 0.3, devices: [cup9]}}}
  two: {driver: lpt, channels: {liner: {column: p1, sigma_kpa: 0.3}}}
""",
    )
    assert (
        "there is no driver 'lpt'; installed are: csv, fake, fake_light, gpio, iio, mqtt, rts, serial"
        in found["loggers.two.driver"]
    )
    assert "baud" in found["loggers.one.options"] or "port: missing" in found["loggers.one.options"]
    assert "there is no device cup9; known are: cup1, cup2" in found["loggers.one.channels.liner.devices"]


def test_a_device_has_each_quantity_once(tmp_path: Path) -> None:
    found = problems_of(
        tmp_path,
        """
  one: {driver: fake, channels: {pulsation: {column: pulsation, sigma_kpa: 0.3}}}
  two: {driver: fake, channels: {pulsation: {column: pulsation, sigma_kpa: 0.3, devices: [cup2]}}}
""",
    )
    words = "device cup2 has its pulsation from loggers.one.channels.pulsation already"
    assert found == {"loggers.two.channels.pulsation": words}


@pytest.mark.parametrize(
    ("channel", "says"),
    [
        ("pulsation: {column: p1}", "'sigma_kpa' is missing"),
        ("pulsation: {column: p1, sigma_kpa: 0}", "greater than 0"),
        ("pulsation: {column: p1, sigma_kpa: .3, gain: 0}", "gain 0"),
        ("pulsation: {column: p1, sigma_kpa: .3, unit: V}", "unit V requires gain"),
        ("pulsation: {column: p1, sigma_kpa: .3, unit: atm}", "kPa"),
        ("pulsation: {column: p1, sigma_kpa: .3, reference: absolute}", "requires atmosphere_kpa"),
        ("pulsation: {column: p1, sigma_kpa: .3, atmosphere_kpa: 98}", "only absolute takes it"),
        ("pulsation: {column: p1, sigma_kpa: .3, calibrated: yesterday}", "date"),
        ("front: {column: p1, sigma_kpa: .3}", "'quantity' is missing"),
        ("pulsation: {column: p1, sigma: .3}", "did you mean sigma_kpa?"),
    ],
)
def test_a_channel_that_cannot_be_is_refused(tmp_path: Path, channel: str, says: str) -> None:
    found = problems_of(tmp_path, f"  vacuum: {{driver: fake, channels: {{{channel}}}}}")
    assert any(says in message for message in found.values()), found
