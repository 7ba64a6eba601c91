"""An open video node and its calls; each raises `OSError` with the kernel's error.

The system calls of this driver, behind an interface that tests can replace.
"""

import ctypes
import errno
import fcntl
import mmap
import os
import select
import time
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from grabberd_v4l2 import abi

POLL_IN, POLL_PRI = select.POLLIN, select.POLLPRI
POLL_ERR, POLL_HUP, POLL_NVAL = select.POLLERR, select.POLLHUP, select.POLLNVAL


class Pages(Protocol):
    """A kernel buffer in this process's memory."""

    @property
    def array(self) -> NDArray[np.uint8]:
        """(bytes,) read-only."""
        ...

    @property
    def writable(self) -> NDArray[np.uint8]:
        """(bytes,) The same, to be written while the buffer is this process's; no view of it may be kept."""
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
        self._writable: NDArray[np.uint8] | None = np.asarray(_Memory(self._address, length))

    @property
    def array(self) -> NDArray[np.uint8]:
        """(bytes,) read-only."""
        array = self.writable.view()
        array.flags.writeable = False
        return array

    @property
    def writable(self) -> NDArray[np.uint8]:
        """(bytes,) to be written."""
        if self._writable is None:
            raise ValueError("the buffer is not mapped any more")
        return self._writable

    def unmap(self) -> None:
        """Releases the device's memory at once, and the address range with its last view."""
        if self._writable is not None:
            flags = mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS | _MAP_FIXED
            _map(self._address, self._length, mmap.PROT_READ, flags, -1, 0)
            self._writable = None


