"""Streaming: a queue of mapped buffers, with the kernel's events and errors, each named by its cause.

Buffers are mapped once, and their owner, the kernel or this process, is always known.
"""

import contextlib
import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.errors import Cause, DeviceAbsent, DeviceError, DeviceLost, DeviceRefused, StreamFailed
from grabberd_v4l2 import abi
from grabberd_v4l2.fields import Stamp
from grabberd_v4l2.marks import Marks
from grabberd_v4l2.node import POLL_ERR, POLL_HUP, POLL_IN, POLL_NVAL, POLL_PRI, Node, Pages

GONE = frozenset({errno.ENODEV, errno.ENXIO, errno.ENOENT})
"""Error numbers of calls on a missing device."""


class _Meaning(NamedTuple):
    """Meaning of an error number; without a cause the device is malfunctioning."""

    cause: Cause | None
    what: str
    hint: str

    def error(self, message: str, path: Path) -> DeviceError:
        hint = self.hint.format(path=path)
        return StreamFailed(message, hint) if self.cause is None else DeviceRefused(message, hint, self.cause)


_RIGHTS = _Meaning(
    Cause.NO_RIGHTS,
    "may not be opened by this user",
    "add grabberd's user to the group 'video', or install the driver's udev rule; then log in again, or "
    "restart the service",
)
_HUNG = _Meaning(
    None, "does not respond properly", "grabberd retries; if this persists, unplug it and plug it in again"
)
_NO_BANDWIDTH = _Meaning(
    Cause.NO_BANDWIDTH,
    "finds no bandwidth left on its USB bus",
    "PAL takes 20.7 MB/s: one dongle per USB 2.0 bus, none at USB 1.1 speed; plug it into another bus, "
    "or ask a digital camera for a smaller 'size' or 'rate_hz', or for 'format: MJPG'",
)
_MEANINGS = {
    errno.EBUSY: _Meaning(
        Cause.DEVICE_BUSY,
        "is in use by another program",
        "end that program; 'fuser -v {path}' shows which it is",
    ),
    errno.EACCES: _RIGHTS,
    errno.EPERM: _RIGHTS,
    errno.EISDIR: _Meaning(Cause.DEVICE_REFUSED, "is a directory", "name a node such as /dev/video0"),
    errno.ENOTTY: _Meaning(
        Cause.DEVICE_REFUSED,
        "is not a video device, or lacks a required function",
        "'grabberd devices' lists the available devices",
    ),
    errno.ENOSPC: _NO_BANDWIDTH,
    # Returned by stk1160 where the bus has refused the setting with large packets.
    errno.EMSGSIZE: _NO_BANDWIDTH,
    errno.ENOMEM: _Meaning(
        Cause.DEVICE_REFUSED, "gets no memory for its buffers", "reduce the option 'buffers'; 8 are enough"
    ),
    # Returned by a USB dongle with hung firmware; a reset of its port often revives it.
    errno.EIO: _HUNG,
    errno.EPIPE: _HUNG,
    errno.EPROTO: _HUNG,
    errno.ETIMEDOUT: _HUNG,
}
_OTHERWISE = _Meaning(
    Cause.DEVICE_REFUSED, "refuses a request", "'v4l2-ctl -d {path} --all' and 'dmesg' show details"
)


def failure(error: OSError, path: Path, gone: type[DeviceError]) -> DeviceError:
    """The device error for a kernel error.

    Args:
        error: Kernel error; its `filename`, if any, is the name of the failed call.
        path: Path of the node.
        gone: Class of the error for a missing device.
    """
    answer = f"{error.filename or 'open'}: {os.strerror(error.errno or 0)}"
    if error.errno in GONE:
        return gone(f"{path} is not there ({answer})", "plug the grabber in; grabberd retries automatically")
    meaning = _MEANINGS.get(error.errno or 0, _OTHERWISE)
    return meaning.error(f"{path} {meaning.what} ({answer})", path)


def stream_failure(error: OSError, path: Path, hint: str = "") -> DeviceError:
    """The device error for a kernel error while streaming: DeviceLost or StreamFailed.

    Args:
        error: Kernel error; see `failure`.
        path: Path of the node.
        hint: Hint of a StreamFailed; by default that of the error number.
    """
    found = failure(error, path, DeviceLost)
    return found if isinstance(found, DeviceLost) else StreamFailed(found.message, hint or found.hint)


@contextmanager
def opening(path: Path) -> Iterator[None]:
    """Translates errors while a device is being opened; if it is missing, to DeviceAbsent."""
    try:
        yield
    except OSError as error:
        raise failure(error, path, DeviceAbsent) from error


