"""A download has its name only once it is whole, and what was asked for."""

from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from threading import Thread

import pytest

from archive.captures import META, ledger_of, slots, write
from grabberd.cli.daemon_captures import _fetch
from grabberd.client.daemon import Daemon
from grabberd.errors import CaptureFileError, GrabberdError, NotReady, StorageError

BROKEN_OFF = b"half of a file"


class Answers(BaseHTTPRequestHandler):
    """Half of a file at /half, a whole one at every other path."""

    whole = b""

    def do_GET(self) -> None:
        body = BROKEN_OFF if self.path == "/half" else self.whole
        self.send_response(200)
        self.send_header("Content-Length", str(2 * len(body) if self.path == "/half" else len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_: object) -> None:
        """Says nothing."""


@pytest.fixture
def daemon() -> Iterator[Daemon]:
    with HTTPServer(("127.0.0.1", 0), Answers) as server:
        thread = Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        yield Daemon(f"http://127.0.0.1:{server.server_port}")
        server.shutdown()
        thread.join()


def test_an_endless_answer_is_refused(daemon: Daemon, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("grabberd.client.daemon.LARGEST_ANSWER", 20)
    monkeypatch.setattr(Answers, "whole", b"[" + 20 * b" " + b"]")
    with pytest.raises(GrabberdError, match=r"the answer to http://127.0.0.1:[0-9]+/jobs has more than"):
        daemon.ask("/jobs?limit=1")
    monkeypatch.setattr(Answers, "whole", b"[" + 18 * b" " + b"]")
    assert daemon.ask("/jobs") == []


def document(taken):
    counts = {str(outcome): count for outcome, count in ledger_of(taken).counts().items()}
    return {"id": META.id, "ledger": {"counts": counts}}


def test_an_answer_that_breaks_off_leaves_no_file(daemon: Daemon, tmp_path: Path) -> None:
    with pytest.raises(NotReady, match="broke off after 14 of 28 bytes"):
        daemon.download("/half", tmp_path / "barn.zip")
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_written_is_not_the_daemons_fault(daemon: Daemon, tmp_path: Path) -> None:
    with pytest.raises(StorageError, match="cannot be written"):
        daemon.download("/whole", tmp_path / "missing" / "barn.zip")


def test_a_capture_comes_home_if_it_is_the_one_that_was_recorded(
    daemon: Daemon, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Answers, "whole", write(tmp_path, slots(5)).read_bytes())
    _fetch(daemon, document(slots(5)), tmp_path / "home.grab")
    assert (tmp_path / "home.grab").read_bytes() == Answers.whole


@pytest.mark.parametrize("taken", [slots(6), slots(4)])
def test_a_capture_with_other_fields_than_the_daemon_says_is_refused(
    daemon: Daemon, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, taken: list
) -> None:
    monkeypatch.setattr(Answers, "whole", write(tmp_path, slots(5)).read_bytes())
    with pytest.raises(CaptureFileError, match="as the daemon says"):
        _fetch(daemon, document(taken), tmp_path / "home.grab")
    assert not (tmp_path / "home.grab").exists()
