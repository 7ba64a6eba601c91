"""Feeds a device's outlets from a running daemon, until it is stopped."""

import threading
from collections.abc import Callable
from typing import Any
from urllib.parse import quote, urlencode

from grabberd.client.daemon import Daemon
from grabberd.client.points_stream import follow_points
from grabberd.errors import GrabberdError, InputError, NotReady
from grabberd_lsl.outlets import DeviceEvents, Event, LslClock, Outlets, PointsLayout

ASK_EVERY_S = 0.5
AGAIN_S = 2.0
NEWEST_CAPTURES = 20
"""So many captures may start and end between two questions without any being missed."""


def only_device(daemon: Daemon, device: str | None) -> str:
    """The device that is meant: the named one, or the only one.

    Raises:
        InputError: There is none of that name, or there are several and none is named.
        NotReady: No daemon answers.
    """
    names = [str(name) for name in daemon.ask("/api/v1/state")["devices"]]
    if device is None and len(names) == 1:
        return names[0]
    if device is None or device not in names:
        words = "there are several devices" if device is None else f"there is no device {device}"
        raise InputError(words, f"name one of: {', '.join(names)}")
    return device


def outlets_of(daemon: Daemon, device: str, clock: LslClock) -> Outlets:
    """The outlets of a device, which look up its object model."""
    address = f"/api/v1/devices/{quote(device, safe='')}/object"
    return Outlets(device, lambda: PointsLayout.from_document(daemon.ask(address)), clock)


def feed(daemon: Daemon, outlets: Outlets, say: Callable[[str], None], stopped: threading.Event) -> None:
    """Pushes every field's points and every event until stopped; a daemon that is away is waited for.

    Args:
        daemon: The daemon.
        outlets: Outlets of one of its devices.
        say: Told what goes wrong, once for each reason.
        stopped: Ends it.

    Raises:
        GrabberdError: The daemon refuses to stream points, and has not done so before.
    """
    asking = threading.Thread(target=_tell_events, args=(daemon, outlets, stopped), daemon=True)
    asking.start()
    said: str | None = None
    answered = False
    while not stopped.is_set():
        outlets.begin()
        try:
            for one in follow_points(daemon, outlets.device):
                outlets.push(one)
                said, answered = None, True
                if stopped.is_set():
                    return
        except GrabberdError as error:
            if not (answered or isinstance(error, NotReady)):
                raise
            if error.message != said:
                say(f"{error.message}; {error.hint}")
            said = error.message
        stopped.wait(AGAIN_S)


def _tell_events(daemon: Daemon, outlets: Outlets, stopped: threading.Event) -> None:
    events, answers, heard = DeviceEvents(), True, False
    while not stopped.wait(ASK_EVERY_S):
        if outlets.is_heard and not heard:
            events.repeat_health()  # what no consumer received is not kept
        heard = outlets.is_heard
        try:
            state, captures = _asked(daemon, outlets.device)
        except GrabberdError as error:
            if answers:
                outlets.tell(Event("daemon_away", {"message": error.message, "hint": error.hint}))
            answers = False
            continue
        if not answers:
            outlets.tell(Event("daemon_back", {}))
        answers = True
        for event in (*events.of_state(state), *events.of_captures(captures)):
            outlets.tell(event)


def _asked(daemon: Daemon, device: str) -> tuple[dict[str, Any], list[dict[str, Any]]]:
    """The device in the daemon's state, and its newest captures."""
    state = daemon.ask("/api/v1/state")
    if device not in state["devices"]:
        raise NotReady(f"the daemon has no device {device} any more", "name one that it has")
    query = urlencode({"device": device, "limit": NEWEST_CAPTURES})
    return state["devices"][device], daemon.ask(f"/api/v1/captures?{query}")["captures"]
