"""`grabberd diagnostics` with a running daemon: its own user needs no token, others do."""

import json
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from grabberd.cli.app import app
from grabberd.errors import GrabberdError
from server.api.daemons import Daemon, serving


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


def test_without_an_address_the_configured_one_is_asked(
    daemon: tuple[Daemon, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("GRABBERD_URL", raising=False)
    running, folder = daemon
    config = tmp_path / "grabberd.yaml"
    port = running.url.rpartition(":")[2]
    config.write_text(
        f"devices: {{one: {{driver: fake}}}}\nstorage: {{directory: {folder}}}\nhttp: {{port: {port}}}\n"
    )
    result = CliRunner().invoke(
        app, ["diagnostics", "--config", str(config), "--out", str(tmp_path / "barn.zip")]
    )
    assert result.exit_code == 0, result.output
    with zipfile.ZipFile(tmp_path / "barn.zip") as archive:
        assert "state.json" in archive.namelist()


def test_the_key_goes_to_a_configured_address_only_if_it_is_this_computer_s(
    daemon: tuple[Daemon, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    from grabberd.cli.diagnostics import _key_of_the_machine  # noqa: PLC0415

    _, folder = daemon
    monkeypatch.setenv("STATE_DIRECTORY", str(folder))
    own, foreign = "http://127.9.9.9:8050", "http://192.0.2.1:8050"
    assert _key_of_the_machine(None, own, configured=True) == folder / "machine.key"
    assert _key_of_the_machine(None, foreign, configured=True) is None
