"""The V4L2 structures, constants and call numbers that this driver uses, in the memory layout of this
machine's C.

Names are those of `linux/videodev2.h` without `v4l2_` and `VIDIOC_`. Times are 64 bits wide on every machine:
a 32-bit machine needs Linux 5.6, which accepts both widths and distinguishes them by the size in the call
number. Call numbers are computed from the sizes of their arguments like the kernel's `_IOC`.
"""

import ctypes
import ctypes as c
from enum import IntEnum

_LONG = c.c_size_t
"""As wide as the kernel's `unsigned long` and as a pointer."""

CAPTURE = 1
"""V4L2_BUF_TYPE_VIDEO_CAPTURE."""
MEMORY_MMAP = 1

CAP_VIDEO_CAPTURE = 0x00000001
CAP_VIDEO_OUTPUT = 0x00000002
CAP_VBI_CAPTURE = 0x00000010
CAP_SLICED_VBI_CAPTURE = 0x00000040
CAP_VIDEO_CAPTURE_MPLANE = 0x00001000
CAP_VIDEO_OUTPUT_MPLANE = 0x00002000
CAP_RADIO = 0x00040000
CAP_META_CAPTURE = 0x00800000
CAP_STREAMING = 0x04000000
CAP_DEVICE_CAPS = 0x80000000


class Arrangement(IntEnum):
    """V4L2_FIELD_*: arrangement of fields in buffers; profiles use the names in lower case.

    Woven: the lines of two fields alternate in one buffer. Stacked: one field lies below the other.
    """

    ANY = 0
    NONE = 1
    TOP = 2
    BOTTOM = 3
    INTERLACED = 4
    SEQ_TB = 5
    SEQ_BT = 6
    ALTERNATE = 7
    INTERLACED_TB = 8
    INTERLACED_BT = 9


ONE_FIELD = (Arrangement.TOP, Arrangement.BOTTOM, Arrangement.ALTERNATE)
"""Arrangements with one field per buffer."""

BUF_FLAG_QUEUED = 0x00000002
BUF_FLAG_DONE = 0x00000004
BUF_FLAG_ERROR = 0x00000040
BUF_FLAG_TIMESTAMP_MASK = 0x0000E000
BUF_FLAG_TIMESTAMP_MONOTONIC = 0x00002000
BUF_FLAG_TSTAMP_SRC_MASK = 0x00070000
BUF_FLAG_TSTAMP_SRC_SOE = 0x00010000

INPUT_TYPE_TUNER = 1
IN_ST_NO_POWER = 0x00000001
IN_ST_NO_SIGNAL = 0x00000002
IN_ST_NO_H_LOCK = 0x00000100

STD_PAL = 0x000000FF
STD_525_60 = 0x0000F900
STD_625_50 = 0x00FF06FF

FRMSIZE_TYPE_DISCRETE = FRMIVAL_TYPE_DISCRETE = 1
"""One size or interval per entry; all other types give a range in their first entry."""

EVENT_EOS = 2
EVENT_SOURCE_CHANGE = 5


def _u32(*names: str) -> tuple[tuple[str, type[c.c_uint32]], ...]:
    """Consecutive members of a structure, 32 bits wide each."""
    return tuple((name, c.c_uint32) for name in names)


class Capability(c.Structure):
    """Capabilities of a node."""

    _fields_ = (
        ("driver", c.c_char * 16),
        ("card", c.c_char * 32),
        ("bus_info", c.c_char * 32),
        *_u32("version", "capabilities", "device_caps"),
        ("reserved", c.c_uint32 * 3),
    )


class Input(c.Structure):
    """A socket of the card."""

    _fields_ = (
        ("index", c.c_uint32),
        ("name", c.c_char * 32),
        *_u32("type", "audioset", "tuner"),
        ("std", c.c_uint64),
        *_u32("status", "capabilities"),
        ("reserved", c.c_uint32 * 3),
    )


class Fraction(c.Structure):
    """Seconds per frame."""

    _fields_ = (("numerator", c.c_uint32), ("denominator", c.c_uint32))


