"""Groups of captures recorded by a running daemon for the command line."""

import signal
import time
from pathlib import Path
from typing import Any

import typer
from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

from grabberd.cli.options import progress_console
from grabberd.cli.remote.client import ask, download
from grabberd.cli.remote.remote_capture import CAPTURES, GOING_ON, POLL_S
from grabberd.errors import Conflict, StorageError

GROUPS = "/api/v1/capture-groups"


def capture_group_through(
    url: str, order: dict[str, Any], out: Path, token_file: Path | None = None
) -> dict[str, Any]:
    """Let the daemon record a group of captures, then download their files; Ctrl-C stops or disarms all.

    Raises:
        StorageError: one of the files exists already; nothing was started.
        Conflict: the group was disarmed, so nothing was recorded.
        GrabberdError: the daemon refused.
    """
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # end as Ctrl-C does
    if order["devices"] == "all":
        devices = ask(url, "/api/v1/devices", token_file=token_file)["devices"]
        order = {**order, "devices": [one["name"] for one in devices]}
    _check_absent(out, order["devices"])
    started: dict[str, Any] = ask(url, GROUPS, "POST", order, token_file)
    ended = started
    while _going_on(ended):
        try:
            ended = _followed(url, ended, token_file)
        except KeyboardInterrupt:
            ended = ask(url, f"{GROUPS}/{started['id']}/stop", "POST", None, token_file)
    if all(one["state"] == "disarmed" for one in ended["captures"]):
        raise Conflict(f"group {ended['id']} was stopped before it was triggered", "nothing was recorded")
    for one in ended["captures"]:
        download(url, f"{CAPTURES}/{one['id']}/file", file_of(out, one["device"]), token_file)
    return ended


def file_of(out: Path, device: str) -> Path:
    """File of one device's capture: NAME-DEVICE.grab for NAME.grab."""
    return out.with_name(f"{out.stem}-{device}{out.suffix}")


def _check_absent(out: Path, devices: list[str]) -> None:
    there = [str(file_of(out, device)) for device in devices if file_of(out, device).exists()]
    if there:
        raise StorageError(f"{', '.join(there)}: exists already", "name another file; nothing is overwritten")


def _going_on(group: dict[str, Any]) -> bool:
    return any(one["state"] in GOING_ON for one in group["captures"])


def _followed(url: str, group: dict[str, Any], token_file: Path | None) -> dict[str, Any]:
    """Show the captures' states until all have ended, and return the group's final document."""
    if any(one["state"] == "armed" for one in group["captures"]):
        typer.echo(f"armed: {group['id']}; now: grabberd trigger --url {url}", err=True)
    columns = SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn()
    with Progress(*columns, console=progress_console, transient=True) as progress:
        task = progress.add_task("", total=None)
        while _going_on(group):
            progress.update(task, description=", ".join(map(_in_words, group["captures"])))
            time.sleep(POLL_S)
            group = ask(url, f"{GROUPS}/{group['id']}", token_file=token_file)
    return group


def _in_words(capture: dict[str, Any]) -> str:
    return f"{capture['device']}: {capture['state']}, {capture['fields']} fields"
