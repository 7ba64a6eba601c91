"""Transfers of pictures in real time: what a grabber sends, and when."""

import math
import threading
import time
from typing import NamedTuple, Protocol

from proofs.vm.usb.link import Link

MICROFRAME_S = 125e-6
_IDLE_S = 0.0005
_AHEAD_S = 0.003
"""The host has requests for 16 ms: several may be answered at a time."""
_NEW_STREAM_S = 0.05
"""Without a request for so long, the stream has been stopped."""
_BEHIND_S = 0.2
"""So far behind its camera, a grabber leaves fields out."""


class Sent(NamedTuple):
    """Packets of a field.

    Attributes:
        packets: One for each microframe, none longer than the endpoint's; of bulk transfers, one for each.
        silent_s: Time for which nothing is sent after them.
    """

    packets: list[bytes]
    silent_s: float = 0.0


class Source(Protocol):
    """A grabber that sends fields.

    Attributes:
        period_s: From field to field.
        field: Number of the next field.
        skipped: Fields that the emulation itself was too slow for.
    """

    period_s: float
    field: int
    skipped: int

    def next_field(self) -> Sent:
        """The next field."""


class Stream(threading.Thread):
    """Answers the requests of an isochronous endpoint.

    Args:
        link: The connection.
        endpoint: Number of the endpoint.
        source: Of the fields.
    """

    def __init__(self, link: Link, endpoint: int, source: Source) -> None:
        super().__init__(daemon=True)
        self._link = link
        self._endpoint = endpoint
        self._source = source
        self._packets: list[bytes] = []
        self._at = 0
        self._field_due_s = self._silent_until_s = 0.0

    def run(self) -> None:
        """Until the link is closed."""
        due_s, answered_s = None, 0.0
        while self._link.is_alive:
            urb = self._link.take(self._endpoint)
            if urb is None:
                due_s = None
                time.sleep(_IDLE_S)
                continue
            now_s = time.monotonic()
            if due_s is None:
                if now_s - answered_s > _NEW_STREAM_S:
                    self._begin(now_s)
                due_s = now_s
            count = urb.packet_count
            due_s += count * MICROFRAME_S
            if due_s > now_s + _AHEAD_S:
                time.sleep(due_s - now_s)
            elif now_s > due_s + _NEW_STREAM_S:
                due_s = now_s
            try:
                self._link.answer_packets(urb, self._next(count, due_s))
            except OSError:
                return
            answered_s = time.monotonic()

    def _begin(self, now_s: float) -> None:
        self._packets, self._at, self._field_due_s = [], 0, now_s

    def _next(self, count: int, due_s: float) -> list[bytes]:
        if len(self._packets) - self._at >= count:
            found = self._packets[self._at : self._at + count]
            self._at += count
            return found
        found = []
        for _ in range(count):
            if self._at >= len(self._packets) and due_s >= max(self._field_due_s, self._silent_until_s):
                self._begin_field(due_s)
            found.append(self._packets[self._at] if self._at < len(self._packets) else b"")
            self._at += 1
        return found

    def _begin_field(self, due_s: float) -> None:
        source = self._source
        behind = math.ceil((due_s - self._field_due_s) / source.period_s)
        if behind * source.period_s > _BEHIND_S or self._silent_until_s:
            # The camera has gone on, and goes on with its next field.
            source.field += behind
            source.skipped += 0 if self._silent_until_s else behind
            self._field_due_s += behind * source.period_s
            self._silent_until_s = 0.0
            return
        self._packets, silent_s = source.next_field()
        self._at = 0
        self._field_due_s += source.period_s
        if silent_s:
            self._silent_until_s = due_s + silent_s


class BulkStream(Stream):
    """Answers the requests of a bulk endpoint, which waits for its data, each by one packet of a field."""

    def run(self) -> None:
        """Until the link is closed."""
        answered_s = 0.0
        while self._link.is_alive:
            urb = self._link.take(self._endpoint)
            now_s = time.monotonic()
            if urb is None:
                time.sleep(_IDLE_S)
                continue
            if now_s - answered_s > _NEW_STREAM_S:
                self._begin(now_s)
            while self._at >= len(self._packets):
                due_s = max(self._field_due_s, self._silent_until_s)
                time.sleep(max(0.0, due_s - time.monotonic()))
                self._begin_field(time.monotonic())
            self._at += 1
            try:
                self._link.answer(urb, self._packets[self._at - 1])
            except OSError:
                return
            answered_s = time.monotonic()