class _Memory:
    """Owner of an address range: the base of every array in it."""

    def __init__(self, address: int, length: int) -> None:
        self._place = address, length
        self.__array_interface__ = {
            "shape": (length,),
            "typestr": "|u1",
            "data": (address, False),
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


T = TypeVar("T")
# More inputs or formats than any card has: a driver whose list never ends must not hang the thread.
_ENDLESS = 256


class Capability(NamedTuple):
    """Names of a node, and its own capabilities (`CAP_*`)."""

    driver: str
    card: str
    bus_info: str
    flags: int


class Node:
    """A descriptor of a video node.

    Attributes:
        path: Path of the node.
        called_ns: Total time spent in its calls, except `poll`.
    """

    def __init__(self, kernel: Kernel, path: Path) -> None:
        self._kernel = kernel
        self.path = path
        self.called_ns = 0
        self._fd: int | None = kernel.open(path)

    def close(self) -> None:
        """Closes the descriptor; may be called twice."""
        fd, self._fd = self._fd, None
        if fd is not None:
            self._kernel.close(fd)

    def poll(self, timeout_s: float) -> int:
        """Polls for POLL_* events."""
        return self._kernel.poll(self._open_fd(), timeout_s)

    def capability(self) -> Capability:
        """Queries the capabilities of the node."""
        found = self._call(abi.QUERYCAP, abi.Capability())
        # On newer kernels, `device_caps` are those of this node, `capabilities` those of the whole device.
        own = found.capabilities & abi.CAP_DEVICE_CAPS
        flags = found.device_caps if own else found.capabilities
        return Capability(_text(found.driver), _text(found.card), _text(found.bus_info), flags)

    def inputs(self) -> tuple[abi.Input, ...]:
        """The card's inputs."""
        return tuple(self._enumerated(abi.ENUMINPUT, lambda index: abi.Input(index=index)))

    def input(self) -> abi.Input:
        """The selected input, with its status."""
        number = self._call(abi.G_INPUT, abi.Integer()).value
        return self._call(abi.ENUMINPUT, abi.Input(index=number))

    def set_input(self, index: int) -> None:
        """Selects an input."""
        self._call(abi.S_INPUT, abi.Integer(index))

    def standards(self) -> tuple[abi.Standard, ...]:
        """Standards that the selected input supports."""
        return tuple(self._enumerated(abi.ENUMSTD, lambda index: abi.Standard(index=index)))

    def standard(self) -> int:
        """The selected standard."""
        return int(self._call(abi.G_STD, abi.StandardSet()).value)

    def set_standard(self, standard: int) -> None:
        """Sets a standard."""
        self._call(abi.S_STD, abi.StandardSet(standard))

    def seen_standard(self) -> int:
        """Standards that the signal may have; 0 without a signal."""
        return int(self._call(abi.QUERYSTD, abi.StandardSet()).value)

    def pixel_formats(self) -> tuple[str, ...]:
        """Names of the pixel formats that the node delivers, in its own order of preference."""
        described = self._enumerated(abi.ENUM_FMT, lambda index: abi.FmtDesc(index=index, type=abi.CAPTURE))
        return tuple(abi.fourcc_name(one.pixelformat) for one in described)

    def set_format(self, columns: int, lines: int, fourcc: str, field: int) -> None:
        """Requests a picture format; `format` reads the granted one."""
        self._call(abi.S_FMT, _format(columns, lines, fourcc, field))

    def tried_format(self, columns: int, lines: int, fourcc: str, field: int) -> abi.PixFormat:
        """The format that would be granted, without setting it."""
        # Unlike S_FMT, TRY_FMT works while another program is streaming.
        return self._call(abi.TRY_FMT, _format(columns, lines, fourcc, field)).fmt.pix

    def format(self) -> abi.PixFormat:
        """The granted picture format."""
        return self._call(abi.G_FMT, abi.Format(type=abi.CAPTURE)).fmt.pix

    def frame_sizes(self, fourcc: str) -> tuple[abi.FrmSizeEnum, ...]:
        """Sizes of a pixel format: many entries, or one with a range; empty if the driver reports none."""
        number = abi.fourcc(fourcc)
        return self._until_a_range(
            abi.ENUM_FRAMESIZES, lambda index: abi.FrmSizeEnum(index=index, pixel_format=number)
        )

    def frame_intervals(self, fourcc: str, columns: int, lines: int) -> tuple[abi.FrmIvalEnum, ...]:
        """Times from picture to picture for a size: many entries, or one with a range."""
        asked = {"pixel_format": abi.fourcc(fourcc), "width": columns, "height": lines}
        return self._until_a_range(
            abi.ENUM_FRAMEINTERVALS, lambda index: abi.FrmIvalEnum(index=index, **asked)
        )

    def set_interval(self, seconds: Fraction) -> None:
        """Requests a time from picture to picture; `interval` reads the granted one."""
        wanted = abi.StreamParm(type=abi.CAPTURE)
        period = wanted.parm.capture.timeperframe
        period.numerator, period.denominator = seconds.numerator, seconds.denominator
        self._call(abi.S_PARM, wanted)

    def interval(self) -> Fraction | None:
        """The granted time from picture to picture, or None if the card does not report it."""
        period = self._call(abi.G_PARM, abi.StreamParm(type=abi.CAPTURE)).parm.capture.timeperframe
        if not period.numerator or not period.denominator:
            return None
        return Fraction(period.numerator, period.denominator)

    def request_buffers(self, count: int) -> int:
        """Allocates buffers; returns the number granted. 0 frees them."""
        wanted = abi.RequestBuffers(count=count, type=abi.CAPTURE, memory=abi.MEMORY_MMAP)
        return int(self._call(abi.REQBUFS, wanted).count)

    def buffer(self, index: int) -> abi.Buffer:
        """Queries the position and the state of a buffer."""
        return self._call(abi.QUERYBUF, _mapped(index))

    def map(self, buffer: abi.Buffer) -> Pages:
        """A buffer's memory."""
        return self._kernel.mmap(self._open_fd(), buffer.length, buffer.m.offset)

    def queue(self, index: int) -> None:
        """Hands a buffer to the kernel to be filled."""
        self._call(abi.QBUF, _mapped(index))

    def dequeue(self) -> abi.Buffer:
        """Takes the oldest filled buffer; `BlockingIOError` if there is none."""
        return self._call(abi.DQBUF, _mapped(0))

    def stream_on(self) -> None:
        """Starts the stream."""
        self._call(abi.STREAMON, abi.Integer(abi.CAPTURE))

    def stream_off(self) -> None:
        """Stops the stream; the kernel then releases all queued buffers."""
        self._call(abi.STREAMOFF, abi.Integer(abi.CAPTURE))

    def subscribe(self, event: int) -> None:
        """Subscribes to an event."""
        self._call(abi.SUBSCRIBE_EVENT, abi.EventSubscription(type=event))

    def event(self) -> abi.Event:
        """The oldest event; `OSError` if there is none."""
        return self._call(abi.DQEVENT, abi.Event())

    def pause(self, seconds: float) -> None:
        """Sleeps."""
        self._kernel.sleep(seconds)

    def now_ns(self) -> int:
        """CLOCK_MONOTONIC."""
        return self._kernel.now_ns()

    def _until_a_range(self, request: int, at: Any) -> tuple[Any, ...]:
        """Items of an enumeration of single values, or only its first item if that is a range."""
        found: list[Any] = []
        for one in self._enumerated(request, at):
            found.append(one)
            if one.type != abi.FRMSIZE_TYPE_DISCRETE:
                break
        return tuple(found)

    def _enumerated(self, request: int, at: Any) -> Iterator[Any]:
        """Items of an enumeration; empty if the card does not support it."""
        for index in range(_ENDLESS):
            try:
                yield self._call(request, at(index))
            except OSError as error:
                if error.errno in (errno.EINVAL, errno.ENOTTY, errno.ENODATA):
                    return
                raise

    def _call(self, request: int, argument: T) -> T:
        """Makes a call; returns the argument as filled by the kernel. An error has the name of the call."""
        begin_ns = self._kernel.now_ns()
        try:
            self._kernel.ioctl(self._open_fd(), request, argument)
        except OSError as error:
            raise OSError(error.errno, error.strerror, abi.NAMES[request]) from error
        finally:
            self.called_ns += self._kernel.now_ns() - begin_ns
        return argument

    def _open_fd(self) -> int:
        if self._fd is None:
            raise OSError(errno.EBADF, "closed")
        return self._fd


def _format(columns: int, lines: int, fourcc: str, field: int) -> abi.Format:
    wanted = abi.Format(type=abi.CAPTURE)
    pix = wanted.fmt.pix
    pix.width, pix.height, pix.pixelformat, pix.field = columns, lines, abi.fourcc(fourcc), field
    return wanted


def _mapped(index: int) -> abi.Buffer:
    return abi.Buffer(index=index, type=abi.CAPTURE, memory=abi.MEMORY_MMAP)


def _text(raw: bytes) -> str:
    return raw.decode("utf-8", "replace")
