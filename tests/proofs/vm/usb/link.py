"""The device's side of USB/IP, over a stream socket.

Wire format after Documentation/usb/usbip_protocol.rst of Linux 6.1: big-endian words, heads of 48 bytes.
"""

import contextlib
import socket
import struct
import threading
from collections import defaultdict, deque
from dataclasses import dataclass
from typing import Protocol

_SUBMIT, _UNLINK, _RET_SUBMIT, _RET_UNLINK = 1, 2, 3, 4
_HEAD_BYTES = 48
_BASIC = struct.Struct(">5I")  # command, sequence number, device, direction (1: in), endpoint
_OF_SUBMIT = struct.Struct(">I4i8s")  # flags, length, start frame, packets, interval, setup
_OF_UNLINK = struct.Struct(">I")  # sequence number of what is to be unlinked
_RESULT = struct.Struct(">5i8x")  # status, actual length, start frame, packets, errors
_UNLINKED = struct.Struct(">i24x")
_PACKET = struct.Struct(">3Ii")  # offset, length, actual length, status
STALLED, _RESET = -32, -104
"""EPIPE and ECONNRESET, as the kernel has them."""


@dataclass(slots=True)
class Urb:
    """A request of the host.

    Attributes:
        sequence: Its number.
        endpoint: Its endpoint; 0 for control requests.
        is_in: True if the device sends.
        length: Bytes that are sent, or that there is room for.
        packets: Descriptors of its isochronous packets, as they came; empty if it has none.
        setup: Of a control request.
        data: What the host sends.
        start_frame: As the host gave it.
        is_given_up, is_answered: The host wants no answer any longer; it has got one.
    """

    sequence: int
    endpoint: int
    is_in: bool
    length: int
    packets: bytes
    setup: bytes
    data: bytes
    start_frame: int
    is_given_up: bool = False
    is_answered: bool = False

    @property
    def packet_count(self) -> int:
        """Number of isochronous packets."""
        return len(self.packets) // _PACKET.size


class Plugged(Protocol):
    """What is behind a link."""

    def control(self, setup: bytes, data: bytes) -> bytes | None:
        """The answer to a control request; None stalls the endpoint."""


class Link:
    """A connection of a device to the kernel's virtual host controller.

    Args:
        end: The device's end of a socket pair.
        device: Answers control requests, in the thread that runs `serve`.

    Attributes:
        is_alive: False once either side has closed it.
        is_deaf: True leaves control requests without an answer.
    """

    def __init__(self, end: socket.socket, device: Plugged) -> None:
        self._end = end
        self._device = device
        self._incoming = end.makefile("rb", 1 << 16)
        self._waiting: dict[int, deque[Urb]] = defaultdict(deque)
        self._taken: dict[int, Urb | None] = {}
        self._tables: dict[tuple[bytes, tuple[int, ...]], bytes] = {}
        self._lock = threading.Lock()
        self._sending = threading.Lock()
        self.is_alive, self.is_deaf = True, False

    def close(self) -> None:
        """Ends the connection without a word, as a broken cable does."""
        self.is_alive = False
        with contextlib.suppress(OSError):
            self._end.shutdown(socket.SHUT_RDWR)
        self._end.close()

    def serve(self) -> None:
        """Takes requests until the connection ends."""
        try:
            while self.is_alive:
                self._take_one()
        except (OSError, EOFError):
            pass
        self.is_alive = False

    def take(self, endpoint: int) -> Urb | None:
        """The oldest waiting request of an endpoint, to be answered next; None if there is none."""
        with self._lock:
            queue = self._waiting[endpoint]
            self._taken[endpoint] = queue.popleft() if queue else None
            return self._taken[endpoint]

    def answer(self, urb: Urb, data: bytes = b"", status: int = 0) -> None:
        """Answers a control or bulk request."""
        actual = len(data) if urb.is_in else urb.length
        self._send(urb, _RESULT.pack(status, actual, 0, 0, 0), data if urb.is_in else b"")

    def answer_packets(self, urb: Urb, packets: list[bytes]) -> None:
        """Answers an isochronous request with a packet for each of its descriptors, empty ones included."""
        lengths = tuple(map(len, packets))
        key = (urb.packets, lengths)
        if (table := self._tables.get(key)) is None:
            described = zip(_PACKET.iter_unpack(urb.packets), lengths, strict=True)
            table = b"".join(_PACKET.pack(at, room, actual, 0) for (at, room, _, _), actual in described)
            self._tables[key] = table
        result = _RESULT.pack(0, sum(lengths), urb.start_frame, len(lengths), 0)
        # What the packets hold goes without the gaps between them.
        self._send(urb, result, *packets, table)

    def _send(self, urb: Urb, *parts: bytes) -> None:
        head = _BASIC.pack(_RET_SUBMIT, urb.sequence, 0, 0, 0)
        with self._sending:
            # An answer after RET_UNLINK makes vhci_hcd drop the whole connection.
            if not urb.is_given_up:
                urb.is_answered = True
                self._end.sendall(b"".join((head, *parts)))

    def _take_one(self) -> None:
        head = self._read(_HEAD_BYTES)
        command, sequence, _, is_in, endpoint = _BASIC.unpack_from(head)
        if command == _UNLINK:
            self._unlink(sequence, *_OF_UNLINK.unpack_from(head, _BASIC.size))
            return
        _, length, start_frame, count, _, setup = _OF_SUBMIT.unpack_from(head, _BASIC.size)
        data = b"" if is_in else self._read(length)
        packets = self._read(_PACKET.size * max(count, 0))  # −1 or 0: not isochronous
        urb = Urb(sequence, endpoint, bool(is_in), length, packets, setup, data, start_frame)
        if endpoint:
            with self._lock:
                self._waiting[endpoint].append(urb)
        elif self.is_deaf:
            with self._lock:
                self._waiting[0].append(urb)
        elif (said := self._device.control(setup, data)) is None:
            self.answer(urb, status=STALLED)
        else:
            self.answer(urb, said[:length])

    def _unlink(self, sequence: int, victim: int) -> None:
        status = 0
        with self._lock:
            for queue in self._waiting.values():
                for urb in [one for one in queue if one.sequence == victim]:
                    queue.remove(urb)
                    status = _RESET
            taken = [one for one in self._taken.values() if one is not None and one.sequence == victim]
        with self._sending:
            for urb in taken:
                if not urb.is_answered:
                    urb.is_given_up, status = True, _RESET
            head = _BASIC.pack(_RET_UNLINK, sequence, 0, 0, 0)
            self._end.sendall(head + _UNLINKED.pack(status))

    def _read(self, count: int) -> bytes:
        data = self._incoming.read(count)
        if len(data) < count:
            raise EOFError
        return data
