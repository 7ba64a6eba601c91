"""A running daemon: captures started, followed and downloaded, points as they are measured."""

import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from tempfile import mkdtemp
from typing import Any
from urllib.parse import quote

import grabberd
from grabberd.client.daemon import CAPTURES, POLL_S, TIMEOUT_S, UNENDED, Daemon
from grabberd.client.points_stream import StreamedPoints, follow_points
from grabberd.errors import NotReady
from grabberd.files.reading import PathLike

HERE = "http://127.0.0.1:8050"


class RemoteCapture:
    """A capture of a running daemon.

    Attributes:
        document: What the daemon said of it last; `refresh` asks again.
    """

    def __init__(self, daemon: Daemon, document: Mapping[str, Any]) -> None:
        self._daemon = daemon
        self.document = dict(document)

    @property
    def id(self) -> str:
        """Id of the capture."""
        return str(self.document["id"])

    @property
    def state(self) -> str:
        """State of the capture: "armed", "recording", "sealing", "sealed" or "disarmed"."""
        return str(self.document["state"])

    @property
    def labels(self) -> dict[str, str]:
        """Its labels as they are now."""
        return dict(self.document["labels"])

    @property
    def is_ended(self) -> bool:
        """True if nothing more comes to it."""
        return self.state not in UNENDED

    def refresh(self) -> "RemoteCapture":
        """Asks the daemon what has become of it."""
        self.document = self._daemon.ask(self._address)
        return self

    def stop(self) -> "RemoteCapture":
        """Stops the capture, or disarms it; `wait` waits until it is sealed."""
        self.document = self._daemon.ask(f"{self._address}/stop", "POST")
        return self

    def trigger(self) -> "RemoteCapture":
        """Triggers the armed capture."""
        self.document = self._daemon.ask(f"{self._address}/trigger", "POST")
        return self

    def label(self, note: str | None = None, **labels: str) -> "RemoteCapture":
        """Changes its labels, and its note if one is given; labels that are not named stay."""
        body: dict[str, Any] = {"labels": labels}
        if note is not None:
            body["note"] = note
        self.document = self._daemon.ask(self._address, "PATCH", body)
        return self

    def wait(self, timeout_s: float | None = None) -> "RemoteCapture":
        """Waits until the capture has ended and its file is whole.

        Args:
            timeout_s: Longest time to wait; None: as long as it takes.

        Raises:
            NotReady: It takes longer.
        """
        end_s = None if timeout_s is None else time.monotonic() + timeout_s
        while not self.refresh().is_ended:
            if end_s is not None and time.monotonic() > end_s:
                raise NotReady(f"capture {self.id} is {self.state} after {timeout_s:g} s", "wait for longer")
            time.sleep(POLL_S)
        return self

    def open(self, folder: PathLike | None = None) -> "grabberd.Capture":
        """Downloads the capture's file and opens it.

        Args:
            folder: Where the file is kept; by default in a new folder for temporary files.

        Raises:
            StorageError: The file exists, or cannot be written.
            GrabberdError: The daemon refused, e.g. because the capture is still recorded.
        """
        out = Path(mkdtemp(prefix="grabberd-") if folder is None else folder) / f"{self.id}.grab"
        self._daemon.download(f"{self._address}/file", out)
        return grabberd.open(out)

    def __repr__(self) -> str:
        return f"<RemoteCapture {self.id}: {self.state}>"

    @property
    def _address(self) -> str:
        return f"{CAPTURES}/{quote(self.id)}"


class Connection:
    """A running daemon, as `grabberd.connect` gives it.

    Whatever is asked raises NotReady where no daemon answers, and GrabberdError with the daemon's own message
    and hint where it refuses.
    """

    def __init__(self, url: str = HERE, token: str | None = None, token_file: PathLike | None = None) -> None:
        self._daemon = Daemon(url, None if token_file is None else Path(token_file), token)

    @property
    def state(self) -> dict[str, Any]:
        """State of the daemon and of each device, with the verdict on its health; docs/reference/http.md."""
        return dict(self._daemon.ask("/api/v1/state"))

    def captures(self, search: str = "", **labels: str) -> Iterator[RemoteCapture]:
        """The captures of the daemon, newest first.

        Args:
            search: Text to search for.
            **labels: Labels that they have, e.g. `liner="A"`.
        """
        asked = [("search", search)] if search else []
        asked += [("label", f"{name}={value}") for name, value in labels.items()]
        for document in self._daemon.rows(CAPTURES, "captures", *asked):
            yield RemoteCapture(self._daemon, document)

    def capture(self, capture_id: str) -> RemoteCapture:
        """A capture by its id."""
        return RemoteCapture(self._daemon, self._daemon.ask(f"{CAPTURES}/{quote(capture_id)}"))

    def start(
        self,
        *,
        fields: int | None = None,
        duration_s: float | None = None,
        device: str | None = None,
        note: str = "",
        labels: Mapping[str, str] | None = None,
        **options: Any,
    ) -> RemoteCapture:
        """Starts a capture; it goes on until its length is reached or `stop` is called.

        Args:
            fields: Its length in fields.
            duration_s: Its length in seconds; without both it has no end.
            device: Name of the device, where there are several.
            note: Free text.
            labels: E.g. cow, teat and liner.
            **options: Others of `POST /api/v1/captures`: `bits`, `lines`, `armed`, …
        """
        given = {"fields": fields, "duration_s": duration_s, "device": device, "note": note or None}
        body = {name: value for name, value in given.items() if value is not None} | options
        document = self._daemon.ask(CAPTURES, "POST", {**body, "labels": dict(labels or {})})
        return RemoteCapture(self._daemon, document)

    def stream(self, device: str | None = None, patience_s: float = TIMEOUT_S) -> Iterator[StreamedPoints]:
        """The points of every field that is measured from now on, as long as they are asked for.

        `points.frame` has `n`, `target`, `xyz_mm` and the covariances, `points.skipped` the fields that this
        program was too slow for.

        Args:
            device: Name of the device, where there are several.
            patience_s: Longest time without any field.

        Raises:
            NotReady: The daemon has ended, or measures no field.
        """
        return follow_points(self._daemon, device, patience_s)

    def __repr__(self) -> str:
        return f"<Connection to {self._daemon.url}>"


def connect(url: str = HERE, token: str | None = None, *, token_file: PathLike | None = None) -> Connection:
    """Connects to a running daemon; nothing is asked until something is wanted of it.

    Args:
        url: Its address.
        token: A token, as printed by `grabberd token add`; by default that in the environment variable
            GRABBERD_TOKEN, if any. A daemon that has no tokens needs none.
        token_file: A file with the token instead.
    """
    return Connection(url, token, token_file)
