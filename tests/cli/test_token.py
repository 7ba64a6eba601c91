"""Tokens on the command line, and how commands show them to a daemon."""

import json
import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

from grabberd.archive.access import Access, Identity
from grabberd.cli.app import app
from grabberd.client.daemon import Daemon
from grabberd.documents.enums import Role
from grabberd.errors import GrabberdError, InputError


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("STATE_DIRECTORY", str(tmp_path / "state"))
    return tmp_path / "state"


def run(*words: object) -> Result:
    return CliRunner().invoke(app, [str(word) for word in words])


def test_a_token_is_printed_once_and_opens_the_door(folder: Path) -> None:
    result = run("token", "add", "tablet", "--role", "operator")
    secret = result.stdout.strip()
    assert Access(folder).of_token(secret) == Identity(Role.OPERATOR, "token", "tablet")
    listed = run("token", "list", "--json")
    assert [(row["name"], row["role"]) for row in json.loads(listed.stdout)] == [("tablet", "operator")]
    shown = run("token", "list").output
    assert secret not in listed.output + shown
    assert "valid until revoked" in " ".join(shown.split())


def test_two_tokens_have_nothing_in_common(folder: Path) -> None:
    secrets = [
        json.loads(run("token", "add", name, "--role", "viewer", "--json").stdout)["token"] for name in "ab"
    ]
    assert len(set(secrets)) == 2
    assert all(len(secret) == len("grabberd_") + 43 for secret in secrets)


def test_a_removed_token_opens_nothing(folder: Path) -> None:
    secret = run("token", "add", "tablet", "--role", "operator").stdout.strip()
    assert run("token", "remove", "tablet").exit_code == 0
    assert Access(folder).of_token(secret) is None
    assert "no token 'tablet'" in str(run("token", "remove", "tablet").exception)


def test_a_name_is_given_once_and_is_short_and_plain(folder: Path) -> None:
    run("token", "add", "tablet", "--role", "operator")
    assert "already" in str(run("token", "add", "tablet", "--role", "admin").exception)
    for name in ("", "a b", "x" * 65, "../x", "ü"):
        assert isinstance(run("token", "add", name, "--role", "viewer").exception, InputError), name
    assert run("token", "add", "other", "--role", "king").exit_code == 2
    assert run("token", "add", "other").exit_code == 2


class FakeDaemon(BaseHTTPRequestHandler):
    """Answers with the token that it was shown; sends some elsewhere."""

    def do_GET(self) -> None:
        self.send_response(302 if self.path == "/elsewhere" else 200)
        if self.path == "/elsewhere":
            self.send_header("Location", "http://localhost:1/")
        self.end_headers()
        self.wfile.write(json.dumps(self.headers["Authorization"]).encode())

    def log_message(self, *_: object) -> None:
        """Quiet."""


@pytest.fixture
def url() -> Iterator[str]:
    with HTTPServer(("127.0.0.1", 0), FakeDaemon) as server:
        thread = threading.Thread(target=server.serve_forever, args=(0.01,))
        thread.start()
        yield f"http://127.0.0.1:{server.server_port}"
        server.shutdown()
        thread.join()


def test_a_token_comes_from_a_file_else_from_the_environment(
    url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "token"
    file.write_text("from-file\n")
    assert Daemon(url).ask("/") is None
    monkeypatch.setenv("GRABBERD_TOKEN", "from-environment")
    assert Daemon(url).ask("/") == "Bearer from-environment"
    assert Daemon(url, file).ask("/") == "Bearer from-file"
    Daemon(url, file).download("/", tmp_path / "out")
    assert (tmp_path / "out").read_text() == '"Bearer from-file"'


@pytest.mark.parametrize("text", ["", "\n", "two words", "two\nlines", "ü"])
def test_a_file_without_a_token_is_said_plainly(url: str, tmp_path: Path, text: str) -> None:
    file = tmp_path / "token"
    file.write_text(text)
    for where in (file, tmp_path / "none"):
        with pytest.raises(InputError, match=where.name):
            Daemon(url, where).ask("/")


def test_a_token_is_not_taken_to_another_address(url: str) -> None:
    with pytest.raises(GrabberdError, match="302"):
        Daemon(url).ask("/elsewhere")


def test_no_option_takes_the_token_itself() -> None:
    for command in ("status", "capture", "token"):
        assert "--token " not in run(command, "--help").output


def serve(folder: Path, *words: str) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, "-c", "from grabberd.cli import main; main()", "serve", "--port", "0", *words]
    environment = {**os.environ, "STATE_DIRECTORY": str(folder)}
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False, env=environment)


def test_the_daemon_refuses_to_listen_to_strangers_without_a_token(tmp_path: Path) -> None:
    result = serve(tmp_path, "--host", "0.0.0.0")
    assert result.returncode == 78
    assert "not a loopback address" in result.stderr
    assert "grabberd token add" in result.stderr
    assert not list(tmp_path.glob("captures/*"))


def test_certificate_files_that_are_none_are_said_before_anything_starts(tmp_path: Path) -> None:
    for name in ("cert.pem", "key.pem"):
        (tmp_path / name).write_text("nothing")
    config = tmp_path / "barn.yaml"
    config.write_text("devices: {one: {driver: fake}}\nhttp: {tls: {certificate: cert.pem, key: key.pem}}\n")
    result = serve(tmp_path, "--config", str(config))
    assert result.returncode == 78
    assert "http.tls" in result.stderr
    assert "http.tls" in str(run("check-config", config).exception)
