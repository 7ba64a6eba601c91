"""Diagnostics: the log, for the journal or a terminal, and one file for support that explains a fault.

A record may carry `device`, `capture` and `cause` (`log.info("…", extra={"device": name})`); otherwise the
device or capture is taken from a message that starts like "device cup is …".
"""

import io
import json
import logging
import platform
import re
import shutil
import subprocess
import sys
import zipfile
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import asdict
from datetime import UTC, datetime
from importlib.metadata import distributions
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO

from grabberd import __version__
from grabberd.config.section import without_secrets
from grabberd.documents.document import JsonObject
from grabberd.instrument.acquisition import GRABBERS, discover
from grabberd.runtime import SystemClock, iso_utc

if TYPE_CHECKING:
    from grabberd.server.daemon.service import Service


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


Parts = Mapping[str, Callable[[], Any]]
"""A function for each file, by name, that returns its content: text or a JSON document."""

PERSONAL_KEYS = ("labels", "note", "site")
UNIT = "grabberd.service"
UNIT_PROPERTIES = "ActiveState,SubState,Result,NRestarts,ExecMainStatus,ActiveEnterTimestamp,MemoryCurrent"
SYSTEMD = Path("/run/systemd/system")
TIMEOUT_S = 5.0
"""Longest wait for systemctl: if systemd hangs, the diagnostics must report that, not hang as well."""

ABOUT = """grabberd diagnostics, made {made}

Send this file to whoever helps you. It is plain text: read it before you send it.

    versions.json       grabberd, Python, its packages, the kernel, OpenCV
    grabbers.json       drivers, and the grabbers found on this computer
    systemd.txt         state of the unit, where systemd runs
    configuration.json  the configuration, without secrets
    state.json          present state of the devices and the disk
    captures.json       the newest thousand captures, with the first ten entries of their ledgers
    jobs.json           the jobs of the last month
    log.jsonl           the last lines of the log, one JSON object each

{scope}
It contains no tokens, sessions, keys, certificates, pictures or measurements.
{words}
"""
HIDDEN_TEXT = "Labels, notes and the name of the site have been left out."
SHOWN_TEXT = "Labels, notes and the name of the site are included, as requested."
OF_DAEMON = "It was made by the running daemon and contains all of these."
OF_COMPUTER = "No daemon answered when it was made: it contains only the parts about this computer."


def machine_parts() -> Parts:
    """Parts that need no running daemon."""
    return {"versions.json": versions, "grabbers.json": _grabbers, "systemd.txt": _systemd}


def daemon_parts(service: "Service", *, words: bool = False) -> Parts:
    """Parts of a running daemon.

    Args:
        service: The daemon's service.
        words: True to include text written by people: labels, notes and the site.
    """

    def shown(document: Any) -> Any:
        return document if words else without_personal_text(document)

    return {
        **machine_parts(),
        "configuration.json": lambda: shown(without_secrets(service.configuration)),
        "state.json": lambda: shown(_state(service)),
        "captures.json": lambda: shown(_captures(service)),
        "jobs.json": lambda: [job.model_dump(mode="json") for job in service.jobs.list()],
        "log.jsonl": lambda: "\n".join(last_lines.lines) + "\n",
    }


def bundle(parts: Parts, *, words: bool = False) -> bytes:
    """Packs all parts into a ZIP file with a README; a part that fails contains the reason instead."""
    file = io.BytesIO()
    about = ABOUT.format(
        made=iso_utc(SystemClock().utc_now()),
        scope=OF_DAEMON if "state.json" in parts else OF_COMPUTER,
        words=SHOWN_TEXT if words else HIDDEN_TEXT,
    )
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("README.txt", about)
        for name, make in parts.items():
            # Redacted again as text: an exception or a log line may quote a secret that no key marks as one.
            archive.writestr(name, redacted(_text(make)))
    return file.getvalue()


def without_personal_text(document: Any) -> Any:
    """A JSON document without labels, notes and the site."""
    if isinstance(document, Mapping):
        return {
            key: without_personal_text(value) for key, value in document.items() if key not in PERSONAL_KEYS
        }
    if isinstance(document, list | tuple):
        return [without_personal_text(inner) for inner in document]
    return document


def versions() -> JsonObject:
    """Versions of grabberd, Python, its packages, the kernel and OpenCV."""
    import cv2  # noqa: PLC0415 - rarely needed

    packages = {one.metadata["Name"]: one.version for one in distributions() if one.metadata["Name"]}
    return {
        "grabberd": __version__,
        "python": sys.version,
        "platform": platform.platform(),
        "kernel": platform.uname()._asdict(),
        "opencv": cv2.__version__,
        "packages": dict(sorted(packages.items())),
    }


def _grabbers() -> JsonObject:
    return {"drivers": GRABBERS.available(), "found": [asdict(found) for found in discover()]}


def _captures(service: "Service") -> list[JsonObject]:
    # Without pins, which are in the state database: if that is unreadable, the captures must still be listed.
    return [one.model_dump(mode="json", exclude={"pinned"}) for one in service.archive.documents()]


def _state(service: "Service") -> JsonObject:
    disk = shutil.disk_usage(service.archive.directory)._asdict()
    return {**service.state().model_dump(mode="json"), "disk": disk}


def _systemd() -> str:
    if not SYSTEMD.is_dir():
        return "systemd does not run here\n"
    command = ["systemctl", "show", UNIT, f"--property={UNIT_PROPERTIES}"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=TIMEOUT_S, check=False)  # noqa: S603
    return done.stdout + done.stderr


def _text(make: Callable[[], Any]) -> str:
    try:
        made = make()
    except Exception as error:  # diagnostics are for faults: if one part fails, the others are still wanted
        return f"could not be made: {type(error).__name__}: {error}\n"
    if isinstance(made, str):
        return made
    return json.dumps(made, indent=2, ensure_ascii=False, default=str) + "\n"
