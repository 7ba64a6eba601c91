"""Points of a running daemon's fields on the command line."""

import csv
import io
import json
from collections.abc import Iterator

import pytest
from typer.testing import CliRunner

from grabberd.cli.app import app
from server.api.daemons import Daemon, serving


@pytest.fixture(scope="module")
def daemon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    with serving(tmp_path_factory.mktemp("points"), pace="real") as one:
        yield one


def printed(daemon: Daemon, *words: str) -> str:
    result = CliRunner().invoke(app, ["points", "--url", daemon.url, *words])
    assert result.exit_code == 0, result.output
    return result.stdout


def test_fields_are_printed_as_csv_with_their_standard_deviations(daemon: Daemon) -> None:
    rows = list(csv.DictReader(io.StringIO(printed(daemon, "--fields", "4"))))
    numbers = [int(row["n"]) for row in rows]
    assert len(set(numbers)) == 4
    assert numbers == sorted(numbers)
    assert all(0 < float(row["sigma_x_mm"]) < 1 > float(row["residual_px"]) for row in rows)
    assert max(abs(float(row["z_mm"])) for row in rows) < 100


def test_with_json_each_line_is_a_field_with_covariances(daemon: Daemon) -> None:
    lines = [json.loads(line) for line in printed(daemon, "--fields", "3", "--json").splitlines()]
    assert len(lines) == 3
    for line in lines:
        assert line["device"] == "simulated"
        assert line["calibration_id"]
        assert len(line["target"]) == len(line["xyz_mm"]) == len(line["covariance_mm2"])
        assert all(len(entries) == 6 for entries in line["covariance_mm2"])


def test_a_device_that_there_is_not_ends_it_with_a_hint(daemon: Daemon) -> None:
    result = CliRunner().invoke(app, ["points", "--url", daemon.url, "--device", "other"])
    assert result.exit_code != 0
    assert "other" in f"{result.exception}{result.output}"


def test_an_address_that_is_none_is_refused() -> None:
    result = CliRunner().invoke(app, ["points", "--url", "ftp://barn"])
    assert result.exit_code != 0
    assert "no address of a daemon" in f"{result.exception}{result.output}"
