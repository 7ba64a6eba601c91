"""An open video node and its calls; each raises `OSError` with the kernel's error."""

import errno
from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from grabberd_v4l2 import abi
from grabberd_v4l2.kernel import Kernel, Pages

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