class Standard(c.Structure):
    """A video standard that the current input supports."""

    _fields_ = (
        ("index", c.c_uint32),
        ("id", c.c_uint64),
        ("name", c.c_char * 24),
        ("frameperiod", Fraction),
        ("framelines", c.c_uint32),
        ("reserved", c.c_uint32 * 4),
    )


class FmtDesc(c.Structure):
    """A pixel format that a node can deliver."""

    _fields_ = (
        *_u32("index", "type", "flags"),
        ("description", c.c_char * 32),
        *_u32("pixelformat", "mbus_code"),
        ("reserved", c.c_uint32 * 3),
    )


class PixFormat(c.Structure):
    """Size, pixel format and field order of a picture."""

    _fields_ = (
        *_u32("width", "height", "pixelformat", "field", "bytesperline", "sizeimage"),
        *_u32("colorspace", "priv", "flags", "ycbcr_enc", "quantization", "xfer_func"),
    )


# The unions include their widest member, which determines size and alignment of the whole structure; the size
# is part of the call number.
class _Fmt(c.Union):
    _fields_ = (("pix", PixFormat), ("raw", c.c_uint8 * 200), ("aligned_like_a_pointer", _LONG))


class Format(c.Structure):
    """Format requested and granted, by kind of stream."""

    _fields_ = (("type", c.c_uint32), ("fmt", _Fmt))


class SizeRange(c.Structure):
    """Sizes that a scaler can produce."""

    _fields_ = _u32("min_width", "max_width", "step_width", "min_height", "max_height", "step_height")


class DiscreteSize(c.Structure):
    """One size of a picture."""

    _fields_ = (("width", c.c_uint32), ("height", c.c_uint32))


class _Sizes(c.Union):
    _fields_ = (("discrete", DiscreteSize), ("stepwise", SizeRange))


class FrmSizeEnum(c.Structure):
    """A size, or a range of them, that a pixel format can have."""

    _anonymous_ = ("sizes",)
    _fields_ = (*_u32("index", "pixel_format", "type"), ("sizes", _Sizes), ("reserved", c.c_uint32 * 2))


class IntervalRange(c.Structure):
    """Shortest and longest time from picture to picture."""

    _fields_ = (("min", Fraction), ("max", Fraction), ("step", Fraction))


class _Intervals(c.Union):
    _fields_ = (("discrete", Fraction), ("stepwise", IntervalRange))


class FrmIvalEnum(c.Structure):
    """A time from picture to picture, or a range of them, that a size can have."""

    _anonymous_ = ("intervals",)
    _fields_ = (
        *_u32("index", "pixel_format", "width", "height", "type"),
        ("intervals", _Intervals),
        ("reserved", c.c_uint32 * 2),
    )


class CaptureParm(c.Structure):
    """Time from picture to picture, requested and granted."""

    _fields_ = (
        *_u32("capability", "capturemode"),
        ("timeperframe", Fraction),
        *_u32("extendedmode", "readbuffers"),
        ("reserved", c.c_uint32 * 4),
    )


class _Parm(c.Union):
    _fields_ = (("capture", CaptureParm), ("raw_data", c.c_uint8 * 200))


class StreamParm(c.Structure):
    """Parameters of a stream besides its format."""

    _fields_ = (("type", c.c_uint32), ("parm", _Parm))


class RequestBuffers(c.Structure):
    """Number of buffers requested and granted."""

    _fields_ = (
        *_u32("count", "type", "memory", "capabilities"),
        ("flags", c.c_uint8),
        ("reserved", c.c_uint8 * 3),
    )


class Timeval(c.Structure):
    """Seconds and microseconds."""

    _fields_ = (("tv_sec", c.c_int64), ("tv_usec", c.c_int64))


class Timecode(c.Structure):
    """Not used here, but part of every buffer."""

    _fields_ = (
        *_u32("type", "flags"),
        ("frames", c.c_uint8),
        ("seconds", c.c_uint8),
        ("minutes", c.c_uint8),
        ("hours", c.c_uint8),
        ("userbits", c.c_uint8 * 4),
    )


class _Memory(c.Union):
    _fields_ = (("offset", c.c_uint32), ("userptr", _LONG), ("planes", _LONG), ("fd", c.c_int32))


