"""What the installer asks of a release and of the daemon that it started."""

import http.server
import json
import os
import shutil
import sqlite3
import ssl
import subprocess
import sys
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import pytest

from grabberd.archive.state.state_database import MIGRATIONS, StateDatabase

from .small_release import SYSTEMD

CHECKS = SYSTEMD / "release_checks.py"


def checked(*words: str | Path, release: Path | None = None) -> tuple[int, str]:
    """Exit code and complaint of a check; of this release, or of the one in a folder."""
    command = [sys.executable, CHECKS, *words]
    variables = os.environ | ({} if release is None else {"PYTHONPATH": str(release)})
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False, env=variables)
    return done.returncode, done.stderr


@contextmanager
def served(certificate: tuple[Path, Path] | None = None) -> Iterator[str]:
    """A daemon of version 1.2.3; where it listens, as systemctl shows it."""

    class Health(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            assert self.path == "/healthz"
            body = json.dumps({"version": "1.2.3"}).encode()
            self.send_response(200)
            self.send_header("Content-Length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, *_: Any) -> None:
            pass

    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Health)
    server.handle_error = lambda *_: None  # type: ignore[method-assign]
    if certificate:
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.load_cert_chain(*certificate)
        server.socket = context.wrap_socket(server.socket, server_side=True, do_handshake_on_connect=False)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    yield f"0.0.0.0:{server.server_address[1]} (Stream)"
    server.shutdown()
    server.server_close()
    thread.join()


def test_a_daemon_that_answers_as_the_version_it_has_to_be_is_well() -> None:
    with served() as listen:
        assert checked("answers", listen, "1.2.3", "30") == (0, "")
        assert checked("answers", listen, "", "30") == (0, "")


def test_a_daemon_of_another_version_is_not() -> None:
    with served() as listen:
        code, said = checked("answers", listen, "1.2.4", "0.5")
    assert code == 1
    assert "version 1.2.3, not version 1.2.4" in said


@pytest.mark.skipif(not shutil.which("openssl"), reason="openssl is missing")
def test_a_daemon_with_a_certificate_of_its_own_is_well(tmp_path: Path) -> None:
    key, certificate = tmp_path / "key.pem", tmp_path / "certificate.pem"
    words = "openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes -days 2 -subj /CN=barn"
    subprocess.run([*words.split(), "-keyout", key, "-out", certificate], check=True, capture_output=True)
    with served((certificate, key)) as listen:
        assert checked("answers", listen, "1.2.3", "30") == (0, "")


@pytest.mark.parametrize("listen", ["/run/grabberd.sock (Stream)", ""])
def test_a_socket_without_a_port_is_told(listen: str) -> None:
    code, said = checked("answers", listen, "1.2.3", "1")
    assert code == 1
    assert "grabberd.socket listens on no port" in said


def test_this_release_can_be_imported_and_opens_a_state_of_its_own_without_touching_it(
    tmp_path: Path,
) -> None:
    state = tmp_path / "state.sqlite"
    StateDatabase(state).open()
    before = state.read_bytes()
    assert checked("imports") == (0, "")
    assert checked("state", state) == (0, "")
    assert state.read_bytes() == before


def test_a_state_of_a_later_release_is_refused_with_its_version(tmp_path: Path) -> None:
    state = tmp_path / "state.sqlite"
    StateDatabase(state).open()
    with closing(sqlite3.connect(state)) as connection, connection:
        connection.execute(f"PRAGMA user_version = {len(MIGRATIONS) + 1}")
    code, said = checked("state", state)
    assert code == 1
    assert f"is of version {len(MIGRATIONS) + 1}" in said


@pytest.mark.parametrize("room", ["archive", "storage"])
def test_a_release_before_opens_the_state_wherever_its_class_lies(tmp_path: Path, room: str) -> None:
    package = tmp_path / "release" / "grabberd"
    for folder in (package, package / room, package / room / "state"):
        folder.mkdir(parents=True)
        (folder / "__init__.py").touch()
    (package / room / "state" / "state_database.py").write_text(REFUSING)
    sqlite3.connect(tmp_path / "state.sqlite").close()
    code, said = checked("state", tmp_path / "state.sqlite", release=tmp_path / "release")
    assert code == 1
    assert "the release before refuses it" in said


REFUSING = """
class StateDatabase:
    def __init__(self, path):
        pass

    def open(self):
        raise ValueError("the release before refuses it")
"""
