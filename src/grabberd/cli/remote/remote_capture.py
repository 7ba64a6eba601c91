"""Captures recorded by a running daemon for the command line."""

import signal
import time
from pathlib import Path
from typing import Any

import typer
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from grabberd.cli.options import progress_console, warn
from grabberd.cli.remote.client import ask, download
from grabberd.errors import Conflict

POLL_S = 0.2
GOING_ON = ("armed", "recording", "sealing")
CAPTURES = "/api/v1/captures"


def capture_through(
    url: str, device: str | None, order: dict[str, Any], out: Path, token_file: Path | None = None
) -> dict[str, Any]:
    """Let the daemon record a capture, then download its file; Ctrl-C stops or disarms it.

    Raises:
        Conflict: the capture was disarmed, so nothing was recorded.
        GrabberdError: the daemon refused.
    """
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # end as Ctrl-C does
    started: dict[str, Any] = ask(url, CAPTURES, "POST", {**order, "device": device}, token_file)
    ended = started
    while ended["state"] in GOING_ON:
        try:
            ended = _followed(url, ended, token_file)
        except KeyboardInterrupt:
            ended = ask(url, f"{CAPTURES}/{started['id']}/stop", "POST", None, token_file)
    if ended["state"] == "disarmed":
        raise Conflict(f"capture {ended['id']} was stopped before it was triggered", "nothing was recorded")
    download(url, f"{CAPTURES}/{ended['id']}/file", out, token_file)
    return ended


def armed_capture(url: str, device: str | None, token_file: Path | None) -> str:
    """Id of the armed capture, or of any capture of the armed group.

    Raises:
        Conflict: no capture is armed, or several are that do not form one group.
    """
    query = f"?limit=500&device={device}" if device else "?limit=500"
    captures = ask(url, CAPTURES + query, token_file=token_file)["captures"]
    waiting = [one for one in captures if one["state"] == "armed"]
    armed = [one["id"] for one in waiting]
    groups = {one["group"] and one["group"]["id"] for one in waiting}
    if len(armed) > 1 and (len(groups) > 1 or None in groups):
        raise Conflict(
            f"{len(armed)} captures are armed: {', '.join(armed)}", "give the id of one of them, or --device"
        )
    if not armed:
        raise Conflict("no capture is armed", "arm one: grabberd capture --armed --out FILE")
    return str(armed[0])


def trigger(url: str, capture_id: str, token_file: Path | None) -> dict[str, Any]:
    """Trigger an armed capture.

    Raises:
        GrabberdError: the daemon refused.
    """
    document: dict[str, Any] = ask(url, f"{CAPTURES}/{capture_id}/trigger", "POST", None, token_file)
    return document


def _followed(url: str, document: dict[str, Any], token_file: Path | None) -> dict[str, Any]:
    """Show the capture's state until it has ended, and return its final document."""
    warn(ask(url, f"/api/v1/devices/{document['device']}", token_file=token_file)["warnings"])
    if document["state"] == "armed":
        typer.echo(f"armed: {document['id']}; now: grabberd trigger --url {url}", err=True)
    columns = SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn()
    with Progress(*columns, console=progress_console, transient=True) as progress:
        task = progress.add_task("", total=None)
        while document["state"] in GOING_ON:
            progress.update(task, description=f"{document['state']}, {document['fields']} fields")
            time.sleep(POLL_S)
            document = ask(url, f"{CAPTURES}/{document['id']}", token_file=token_file)
    return document
