"""The kernel's buffer queue of one node, with the rules of videobuf2."""

import errno
import os
from collections import deque

import numpy as np

from grabberd_v4l2 import abi

DEQUEUED, QUEUED, DONE = range(3)


def refusal(number):
    return OSError(number, os.strerror(number))


class Memory:
    """A buffer: what the card writes, and what a process has mapped of it."""

    def __init__(self, size):
        self.bytes = np.zeros(size, np.uint8)
        self.state = DEQUEUED
        self.mappings = 0
        self.filled = abi.Buffer()


class FakePages:
    """A mapping; once it is undone, whoever kept a view sees zeros."""

    def __init__(self, memory):
        self._memory = memory
        self._bytes = memory.bytes
        self._array = self._bytes.view()
        self._array.flags.writeable = False
        memory.mappings += 1

    @property
    def array(self):
        assert self._memory is not None, "the buffer is not mapped any more"
        return self._array

    @property
    def writable(self):
        assert self._memory is not None, "the buffer is not mapped any more"
        assert self._memory.state == DEQUEUED, "the buffer is the card's"
        return self._bytes

    def unmap(self):
        if self._memory is not None:
            self._memory.mappings -= 1
            self._memory.bytes = np.zeros_like(self._bytes)
            self._bytes[:] = 0
            self._memory = None


class Queue:
    """Buffers, which of them wait to be filled and which to be taken."""

    def __init__(self):
        self.memories = []
        self.waiting = deque()
        self.done = deque()
        self.streaming = False
        self.failed = False

    @property
    def busy(self):
        return bool(self.memories)

    @property
    def mapped(self):
        return sum(memory.mappings for memory in self.memories)

    def request(self, count, size):
        if self.streaming or self.mapped:
            raise refusal(errno.EBUSY)
        self.memories = [Memory(size) for _ in range(count)]
        self.waiting.clear()
        self.done.clear()

    def memory(self, index):
        if index >= len(self.memories):
            raise refusal(errno.EINVAL)
        return self.memories[index]

    def queue(self, index):
        memory = self.memory(index)
        if memory.state != DEQUEUED:
            raise refusal(errno.EINVAL)
        memory.state = QUEUED
        self.waiting.append(memory)

    def dequeue(self):
        if not self.streaming:
            raise refusal(errno.EINVAL)
        if self.failed:
            raise refusal(errno.EIO)
        if not self.done:
            raise refusal(errno.EAGAIN)
        memory = self.done.popleft()
        memory.state = DEQUEUED
        return memory

    def fill(self):
        """The buffer that the card may write to now, None if all are elsewhere."""
        if not self.waiting:
            return None
        memory = self.waiting.popleft()
        memory.state = DONE
        self.done.append(memory)
        return memory

    def start(self):
        self.streaming, self.failed = True, False

    def stop(self):
        self.streaming = self.failed = False
        self.waiting.clear()
        self.done.clear()
        for memory in self.memories:
            memory.state = DEQUEUED
