"""Captures, and groups of them, recorded by a running daemon for the command line."""

import time
from pathlib import Path

import typer
from rich.progress import Progress, SpinnerColumn, TimeElapsedColumn

from grabberd.archive.capture.reader import CaptureReader
from grabberd.cli.options import check_absent, end_as_ctrl_c_does, group_file, warn
from grabberd.cli.terminal import progress_console
from grabberd.client.daemon import CAPTURES, POLL_S, UNENDED, Daemon
from grabberd.errors import CaptureFileError, Conflict, count_of
from grabberd.files.reading import JsonObject

GROUPS = "/api/v1/capture-groups"

"""The daemon's document of a capture or of a group of captures, or the body of a request for one."""


def capture_through(daemon: Daemon, device: str | None, request: JsonObject, out: Path) -> JsonObject:
    """Let the daemon record a capture, then download its file; Ctrl-C stops or disarms it.

    Raises:
        Conflict: the capture was disarmed, so nothing was recorded.
        GrabberdError: the daemon refused.
    """
    end_as_ctrl_c_does()
    ended = _ended(daemon, CAPTURES, {**request, "device": device})
    _fetch(daemon, ended, out)
    return ended


def capture_group_through(
    daemon: Daemon, devices: list[str] | None, request: JsonObject, out: Path
) -> JsonObject:
    """Let the daemon record a group of captures, of all its devices unless they are named.

    Their files are then downloaded; Ctrl-C stops or disarms all.

    Raises:
        StorageError: one of the files exists already; nothing was started.
        Conflict: the group was disarmed, so nothing was recorded.
        GrabberdError: the daemon refused.
    """
    end_as_ctrl_c_does()
    names = devices
    if names is None:
        names = [str(one["name"]) for one in daemon.ask("/api/v1/devices")["devices"]]
    # Before anything starts: a capture whose file cannot be kept would be recorded for nothing.
    check_absent(*(group_file(out, name) for name in names))
    ended = _ended(daemon, GROUPS, {**request, "devices": names})
    for one in ended["captures"]:
        _fetch(daemon, one, group_file(out, one["device"]))
    return ended


def _fetch(daemon: Daemon, capture: JsonObject, out: Path) -> None:
    """Download a capture's file, and read it before it is given its name."""

    def check(file: Path) -> None:
        with CaptureReader(file) as reader:
            counts = {str(outcome): count for outcome, count in reader.ledger.counts().items()}
            if (reader.meta.id, counts) != (capture["id"], capture["ledger"]["counts"]):
                raise CaptureFileError(
                    f"the file of {reader.meta.id} has {counts}, not {capture['ledger']['counts']} of "
                    f"{capture['id']} as the daemon says",
                    "download it again from the daemon's page",
                )

    daemon.download(f"{CAPTURES}/{capture['id']}/file", out, check)


def trigger(daemon: Daemon, capture_id: str) -> JsonObject:
    """Trigger an armed capture, or any one of an armed group.

    Raises:
        GrabberdError: the daemon refused.
    """
    return daemon.ask(f"{CAPTURES}/{capture_id}/trigger", "POST")


def armed_capture(daemon: Daemon, device: str | None) -> str:
    """Id of the armed capture, or of any capture of the armed group.

    Raises:
        Conflict: no capture is armed, or several are that do not form one group.
    """
    # 500 is the longest page that the API gives; captures that wait are far fewer.
    query = f"?limit=500&device={device}" if device else "?limit=500"
    waiting = [one for one in daemon.ask(CAPTURES + query)["captures"] if one["state"] == "armed"]
    armed = [str(one["id"]) for one in waiting]
    groups = {one["group"] and one["group"]["id"] for one in waiting}
    if len(armed) > 1 and (len(groups) > 1 or None in groups):
        raise Conflict(
            f"{len(armed)} captures are armed: {', '.join(armed)}", "give the id of one of them, or --device"
        )
    if not armed:
        raise Conflict("no capture is armed", "arm one: grabberd capture --armed --out FILE")
    return armed[0]


def _ended(daemon: Daemon, collection: str, request: JsonObject) -> JsonObject:
    """Start a capture or a group, follow it until all of it is sealed, and return its final document."""
    document: JsonObject = daemon.ask(collection, "POST", request)
    address = f"{collection}/{document['id']}"
    while _is_going_on(document):
        try:
            document = _followed(daemon, address, document)
        # The daemon seals what it stops, which takes a while: the loop follows it until then.
        except KeyboardInterrupt:
            document = daemon.ask(f"{address}/stop", "POST")
    if all(one["state"] == "disarmed" for one in _captures(document)):
        kind = "group" if collection == GROUPS else "capture"
        raise Conflict(f"{kind} {document['id']} was stopped before it was triggered", "nothing was recorded")
    return document


def _followed(daemon: Daemon, address: str, document: JsonObject) -> JsonObject:
    """Show the captures' states until all have ended."""
    if "device" in document:
        warn(daemon.ask(f"/api/v1/devices/{document['device']}")["warnings"])
    if any(one["state"] == "armed" for one in _captures(document)):
        typer.echo(f"armed: {document['id']}; now: grabberd trigger --url {daemon.url}", err=True)
    columns = SpinnerColumn(), "{task.description}", TimeElapsedColumn()
    with Progress(*columns, console=progress_console, transient=True) as progress:
        task = progress.add_task("", total=None)
        while _is_going_on(document):
            states = (
                f"{one['device']}: {one['state']}, {count_of(one['fields'], 'field')}"
                for one in _captures(document)
            )
            progress.update(task, description=", ".join(states))
            time.sleep(POLL_S)
            document = daemon.ask(address)
    return document


def _captures(document: JsonObject) -> list[JsonObject]:
    """The captures of a group; a single capture is a group of one."""
    return document.get("captures", [document])


def _is_going_on(document: JsonObject) -> bool:
    return any(one["state"] in UNENDED for one in _captures(document))
