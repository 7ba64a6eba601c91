"""Captures of several devices through a running daemon, as a person types them."""

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from several import sealed_all, service_of, wait_until_they_accept
from typer.testing import CliRunner, Result

from grabberd.archive.capture.reader import CaptureReader
from grabberd.cli.app import app
from grabberd.errors import Conflict, GrabberdError, StorageError
from grabberd.instrument.capture.capture_request import CaptureRequest
from server.api.daemons import Daemon, served

PACED = {"left": {"pace": "real"}, "right": {"pace": "real", "seed": 2}}


@pytest.fixture(scope="module")
def daemon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Daemon]:
    service = service_of(tmp_path_factory.mktemp("daemon"), PACED)
    with served(service) as running:
        wait_until_they_accept(service)
        yield running


def run(*words: object) -> Result:
    return CliRunner().invoke(app, [str(word) for word in words])


@pytest.mark.parametrize("devices", ["left,right", "all"])
def test_a_file_of_each_comes_home(daemon: Daemon, tmp_path: Path, devices: str) -> None:
    order = ("capture", "--together", devices, "--url", daemon.url, "--fields", 10, "--label", "cow=112")
    result = run(*order, "--out", tmp_path / "112.grab")
    assert result.exit_code == 0, result.exception
    starts = set()
    for device in ("left", "right"):
        with CaptureReader(tmp_path / f"112-{device}.grab") as reader:
            assert reader.meta.device["name"] == device
            assert reader.meta.labels == {"cow": "112"}
            assert reader.ledger.total == 10
            starts.add(reader.meta.start_ns)
        assert f"112-{device}.grab: 10 fields" in result.stdout.replace("\n", "")
    assert len(starts) == 1


def test_scripts_get_the_whole_group(daemon: Daemon, tmp_path: Path) -> None:
    order = ("capture", "--together", "right", "--url", daemon.url, "--fields", 5, "--json")
    group = json.loads(run(*order, "--out", tmp_path / "a.grab").stdout)
    assert group["devices"] == [one["device"] for one in group["captures"]] == ["right"]


def test_nothing_is_overwritten_and_then_nothing_begins(daemon: Daemon, tmp_path: Path) -> None:
    (tmp_path / "a-right.grab").write_text("mine")
    before = len(daemon.service.archive.index.list())
    for devices in ("left,right", "all"):
        result = run("capture", "--together", devices, "--url", daemon.url, "--out", tmp_path / "a.grab")
        assert isinstance(result.exception, StorageError)
        assert "a-right.grab" in result.exception.message
    assert len(daemon.service.archive.index.list()) == before


def test_a_refusal_says_which_device_and_why(daemon: Daemon, tmp_path: Path) -> None:
    capture_id = daemon.service.capture_control.start("left", CaptureRequest()).id
    try:
        result = run("capture", "--together", "all", "--url", daemon.url, "--out", tmp_path / "a.grab")
        assert isinstance(result.exception, GrabberdError)
        assert capture_id in result.exception.message
    finally:
        daemon.service.capture_control.stop(capture_id)
        sealed_all(daemon.service)


def test_a_trigger_needs_no_name_where_all_that_wait_belong_together(daemon: Daemon) -> None:
    orders = daemon.service.capture_control
    requests = {name: CaptureRequest(fields=5) for name in PACED}
    group_id = orders.arm_group(requests)
    document = json.loads(run("trigger", "--url", daemon.url, "--json").stdout)
    assert document["group"]["id"] == group_id
    sealed_all(daemon.service)
    assert {one.state for one in orders.captures_of(group_id)} == {"sealed"}


def test_of_two_that_wait_alone_one_has_to_be_named(daemon: Daemon) -> None:
    ids = [daemon.service.capture_control.arm(name, CaptureRequest()).id for name in PACED]
    try:
        result = run("trigger", "--url", daemon.url)
        assert isinstance(result.exception, Conflict)
        assert all(capture_id in result.exception.message for capture_id in ids)
    finally:
        for capture_id in ids:
            daemon.service.capture_control.stop(capture_id)


def test_devices_are_named_in_one_way(tmp_path: Path) -> None:
    words = ("capture", "--together", "a,b", "--device", "a", "--out", tmp_path / "a.grab")
    assert run(*words).exit_code == 2