@contextmanager
def restarting(path: Path) -> Iterator[None]:
    """Translates errors while a stream is being restarted."""
    try:
        yield
    except OSError as error:
        raise stream_failure(error, path) from error


_IO_ERRORS = 3
"""Consecutive EIO that are tolerated: one may be temporary, e.g. after a lost USB packet."""
_PAUSE_S = 0.001
"""Pause after a spurious wake-up of poll, so that such a driver does not occupy a processor."""
_EVENTS = (abi.EVENT_SOURCE_CHANGE, abi.EVENT_EOS)
_MOST_EVENTS = 256
_AGAIN = "grabberd restarts it; if that does not help, it reopens and resets the device"


class Filled(NamedTuple):
    """A buffer as the kernel filled it.

    Attributes:
        picture: (bytes,) all of its memory, valid until the buffer is given back.
        bytes_used: Number of bytes used by this picture.
        field: FIELD_*.
        stamp: Its time, flags and number.
    """

    picture: NDArray[np.uint8]
    bytes_used: int
    field: int
    stamp: Stamp


class Stream:
    """A node with mapped buffers, into which it streams once it is started.

    Args:
        node: The node.
        count: Number of buffers to ask for.
        picture_bytes: Least size of a buffer.
        marks: Set in every buffer before it is queued; None: none are.

    Attributes:
        buffers: Number of buffers.
        found_empty: True if no buffer was filled when the last `dequeue` started.
    """

    def __init__(self, node: Node, count: int, picture_bytes: int, marks: Marks | None = None) -> None:
        """Allocates the buffers.

        Raises:
            DeviceRefused: The buffers are too few or too small.
            OSError: A call failed; everything is released again.
        """
        self._node = node
        self.found_empty = False
        self._io_errors = 0
        self._source_changed = False
        self._buffers = Buffers(node, count, picture_bytes, marks)
        self.buffers = len(self._buffers)

    def start(self) -> None:
        """Queues the buffers and starts the stream; after a failure, `stop` releases them.

        Raises:
            OSError: A call failed.
        """
        refusal = self._buffers.queue_idle()
        if refusal is not None:
            raise refusal
        for event in _EVENTS:
            with contextlib.suppress(OSError):  # hardly any card supports events
                self._node.subscribe(event)
        self._node.stream_on()

    def stop(self) -> None:
        """Stops the stream and releases its buffers; may be called twice, and on a missing node."""
        # In this order: the kernel refuses to free the buffers of a queue that streams.
        with contextlib.suppress(OSError):
            self._node.stream_off()
        self._buffers.release()

    def source_changed(self) -> bool:
        """True if the kernel has signalled a change of the source since the last call."""
        changed, self._source_changed = self._source_changed, False
        return changed

    @contextmanager
    def dequeue(self, timeout_s: float) -> Iterator[Filled | None]:
        """The oldest filled buffer, or None after the timeout; leaving the block gives it back.

        Raises:
            DeviceLost: The node is missing.
            StreamFailed: The node exists, but delivers no more pictures.
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
        self.found_empty, left_s = False, 0.0  # first without waiting, to check whether a buffer is filled
        while True:
            ready = self._poll(left_s)
            taken = self._take() if ready & POLL_IN else None
            now_ns = self._node.now_ns()
            if taken is not None or (self.found_empty and now_ns >= deadline_ns):
                return taken
            if ready:  # a spurious wake-up, which such a driver may repeat
                self._node.pause(_PAUSE_S)
            self.found_empty, left_s = True, max(deadline_ns - now_ns, 0) / 1e9

    def _keep_queue_filled(self) -> None:
        refusal = self._buffers.queue_idle()
        if refusal is None or self._buffers.queued >= max(FEWEST, self.buffers // 2):
            return
        if refusal.errno in GONE:
            raise stream_failure(refusal, self._node.path, _AGAIN)
        raise StreamFailed(
            f"{self._node.path} accepts no buffers, {self._buffers.queued} of {self.buffers} are left "
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
        # ERR alone may also mean that the queue has failed while the device exists; a harmless call shows.
        gone = bool(ready & (POLL_HUP | POLL_NVAL))
        if not gone:
            try:
                self._node.capability()
            except OSError as error:
                gone = error.errno in GONE
        if gone:
            return DeviceLost(
                f"{self._node.path} has disappeared", "plug the grabber in; grabberd retries automatically"
            )
        return StreamFailed(f"{self._node.path} has stopped streaming with an error", _AGAIN)

    def _drain_events(self) -> None:
        """Reads all pending events, since a remaining one would wake every poll."""
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
                f"{self._node.path} returns buffer {buffer.index}, which does not exist", _AGAIN
            )
        self._io_errors = 0
        return buffer.index, self._filled(buffer)

    def _after_failed_dequeue(self, error: OSError) -> None:
        """Tolerates a few consecutive EIO, and queues buffers lost by them again."""
        self._io_errors += 1
        if error.errno != errno.EIO or self._io_errors > _IO_ERRORS:
            raise stream_failure(error, self._node.path, _AGAIN)
        try:
            self._buffers.find_lost()
            self._buffers.queue_idle()
        except OSError as worse:
            raise stream_failure(worse, self._node.path, _AGAIN) from error

    def _filled(self, buffer: abi.Buffer) -> Filled:
        time_ns = buffer.timestamp.tv_sec * 1_000_000_000 + buffer.timestamp.tv_usec * 1_000
        return Filled(
            picture=self._buffers.take(buffer.index),
            bytes_used=buffer.bytesused,
            field=buffer.field,
            stamp=Stamp(time_ns, buffer.flags, buffer.sequence, self._node.now_ns()),
        )


FEWEST = 2
"""Minimum number of buffers, so that the driver has one to fill while another is being read."""


class Buffers:
    """Buffers of a node, allocated and mapped, initially not queued.

    A buffer refused by the kernel is kept and offered again, so that the queue cannot run dry unnoticed.
    """

    def __init__(self, node: Node, count: int, picture_bytes: int, marks: Marks | None = None) -> None:
        """Allocates the buffers and maps them.

        Raises:
            DeviceRefused: The driver grants fewer than `FEWEST`, or they are too small for a picture.
            OSError: The kernel refused a call; buffers allocated so far are released.
        """
        self._node = node
        self._marks = marks
        self._pages: list[Pages] = []
        self._idle: set[int] = set()
        self._taken: set[int] = set()
        try:
            self._make(count, picture_bytes)
        except BaseException:
            self.release()
            raise

    def _make(self, count: int, picture_bytes: int) -> None:
        granted = self._node.request_buffers(count)
        if granted < FEWEST:
            raise _refused(self._node, f"grants {granted} buffers of {count}")
        for index in range(granted):
            buffer = self._node.buffer(index)
            if buffer.length < picture_bytes:
                raise _refused(self._node, f"makes buffers of {buffer.length} bytes for {picture_bytes}")
            self._pages.append(self._node.map(buffer))
            self._idle.add(index)

    def __len__(self) -> int:
        return len(self._pages)

    @property
    def queued(self) -> int:
        """Number of buffers owned by the kernel."""
        return len(self._pages) - len(self._idle) - len(self._taken)

    def queue_idle(self) -> OSError | None:
        """Queues all idle buffers; returns the kernel's last refusal, if any."""
        refusal = None
        for index in sorted(self._idle):
            if self._marks is not None:
                self._marks.put(self._pages[index].writable)
            try:
                self._node.queue(index)
                self._idle.discard(index)
            except OSError as error:
                refusal = error
        return refusal

    def take(self, index: int) -> NDArray[np.uint8]:
        """Takes a filled buffer: (bytes,) read-only."""
        self._taken.add(index)
        return self._pages[index].array

    def give_back(self, index: int) -> None:
        """Returns a buffer to the kernel; if it is refused, it is offered again with the next."""
        if index in self._taken:
            self._taken.discard(index)
            self._idle.add(index)
            self.queue_idle()

    def find_lost(self) -> None:
        """Finds buffers that the kernel released in a failed dequeue."""
        ours = self._idle | self._taken
        held = abi.BUF_FLAG_QUEUED | abi.BUF_FLAG_DONE
        lost = (i for i in range(len(self)) if i not in ours and not self._node.buffer(i).flags & held)
        self._idle.update(lost)

    def release(self) -> None:
        """Unmaps and frees all buffers; may be called twice, and on a missing node."""
        # Unmapped first: without V4L2_BUF_CAP_SUPPORTS_ORPHANED_BUFS, the kernel refuses to free mapped
        # buffers.
        for pages in self._pages:
            pages.unmap()
        self._pages.clear()
        self._idle.clear()
        self._taken.clear()
        with contextlib.suppress(OSError):
            self._node.request_buffers(0)


def _refused(node: Node, what: str) -> DeviceRefused:
    return DeviceRefused(
        f"{node.path} {what}", "choose another number (option 'buffers', 8 to 32) or another format"
    )
