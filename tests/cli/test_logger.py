"""`grabberd logger` as an installer meets it."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from grabberd.cli.app import app
from grabberd.cli.logger_listening import Chosen, Heard, chosen, document, listen, print_heard
from grabberd.config import load_config
from grabberd.errors import ConfigError
from grabberd.testing import ManualClock
from grabberd_fake import FakeLogger

CONFIG = """
devices: {cup: {driver: fake}}
loggers:
  vacuum:
    driver: fake
    options: {noise_kpa: 0.2}
    channels:
      pulsation: {column: pulsation, sigma_kpa: 0.3, calibrated: 2026-05-01}
      milk_line: {column: milk_line, sigma_kpa: 0.5}
"""


@pytest.fixture
def config(tmp_path: Path) -> Path:
    file = tmp_path / "grabberd.yaml"
    file.write_text(CONFIG)
    return file


def heard(config: Path, **options: object) -> Heard:
    """Five simulated seconds."""
    one, clock = chosen(load_config(config), config, None), ManualClock()
    logger = FakeLogger(clock=clock, **({"noise_kpa": 0.2} | options))
    return listen(Chosen(one.name, logger, one.channels), 5.0, clock)


def run(*words: object) -> Result:
    return CliRunner().invoke(app, ["logger", *(str(word) for word in words)], env={"COLUMNS": "120"})


def test_rate_sigma_columns_and_channels_are_shown(config: Path, capsys: pytest.CaptureFixture[str]) -> None:
    print_heard(heard(config), json=False)
    shown = capsys.readouterr().out
    assert "vacuum: simulated logger (fake)" in shown
    assert "readings/s in 5 s, σ of their times" in shown
    assert "mouthpiece" in shown
    assert "In kPa below atmosphere" in shown
    assert "2026-05-01" in shown
    assert "never calibrated" in shown
    assert "No anomalies." in shown


def test_json_has_everything(config: Path) -> None:
    found = json.loads(json.dumps(document(heard(config))))
    assert found["rate_hz"] == pytest.approx(200, rel=0.01)
    assert found["columns"]["milk_line"]["mean"] == pytest.approx(44, abs=0.1)
    assert found["columns"]["milk_line"]["noise"] == pytest.approx(0.2, rel=0.2)
    assert found["channels"]["pulsation"]["kpa"]["greatest"] == pytest.approx(42, abs=1.5)
    assert found["anomalies"] == {}


def test_what_is_wrong_is_counted_with_an_example(config: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = heard(config, nonsense=0.1, faults=[{"kind": "other_unit", "at_s": 2, "for_s": 9}])
    print_heard(found, json=False)
    shown = capsys.readouterr().out
    assert "× not a number" in shown
    assert "an impossible vacuum" in shown
    assert "mbar" in shown
    assert document(found)["lost"] > 0


def test_a_logger_that_says_nothing_is_said_so(config: Path, capsys: pytest.CaptureFixture[str]) -> None:
    print_heard(heard(config, faults=[{"kind": "silent", "at_s": 0, "for_s": 99}]), json=False)
    shown = capsys.readouterr().out
    assert "no readings in 5 s" in shown
    assert "Nothing was received" in shown


def test_a_configuration_that_does_not_fit_still_shows_what_is_said(
    config: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    config.write_text(CONFIG.replace("column: milk_line", "column: p9"))
    print_heard(heard(config), json=False)
    shown = capsys.readouterr().out
    assert "does not fit: milk_line: the logger has no column p9" in shown
    assert "mouthpiece" in shown


def test_the_only_logger_need_not_be_named_and_one_that_is_not_there_is_answered(config: Path) -> None:
    settings = load_config(config)
    assert chosen(settings, config, None).name == "vacuum"
    with pytest.raises(ConfigError, match="no logger 'vaccum' to listen to; configured are: vacuum"):
        chosen(settings, config, "vaccum")


def test_a_logger_need_not_be_configured() -> None:
    made = chosen(load_config(Path("configs/fake.yaml").resolve()), None, "fake:")
    assert isinstance(made.logger, FakeLogger)
    assert made.channels == ()


def test_the_command_listens_in_real_time(config: Path) -> None:
    result = run("vacuum", "--config", config, "--seconds", "0.5", "--json")
    assert result.exit_code == 0
    assert json.loads(result.stdout)["readings"] > 50


def test_a_port_that_is_not_there_is_an_error_with_a_hint(tmp_path: Path) -> None:
    result = run(f"serial:{tmp_path}/ttyUSB9", "--seconds", "0.5")
    assert result.exit_code != 0
