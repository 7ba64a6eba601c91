"""`grabberd diagnostics` with a running daemon: its own user needs no token, others do."""

import json
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from api.daemons import Daemon, serving
from grabberd.cli.app import app
from grabberd.errors import GrabberdError


@pytest.fixture(scope="module")
def daemon(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Daemon, Path]]:
    folder = tmp_path_factory.mktemp("daemon")
    with serving(folder, pace="free") as running:
        yield running, folder


def run(out: Path, url: str) -> Result:
    return CliRunner().invoke(app, ["diagnostics", "--out", str(out), "--url", url])


def test_the_daemons_own_user_needs_no_token(
    daemon: tuple[Daemon, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    running, folder = daemon
    monkeypatch.setenv("STATE_DIRECTORY", str(folder))
    result = run(tmp_path / "barn.zip", running.url)
    assert result.exit_code == 0, result.output
    with zipfile.ZipFile(tmp_path / "barn.zip") as archive:
        assert "simulated" in json.loads(archive.read("state.json"))["devices"]
        text = b"".join(archive.read(name) for name in archive.namelist())
    assert (folder / "machine.key").read_bytes().strip() not in text


def test_whoever_cannot_read_the_daemons_files_is_told_how(
    daemon: tuple[Daemon, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    running, _ = daemon
    monkeypatch.setenv("STATE_DIRECTORY", str(tmp_path / "other"))
    result = run(tmp_path / "barn.zip", running.url)
    assert isinstance(result.exception, GrabberdError)
    assert "requires the role admin" in result.exception.message
    assert "as root or as the daemon's user" in result.exception.hint
    assert not (tmp_path / "barn.zip").exists()


def test_the_key_is_not_taken_to_another_computer(
    daemon: tuple[Daemon, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    from grabberd.cli.diagnostics import _key_of_the_machine  # noqa: PLC0415

    _, folder = daemon
    monkeypatch.setenv("STATE_DIRECTORY", str(folder))
    assert _key_of_the_machine(None, "http://127.0.0.1:8050") == folder / "machine.key"
    for url in ("http://barn.local:8050", "https://127.0.0.1.example", "nonsense"):
        assert _key_of_the_machine(None, url) is None


def test_a_token_in_the_environment_goes_before_it(
    daemon: tuple[Daemon, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    running, folder = daemon
    monkeypatch.setenv("STATE_DIRECTORY", str(folder))
    monkeypatch.setenv("GRABBERD_TOKEN", "grabberd_wrong")
    assert isinstance(run(tmp_path / "barn.zip", running.url).exception, GrabberdError)
