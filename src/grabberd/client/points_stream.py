"""Points of a running daemon's fields, one field after the other as they are measured."""

import json
import socket
from collections.abc import Iterator
from typing import NamedTuple
from urllib.parse import quote, urlsplit

from websockets.exceptions import ConnectionClosed, InvalidStatus, WebSocketException
from websockets.sync.client import ClientConnection, connect

from grabberd.client.daemon import TIMEOUT_S, Daemon, refusal_of
from grabberd.documents.points_frame import PROTOCOL, PointsDescription, PointsFrame, decoded
from grabberd.errors import GrabberdError, InputError, NotReady

PATH = "/api/v1/points/stream"
_PORTS = {"http": 80, "https": 443}


class StreamedPoints(NamedTuple):
    """The points of one field.

    Attributes:
        frame: The points.
        description: What they were measured with.
        skipped: Number of fields measured since the one before that this client was too slow for.
    """

    frame: PointsFrame
    description: PointsDescription
    skipped: int


def follow_points(
    daemon: Daemon, device: str | None = None, patience_s: float = TIMEOUT_S
) -> Iterator[StreamedPoints]:
    """The points of every field that is measured from now on; ends only with an error.

    Args:
        daemon: The daemon.
        device: Name of the device; None: there is only one.
        patience_s: Longest time without any field.

    Raises:
        NotReady: No daemon answers, it has ended, or it measures no field.
        GrabberdError: It refused, with its own message and hint.
    """
    with _connected(daemon, device) as connection:
        description: PointsDescription | None = None
        sequence: int | None = None
        while True:
            message = _received(connection, daemon, patience_s)
            try:
                if isinstance(message, str):
                    description = _description(message)
                    continue
                frame = decoded(message)
                if description is None or description.number != frame.description:
                    raise ValueError("the points were not described")
            except ValueError as error:
                raise GrabberdError(
                    f"{daemon.url} sends points that this command cannot read: {error}",
                    "use the command of the daemon's own version: grabberd status",
                ) from None
            yield StreamedPoints(frame, description, 0 if sequence is None else frame.sequence - sequence - 1)
            sequence = frame.sequence


def _description(message: str) -> PointsDescription:
    """A description; what a later daemon adds to it is left out."""
    sent = json.loads(message)
    return PointsDescription.model_validate(
        {name: sent[name] for name in PointsDescription.model_fields if name in sent}
    )


def _received(connection: ClientConnection, daemon: Daemon, patience_s: float) -> str | bytes:
    try:
        return connection.recv(patience_s)
    except TimeoutError:
        raise NotReady(
            f"{daemon.url} has measured no field for {patience_s:g} s", "grabberd status says what it lacks"
        ) from None
    except ConnectionClosed as error:
        raise NotReady(f"{daemon.url} has ended the stream of points: {error}", "start it again") from None


def _connected(daemon: Daemon, device: str | None) -> ClientConnection:
    url = urlsplit(daemon.url)
    if url.scheme not in _PORTS or url.hostname is None:
        raise InputError(f"{daemon.url} is no address of a daemon", "give one such as http://127.0.0.1:8050")
    address = f"ws{url.scheme.removeprefix('http')}://{url.netloc}{url.path.rstrip('/')}{PATH}"
    query = f"?device={quote(device)}" if device else ""
    token = daemon.token
    headers = {"Authorization": f"Bearer {token}"} if token else {}
    try:
        # With a socket of its own it follows no redirect, which would take the token elsewhere.
        own = socket.create_connection((url.hostname, url.port or _PORTS[url.scheme]), TIMEOUT_S)
        return connect(
            address + query,
            sock=own,
            subprotocols=[PROTOCOL],  # type: ignore[list-item]
            additional_headers=headers,
            compression=None,
            open_timeout=TIMEOUT_S,
        )
    except InvalidStatus as error:
        raise _refused(error) from None
    except (OSError, ValueError, WebSocketException) as error:
        raise NotReady(f"no daemon answers at {daemon.url}: {error}", "start one: grabberd serve") from None


def _refused(error: InvalidStatus) -> GrabberdError:
    return refusal_of(bytes(error.response.body or b""), f"{error.response.status_code}")
