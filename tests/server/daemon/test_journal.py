"""How the daemon logs."""

import io
import json
import logging
from collections.abc import Iterator

import pytest

from grabberd.server.daemon.diagnostics import LastLines, document_of, last_lines, set_up_logging


class Terminal(io.StringIO):
    """Says that a person looks."""

    def isatty(self) -> bool:
        return True


@pytest.fixture(autouse=True)
def as_before() -> Iterator[None]:
    root = logging.getLogger()
    handlers, level = root.handlers, root.level
    yield
    root.handlers, root.level = handlers, level


def logged(stream: io.StringIO, name: str = "grabberd.test") -> logging.Logger:
    set_up_logging(stream)
    return logging.getLogger(name)


def test_a_journal_gets_a_json_object_a_line_with_a_priority() -> None:
    stream = io.StringIO()
    logged(stream).warning("device %s is failed: %s", "cup", "no field for 0.8 s", extra={"cause": "silence"})
    document = json.loads(stream.getvalue())
    assert (document["level"], document["priority"], document["logger"]) == ("warning", 4, "grabberd.test")
    assert document["message"] == "device cup is failed: no field for 0.8 s"
    assert (document["device"], document["cause"]) == ("cup", "silence")
    assert document["time_utc"].endswith("Z")


def test_a_terminal_gets_words() -> None:
    stream = Terminal()
    logged(stream).info("capture one has ended")
    assert stream.getvalue().endswith(" INFO grabberd.test: capture one has ended\n")


def test_an_exception_stays_on_one_line_of_the_journal() -> None:
    stream = io.StringIO()
    try:
        raise ValueError("odd")
    except ValueError:
        logged(stream).exception("capture c1: writing failed")
    (line,) = stream.getvalue().splitlines()
    document = json.loads(line)
    assert document["capture"] == "c1"
    assert "ValueError: odd" in document["message"]


@pytest.mark.parametrize("words", ["Bearer abc.def", "token grabberd_" + "x" * 43, "grabberd_session=abcdef"])
def test_nothing_secret_is_logged(words: str) -> None:
    stream = io.StringIO()
    logged(stream).info("said: %s", words)
    said = json.loads(stream.getvalue())["message"]
    assert "(secret)" in said
    assert not any(secret in said for secret in ("abc.def", "xxxx", "abcdef"))


def test_the_server_logs_in_the_same_way_and_once() -> None:
    stream = io.StringIO()
    logging.getLogger("uvicorn.error").addHandler(logging.StreamHandler(stream))
    logged(stream, "uvicorn.error").error("a client sent nonsense")
    (line,) = stream.getvalue().splitlines()
    assert json.loads(line)["logger"] == "uvicorn.error"


def test_setting_up_twice_logs_once() -> None:
    stream = io.StringIO()
    logged(stream)
    logged(stream).info("one")
    assert len(stream.getvalue().splitlines()) == 1


def test_the_last_lines_are_kept_and_the_older_ones_forgotten() -> None:
    kept = LastLines(3)
    for n in range(5):
        kept.handle(logging.LogRecord("x", logging.INFO, "", 0, "line %d", (n,), None))
    assert [json.loads(line)["message"] for line in kept.lines] == ["line 2", "line 3", "line 4"]
    logged(io.StringIO()).info("kept for the diagnostics")
    assert "kept for the diagnostics" in last_lines.lines[-1]


def test_what_names_no_device_has_none() -> None:
    document = document_of(logging.LogRecord("x", logging.INFO, "", 0, "hello", None, None))
    assert "device" not in document
