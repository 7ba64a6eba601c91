"""Diagnostics: one file for support with versions, devices, state, captures, jobs and log."""

import io
import json
import platform
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import asdict
from importlib.metadata import distributions
from pathlib import Path
from typing import TYPE_CHECKING, Any

from grabberd import __version__
from grabberd.clock import SystemClock, iso_utc
from grabberd.config.section import without_secrets
from grabberd.documents.document import JsonObject
from grabberd.instrument.acquisition import GRABBERS, discover
from grabberd.server.daemon.journal import last_lines, redacted

if TYPE_CHECKING:
    from grabberd.server.daemon.service import Service

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
    captures.json       every capture with its ledger, without pictures and points
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
