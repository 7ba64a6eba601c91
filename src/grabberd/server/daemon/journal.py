"""Logging: JSON lines for the journal, plain text for a terminal.

A record may carry `device`, `capture` and `cause` (`log.info("…", extra={"device": name})`); otherwise the
device or capture is taken from a message that starts like "device cup is …".
"""

import io
import json
import logging
import re
import sys
from collections import deque
from datetime import UTC, datetime
from typing import Any, TextIO

LAST_LINES = 2000
LONGEST = 8000
"""Maximum length of a message in characters; longer ones are truncated."""
PRIORITIES = {"CRITICAL": 2, "ERROR": 3, "WARNING": 4, "INFO": 6, "DEBUG": 7}
"""Syslog priorities by level."""
FIELDS = ("device", "capture", "cause")
_SECRETS = re.compile(r"(grabberd_[A-Za-z0-9_-]{20})[A-Za-z0-9_-]+|(?i:(bearer|session=)\s*[^\s;,\"']+)")
_NAMED = re.compile(r"^(device|capture) ([^\s:]+)")
_OWN_FORMAT = ("uvicorn", "uvicorn.error", "uvicorn.access")


def redacted(text: str) -> str:
    """A text in which everything that looks like a token or a session is replaced."""
    return _SECRETS.sub("(secret)", text)


def message_of(record: logging.LogRecord) -> str:
    """The message of a record without secrets, followed by its exception on further lines."""
    formatter = logging.Formatter("%(message)s")
    return redacted(formatter.format(record))[:LONGEST]


class JsonFormatter(logging.Formatter):
    """One JSON object per line: time_utc, priority, level, logger, message, and device, capture or cause."""

    def format(self, record: logging.LogRecord) -> str:
        """Formats a record as one line."""
        return json.dumps(document_of(record), ensure_ascii=False)


class PlainFormatter(logging.Formatter):
    """Lines of text for a terminal."""

    def format(self, record: logging.LogRecord) -> str:
        """Formats a record as one line, followed by its exception if it has one."""
        moment = datetime.fromtimestamp(record.created).astimezone()
        return f"{moment:%H:%M:%S} {record.levelname} {record.name}: {message_of(record)}"


def document_of(record: logging.LogRecord) -> dict[str, Any]:
    """A record as a document for the journal."""
    message = message_of(record)
    moment = datetime.fromtimestamp(record.created, UTC)
    named = _NAMED.match(message)
    subject = {named[1]: named[2]} if named else {}
    subject |= {key: getattr(record, key) for key in FIELDS if getattr(record, key, None) is not None}
    return {
        "time_utc": moment.isoformat(timespec="milliseconds").replace("+00:00", "Z"),
        "priority": PRIORITIES.get(record.levelname, 6),
        "level": record.levelname.lower(),
        "logger": record.name,
        "message": message,
        **{key: redacted(str(value)) for key, value in subject.items()},
    }


class LastLines(logging.Handler):
    """Keeps the last lines in memory for the diagnostics."""

    def __init__(self, count: int = LAST_LINES) -> None:
        super().__init__()
        self._lines: deque[str] = deque(maxlen=count)
        self.setFormatter(JsonFormatter())

    def emit(self, record: logging.LogRecord) -> None:
        """Keeps the line of a record."""
        self._lines.append(self.format(record))

    @property
    def lines(self) -> list[str]:
        """The lines kept, oldest first."""
        self.acquire()
        try:
            return list(self._lines)
        finally:
            self.release()


last_lines = LastLines()
"""The last lines of this process."""


def set_up_logging(stream: TextIO | None = None) -> bool:
    """Sets one format for everything that this process logs; may be called twice.

    Returns True if the format is plain text.

    Args:
        stream: Destination; standard error by default. A terminal gets plain text, anything else JSON.
    """
    stream = stream or sys.stderr
    shown = logging.StreamHandler(stream)
    for_person = _is_terminal(stream)
    shown.setFormatter(PlainFormatter() if for_person else JsonFormatter())
    root = logging.getLogger()
    root.handlers = [shown, last_lines]
    root.setLevel(logging.INFO)
    for name in _OWN_FORMAT:
        logger = logging.getLogger(name)
        # uvicorn installs its own handlers, whose lines are not JSON.
        logger.handlers, logger.propagate = [], True
    return for_person


def _is_terminal(stream: TextIO) -> bool:
    try:
        return stream.isatty()
    except (ValueError, io.UnsupportedOperation):
        return False
