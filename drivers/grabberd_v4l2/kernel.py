"""The system calls of this driver, behind an interface that tests can replace."""

import ctypes
import fcntl
import mmap
import os
import select
import time
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

POLL_IN, POLL_PRI = select.POLLIN, select.POLLPRI
POLL_ERR, POLL_HUP, POLL_NVAL = select.POLLERR, select.POLLHUP, select.POLLNVAL


class Pages(Protocol):
    """A kernel buffer in this process's memory."""

    @property
    def array(self) -> NDArray[np.uint8]:
        """(bytes,) read-only."""
        ...

    def unmap(self) -> None:
        """Returns the memory to the kernel; may be called twice. Remaining views then show zeros."""
        ...


class Kernel(Protocol):
    """System calls; each raises `OSError` with the kernel's error, and only `poll` and `sleep` block."""

    def open(self, path: Path) -> int:
        """Opens a node; returns a non-blocking descriptor."""
        ...

    def close(self, fd: int) -> None:
        """Closes a descriptor."""
        ...

    def ioctl(self, fd: int, request: int, argument: Any) -> None:
        """Makes a call with a ctypes object, to which the kernel may write."""
        ...

    def mmap(self, fd: int, length: int, offset: int) -> Pages:
        """Maps a buffer."""
        ...

    def poll(self, fd: int, timeout_s: float) -> int:
        """Polls for POLL_* events; returns 0 after the timeout."""
        ...

    def now_ns(self) -> int:
        """CLOCK_MONOTONIC."""
        ...

    def sleep(self, seconds: float, /) -> None:
        """Sleeps."""
        ...


class LinuxKernel:
    """The system calls of this computer."""

    def open(self, path: Path) -> int:
        """Read and write, non-blocking, not inherited."""
        return os.open(path, os.O_RDWR | os.O_NONBLOCK | os.O_CLOEXEC)

    close = staticmethod(os.close)
    now_ns = staticmethod(time.monotonic_ns)
    sleep = staticmethod(time.sleep)

    def ioctl(self, fd: int, request: int, argument: Any) -> None:
        """Makes a call, and repeats it if a signal interrupts it."""
        while True:
            try:
                fcntl.ioctl(fd, request, argument, True)
                return
            except InterruptedError:
                continue

    def mmap(self, fd: int, length: int, offset: int) -> Pages:
        """Maps a buffer, shared; writable because older drivers refuse anything else."""
        return _MappedPages(fd, length, offset)

    def poll(self, fd: int, timeout_s: float) -> int:
        """Waits for a buffer or an event."""
        # Not select(), which supports no descriptors above 1023 and does not distinguish hang-up from event.
        poller = select.poll()
        poller.register(fd, POLL_IN | POLL_PRI)
        ready = poller.poll(max(timeout_s, 0.0) * 1e3)
        return ready[0][1] if ready else 0


_libc = ctypes.CDLL(None, use_errno=True)
_libc.mmap.restype = ctypes.c_void_p
# Declared, since ctypes would pass undeclared arguments as C int and truncate addresses to 32 bits.
_libc.mmap.argtypes = (ctypes.c_void_p, ctypes.c_size_t, *[ctypes.c_int] * 3, ctypes.c_long)
_libc.munmap.argtypes = (ctypes.c_void_p, ctypes.c_size_t)
_MAP_FIXED = 0x10
_MAP_FAILED = ctypes.c_void_p(-1).value


class _MappedPages:
    """Mapped memory whose address range stays valid after unmapping as long as an array refers to it.

    Python's `mmap` cannot be closed while an array refers to it, and a device with mapped buffers does not
    come back after being unplugged. So `unmap` atomically replaces the buffer with empty memory.
    """

    def __init__(self, fd: int, length: int, offset: int) -> None:
        self._length = length
        self._address = _map(None, length, mmap.PROT_READ | mmap.PROT_WRITE, mmap.MAP_SHARED, fd, offset)
        self._array: NDArray[np.uint8] | None = np.asarray(_Memory(self._address, length))

    @property
    def array(self) -> NDArray[np.uint8]:
        """(bytes,) read-only."""
        if self._array is None:
            raise ValueError("the buffer is not mapped any more")
        return self._array

    def unmap(self) -> None:
        """Releases the device's memory at once, and the address range with its last view."""
        if self._array is not None:
            flags = mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS | _MAP_FIXED
            _map(self._address, self._length, mmap.PROT_READ, flags, -1, 0)
            self._array = None


class _Memory:
    """Owner of an address range: the base of every array in it."""

    def __init__(self, address: int, length: int) -> None:
        self._place = address, length
        self.__array_interface__ = {
            "shape": (length,),
            "typestr": "|u1",
            "data": (address, True),
            "version": 3,
        }

    def __del__(self) -> None:
        _libc.munmap(*self._place)


def _map(address: int | None, length: int, protection: int, flags: int, fd: int, offset: int) -> int:
    mapped = _libc.mmap(address, length, protection, flags, fd, offset)
    if mapped is None or mapped == _MAP_FAILED:
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))
    return int(mapped)
