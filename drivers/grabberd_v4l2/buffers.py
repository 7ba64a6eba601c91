"""The kernel's buffers: mapped once, with their owner, kernel or us, always known."""

import contextlib

import numpy as np
from numpy.typing import NDArray

from grabberd.errors import DeviceRefused
from grabberd_v4l2 import abi
from grabberd_v4l2.kernel import Pages
from grabberd_v4l2.node import Node

FEWEST = 2
"""With a single buffer the driver has none to fill while that one is being read."""


class Buffers:
    """Buffers of a node, allocated and mapped, initially not queued.

    A buffer that the kernel refuses is kept and offered again, so that the queue cannot run dry unnoticed.
    """

    def __init__(self, node: Node, count: int, picture_bytes: int) -> None:
        """Allocates the buffers and maps them.

        Raises:
            DeviceRefused: the driver grants fewer than `FEWEST`, or they are too small for a picture.
            OSError: the kernel refused a call; buffers allocated so far are released.
        """
        self._node = node
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
        """Number of buffers that the kernel holds."""
        return len(self._pages) - len(self._idle) - len(self._taken)

    def queue_idle(self) -> OSError | None:
        """Queues all idle buffers; returns the kernel's last refusal, if any."""
        refusal = None
        for index in sorted(self._idle):
            try:
                self._node.queue(index)
                self._idle.discard(index)
            except OSError as error:
                refusal = error
        return refusal

    def take(self, index: int) -> NDArray[np.uint8]:
        """A buffer that the kernel has filled: (bytes,) read-only."""
        self._taken.add(index)
        return self._pages[index].array

    def give_back(self, index: int) -> None:
        """Returns a buffer to be refilled; if the kernel refuses it, it is offered again with the next."""
        if index in self._taken:
            self._taken.discard(index)
            self._idle.add(index)
            self.queue_idle()

    def find_lost(self) -> None:
        """Finds buffers that the kernel released without naming them, after a failed dequeue."""
        ours = self._idle | self._taken
        held = abi.BUF_FLAG_QUEUED | abi.BUF_FLAG_DONE
        lost = (i for i in range(len(self)) if i not in ours and not self._node.buffer(i).flags & held)
        self._idle.update(lost)

    def release(self) -> None:
        """Unmaps and frees all buffers; may be called twice, and on a node that is gone."""
        # Unmapped first: except where V4L2_BUF_CAP_SUPPORTS_ORPHANED_BUFS is set, the kernel refuses to free
        # buffers that are mapped.
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
