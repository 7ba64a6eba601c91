"""`python -m proofs.vm.usb KIND PORT`: an emulated device, which does what it is told on standard input.

A line is a list in JSON, a word and its arguments; the answer is a line of JSON.

    ["in"]  ["out"]  ["cut"]             plugs it in; unplugs it; breaks the connection
    ["script", [FIELD, KIND, …], …]      faults, by fields from the next frame on; says which field that is
    ["slow", FACTOR]  ["stamped", BOOL]  ["signal", BOOL]  ["60 Hz", BOOL]  ["sees", FILM]
    ["deaf", BOOL]                       leaves control requests without an answer
    ["bandwidth", BOOL]                  False: of the bus none is left
    ["columns", NUMBER]                  of the pictures in Motion JPEG from now on
    ["state"]                            number of the next field, and of fields that the emulation skipped
"""

import json
import os
import socket
import sys
import threading
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

from proofs.vm.usb import stk1160, usbtv, uvc
from proofs.vm.usb.faults import Due
from proofs.vm.usb.link import Link
from proofs.vm.usb.stk1160 import Stk1160
from proofs.vm.usb.stream import BulkStream, Stream
from proofs.vm.usb.usbtv import Usbtv
from proofs.vm.usb.uvc import Claims, UvcCamera


def _lying(**claims: int) -> Callable[[], UvcCamera]:
    return partial(UvcCamera, is_jpeg=True, claims=Claims(**claims))


KINDS: dict[str, tuple[Callable[[], Usbtv | Stk1160 | UvcCamera], int]] = {
    "usbtv": (Usbtv, usbtv.VIDEO),
    "usbtv, 525 lines": (Usbtv, usbtv.VIDEO),
    "stk1160": (Stk1160, stk1160.VIDEO),
    "uvc, YUYV": (UvcCamera, uvc.VIDEO),
    "uvc, MJPG": (partial(UvcCamera, is_jpeg=True), uvc.VIDEO),
    "uvc, twice": (partial(UvcCamera, times=2), uvc.VIDEO),
    "uvc, bulk": (partial(UvcCamera, is_bulk=True), uvc.VIDEO),
    "uvc, of no columns": (_lying(columns=0), uvc.VIDEO),
    "uvc, at 10 MHz": (_lying(interval_100ns=0), uvc.VIDEO),
    "uvc, of 100 bytes": (_lying(picture_bytes=100), uvc.VIDEO),
}
"""Devices, and the endpoints of their pictures."""
CONTROLLER = Path("/sys/devices/platform/vhci_hcd.0")
_HIGH_SPEED = 3
_DEVICE = 0x10002
"""Bus and number that the kernel is told; it does not use them."""
_SOCKET_BYTES = 1 << 20
_LEAD = 8
"""Fields until the first one of a script: those before it may be on their way."""


class Emulated:
    """A device and its port.

    Args:
        kind: One of `KINDS`.
        port: Of the virtual host controller.
    """

    def __init__(self, kind: str, port: int) -> None:
        made, self._endpoint = KINDS[kind]
        self.device = made()
        self._port = port
        self._link: Link | None = None

    def plug_in(self) -> None:
        """The kernel's end of the socket pair stays open in the kernel alone."""
        own, kernels = socket.socketpair(socket.AF_UNIX, socket.SOCK_STREAM)
        for end in (own, kernels):
            for option in (socket.SO_SNDBUF, socket.SO_RCVBUF):
                end.setsockopt(socket.SOL_SOCKET, option, _SOCKET_BYTES)
        self._link = Link(own, self.device)
        threading.Thread(target=self._link.serve, daemon=True).start()
        is_bulk = isinstance(self.device, UvcCamera) and self.device.is_bulk
        (BulkStream if is_bulk else Stream)(self._link, self._endpoint, self.device).start()
        said = f"{self._port} {kernels.fileno()} {_DEVICE} {_HIGH_SPEED}"
        (CONTROLLER / "attach").write_text(said)
        kernels.close()

    def unplug(self) -> None:
        """As the tool of USB/IP does."""
        (CONTROLLER / "detach").write_text(str(self._port))
        time.sleep(0.1)
        self.cut()

    def cut(self) -> None:
        """Breaks the connection."""
        if self._link is not None:
            self._link.close()
            self._link = None

    def script(self, *faults: list[Any]) -> int:
        """Faults by fields from the next frame on; returns the number of that one's first field."""
        first = self.device.field + _LEAD & ~1
        for at, kind, *arguments in faults:
            self.device.script.add(Due(first + at, kind, tuple(arguments)))
        return first

    def state(self) -> dict[str, Any]:
        """Where it is."""
        return {"field": self.device.field, "skipped": self.device.skipped}

    def set_slow(self, factor: float) -> None:
        """Fields come that much slower than the standard's."""
        self.device.slow = factor

    def set_stamped(self, is_stamped: bool) -> None:
        """Numbers in the rows, or none."""
        self.device.camera.is_stamped = is_stamped

    def set_signal(self, there: bool) -> None:
        """Of the camera."""
        assert isinstance(self.device, Stk1160)
        self.device.decoder.has_signal = there

    def set_deaf(self, is_deaf: bool) -> None:
        """Control requests get no answer."""
        assert self._link is not None
        self._link.is_deaf = is_deaf

    def set_bandwidth(self, is_left: bool) -> None:
        """Of the bus."""
        self.device.has_bandwidth = is_left

    def set_columns(self, columns: int) -> None:
        """Of the pictures in Motion JPEG."""
        assert isinstance(self.device, UvcCamera)
        self.device.columns_sent = columns

    def set_film(self, film: str) -> None:
        """What the camera sees."""
        self.device.camera.see(Path(film))

    def set_60_hz(self, is_so: bool) -> None:
        """The standard of the camera."""
        assert isinstance(self.device, Stk1160)
        self.device.decoder.is_60_hz = is_so


def main(kind: str, port: str) -> None:
    """Until standard input ends."""
    emulated = Emulated(kind, int(port))
    words: dict[str, Callable[..., Any]] = {
        "in": emulated.plug_in,
        "out": emulated.unplug,
        "cut": emulated.cut,
        "script": emulated.script,
        "state": emulated.state,
        "slow": emulated.set_slow,
        "stamped": emulated.set_stamped,
        "signal": emulated.set_signal,
        "60 Hz": emulated.set_60_hz,
        "sees": emulated.set_film,
        "deaf": emulated.set_deaf,
        "bandwidth": emulated.set_bandwidth,
        "columns": emulated.set_columns,
    }
    for line in sys.stdin:
        word, *arguments = json.loads(line)
        try:
            answer = words[word](*arguments)
        except OSError as error:
            answer = {"error": repr(error)}
        print(json.dumps(answer), flush=True)
    os._exit(0)


if __name__ == "__main__":
    main(*sys.argv[1:])
