"""Filled buffers as they come, and what the kernel says beside them."""

import contextlib
import errno
from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.errors import DeviceError, DeviceLost, StreamFailed
from grabberd_v4l2 import abi
from grabberd_v4l2.buffers import FEWEST, Buffers
from grabberd_v4l2.failures import GONE, failure
from grabberd_v4l2.kernel import POLL_ERR, POLL_HUP, POLL_IN, POLL_NVAL, POLL_PRI
from grabberd_v4l2.node import Node

_IO_ERRORS = 3
_PAUSE_S = 0.001
_EVENTS = (abi.EVENT_SOURCE_CHANGE, abi.EVENT_EOS)
_MOST_EVENTS = 256
_AGAIN = "it is started again; if that does not help, the device is opened again and reset"


class Filled(NamedTuple):
    """A buffer as the kernel filled it.

    Attributes:
        picture: (bytes,) all of its memory, valid until it is given back.
        bytes_used: how much of it is of this picture.
        flags: BUF_FLAG_*; `field`: FIELD_*; `sequence`: the driver's count.
        time_ns: the driver's timestamp; `arrival_ns`: CLOCK_MONOTONIC when it was taken here.
    """

    picture: NDArray[np.uint8]
    bytes_used: int
    flags: int
    field: int
    sequence: int
    time_ns: int
    arrival_ns: int


class Stream:
    """A node that streams into mapped buffers.

    Attributes:
        buffers: their number.
    """

    def __init__(self, node: Node, count: int, picture_bytes: int) -> None:
        """Makes, queues and starts.

        Raises:
            DeviceRefused: the buffers are too few or too small.
            OSError: as the kernel answers; nothing is left behind.
        """
        self._node = node
        self._io_errors = 0
        self._source_changed = False
        self._buffers = Buffers(node, count, picture_bytes)
        self.buffers = len(self._buffers)
        try:
            self._start()
        except BaseException:
            self.stop()
            raise

    def _start(self) -> None:
        refusal = self._buffers.queue_idle()
        if refusal is not None:
            raise refusal
        for event in _EVENTS:
            with contextlib.suppress(OSError):  # hardly a card has any
                self._node.subscribe(event)
        self._node.stream_on()

    def stop(self) -> None:
        """Stops, unmaps and frees; safe twice, and on a node that is gone."""
        with contextlib.suppress(OSError):
            self._node.stream_off()
        self._buffers.release()

    def source_changed(self) -> bool:
        """True if the kernel signalled it since the last call."""
        changed, self._source_changed = self._source_changed, False
        return changed

    @contextmanager
    def dequeue(self, timeout_s: float) -> Iterator[Filled | None]:
        """The oldest filled buffer, or None when the time is over; leaving the block gives it back.

        Raises:
            DeviceLost: the node is gone.
            StreamFailed: it is there, but no more pictures will come.
        """
        taken = self._wait(timeout_s)
        try:
            yield None if taken is None else taken[1]
        finally:
            if taken is not None:
                self._buffers.give_back(taken[0])

    def _wait(self, timeout_s: float) -> tuple[int, Filled] | None:
        deadline_ns = self._node.now_ns() + round(timeout_s * 1e9)
        self._keep_queue_filled()
        while True:
            left_s = max(deadline_ns - self._node.now_ns(), 0) / 1e9
            ready = self._poll(left_s)
            taken = self._take() if ready & POLL_IN else None
            if taken is not None or self._node.now_ns() >= deadline_ns:
                return taken
            if ready:  # woken for nothing: such a driver may go on like that
                self._node.pause(_PAUSE_S)

    def _keep_queue_filled(self) -> None:
        refusal = self._buffers.queue_idle()
        if refusal is None or self._buffers.queued >= max(FEWEST, self.buffers // 2):
            return
        if refusal.errno in GONE:
            raise self._failed(refusal)
        raise StreamFailed(
            f"{self._node.path} takes back no buffers, {self._buffers.queued} of {self.buffers} are left "
            f"({refusal.strerror})",
            _AGAIN,
        )

    def _poll(self, timeout_s: float) -> int:
        ready = self._node.poll(timeout_s)
        if ready & POLL_PRI:
            self._drain_events()
        if ready & (POLL_ERR | POLL_HUP | POLL_NVAL):
            raise self._broken(ready)
        return ready

    def _broken(self, ready: int) -> DeviceError:
        gone = bool(ready & (POLL_HUP | POLL_NVAL))
        if not gone:
            try:
                self._node.capability()
            except OSError as error:
                gone = error.errno in GONE
        if gone:
            return DeviceLost(
                f"{self._node.path} went away", "plug the grabber in; it is tried again by itself"
            )
        return StreamFailed(f"{self._node.path} has stopped streaming with an error", _AGAIN)

    def _drain_events(self) -> None:
        """An event that is left lying would wake every poll from now on."""
        for _ in range(_MOST_EVENTS):
            try:
                event = self._node.event()
            except OSError:
                return
            self._source_changed |= event.type == abi.EVENT_SOURCE_CHANGE

    def _take(self) -> tuple[int, Filled] | None:
        try:
            buffer = self._node.dequeue()
        except BlockingIOError:
            return None
        except OSError as error:
            self._after_failed_dequeue(error)
            return None
        if buffer.index >= self.buffers:
            raise StreamFailed(
                f"{self._node.path} fills a buffer {buffer.index} that it does not have", _AGAIN
            )
        self._io_errors = 0
        return buffer.index, self._filled(buffer)

    def _after_failed_dequeue(self, error: OSError) -> None:
        """One EIO may be a hiccup; the buffer that it cost is offered again."""
        self._io_errors += 1
        if error.errno != errno.EIO or self._io_errors > _IO_ERRORS:
            raise self._failed(error)
        try:
            self._buffers.find_lost()
            self._buffers.queue_idle()
        except OSError as worse:
            raise self._failed(worse) from error

    def _failed(self, error: OSError) -> DeviceError:
        told = failure(error, self._node.path, DeviceLost)
        return told if isinstance(told, DeviceLost) else StreamFailed(told.message, _AGAIN)

    def _filled(self, buffer: abi.Buffer) -> Filled:
        time_ns = buffer.timestamp.tv_sec * 1_000_000_000 + buffer.timestamp.tv_usec * 1_000
        return Filled(
            picture=self._buffers.take(buffer.index),
            bytes_used=buffer.bytesused,
            flags=buffer.flags,
            field=buffer.field,
            sequence=buffer.sequence,
            time_ns=time_ns,
            arrival_ns=self._node.now_ns(),
        )