class Buffer(c.Structure):
    """A buffer on its way to the kernel and back."""

    _fields_ = (
        *_u32("index", "type", "bytesused", "flags", "field"),
        ("timestamp", Timeval),
        ("timecode", Timecode),
        *_u32("sequence", "memory"),
        ("m", _Memory),
        *_u32("length", "reserved2"),
        ("request_fd", c.c_int32),
    )


class Timespec(c.Structure):
    """Seconds and nanoseconds."""

    _fields_ = (("tv_sec", c.c_int64), ("tv_nsec", c.c_int64))


class _EventDetail(c.Union):
    _fields_ = (("changes", c.c_uint32), ("data", c.c_uint8 * 64), ("_aligned_like_int64", c.c_int64))


class Event(c.Structure):
    """An event, reported besides the pictures."""

    _fields_ = (
        ("type", c.c_uint32),
        ("u", _EventDetail),
        *_u32("pending", "sequence"),
        ("timestamp", Timespec),
        ("id", c.c_uint32),
        ("reserved", c.c_uint32 * 8),
    )


class EventSubscription(c.Structure):
    """Subscription to events."""

    _fields_ = (*_u32("type", "id", "flags"), ("reserved", c.c_uint32 * 5))


Integer = c.c_int32
"""Argument of G_INPUT, S_INPUT, STREAMON and STREAMOFF."""
StandardSet = c.c_uint64
"""Argument of G_STD, S_STD and QUERYSTD: one bit per standard."""


def fourcc(name: str) -> int:
    """The number of a four-letter pixel format."""
    return int.from_bytes(name.encode("ascii"), "little")


def fourcc_name(number: int) -> str:
    """The letters of a pixel format's number."""
    return (number & 0x7FFFFFFF).to_bytes(4, "little").decode("ascii", "replace").rstrip("\0")


_WRITE, _READ = 1, 2
_TYPE = ord("V")


def _ioc(direction: int, number: int, argument: type) -> int:
    # The size is part of the number: with a structure of the wrong size the kernel refuses the call (ENOTTY)
    # instead of overwriting memory.
    return direction << 30 | ctypes.sizeof(argument) << 16 | _TYPE << 8 | number


QUERYCAP = _ioc(_READ, 0, Capability)
ENUM_FMT = _ioc(_READ | _WRITE, 2, FmtDesc)
G_FMT = _ioc(_READ | _WRITE, 4, Format)
S_FMT = _ioc(_READ | _WRITE, 5, Format)
REQBUFS = _ioc(_READ | _WRITE, 8, RequestBuffers)
QUERYBUF = _ioc(_READ | _WRITE, 9, Buffer)
QBUF = _ioc(_READ | _WRITE, 15, Buffer)
DQBUF = _ioc(_READ | _WRITE, 17, Buffer)
STREAMON = _ioc(_WRITE, 18, Integer)
STREAMOFF = _ioc(_WRITE, 19, Integer)
G_PARM = _ioc(_READ | _WRITE, 21, StreamParm)
S_PARM = _ioc(_READ | _WRITE, 22, StreamParm)
G_STD = _ioc(_READ, 23, StandardSet)
S_STD = _ioc(_WRITE, 24, StandardSet)
ENUMSTD = _ioc(_READ | _WRITE, 25, Standard)
ENUMINPUT = _ioc(_READ | _WRITE, 26, Input)
G_INPUT = _ioc(_READ, 38, Integer)
S_INPUT = _ioc(_READ | _WRITE, 39, Integer)
QUERYSTD = _ioc(_READ, 63, StandardSet)
TRY_FMT = _ioc(_READ | _WRITE, 64, Format)
ENUM_FRAMESIZES = _ioc(_READ | _WRITE, 74, FrmSizeEnum)
ENUM_FRAMEINTERVALS = _ioc(_READ | _WRITE, 75, FrmIvalEnum)
DQEVENT = _ioc(_READ, 89, Event)
SUBSCRIBE_EVENT = _ioc(_WRITE, 90, EventSubscription)

NAMES = {
    number: name
    for name, number in globals().items()
    if isinstance(number, int) and number >> 8 & 0xFF == ord("V")
}
"""Names of the calls by number, for error messages."""
