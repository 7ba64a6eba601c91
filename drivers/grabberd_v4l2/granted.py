"""Settings that a kernel driver granted, read back after all were requested."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Granted:
    """The stream as the kernel's driver believes it to be.

    Attributes:
        columns: pixels a line; `lines`: of one buffer, 576 of a frame or 288 of one field.
        bytes_per_line: from one line to the next, in the first plane.
        size_bytes: of a whole picture in a buffer.
        fourcc: the pixel format, e.g. "YUYV".
        field: V4L2_FIELD_*, never ANY.
        standard: e.g. "PAL".
        kernel_driver: e.g. "bttv"; `card`: the device's own name; `bus_info`: where it is plugged in.
        buffers: in the kernel's queue.
    """

    columns: int
    lines: int
    bytes_per_line: int
    size_bytes: int
    fourcc: str
    field: int
    standard: str
    kernel_driver: str
    card: str
    bus_info: str
    buffers: int
