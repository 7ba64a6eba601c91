"""The driver contract: what every frame grabber, real or simulated, offers to the capture thread.

A driver is a package of its own, found by name through the entry point group `grabberd.drivers`. It is called
with the options of its configuration (`Driver(**options)`), raising a `ValueError` with a clear text for
options it cannot use; nothing is opened before `open()`. Only one thread uses a grabber at a time.
"""

from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from enum import StrEnum
from typing import NamedTuple, Protocol

from grabberd.field import Field


class FieldOrder(StrEnum):
    """How a driver delivers the fields of a frame."""

    ALTERNATE = "alternate"
    TOP_FIRST = "top_first"
    BOTTOM_FIRST = "bottom_first"
    ONE_PARITY = "one_parity"


class Signal(StrEnum):
    """What the grabber says of the camera's signal."""

    PRESENT = "present"
    ABSENT = "absent"
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True)
class StreamInfo:
    """What was granted, not what was asked for; and how far the driver can be trusted.

    Attributes:
        driver: the driver's name; `card`: the device's own.
        standard: e.g. "PAL".
        columns: pixels a row; `field_rows`: rows of one delivered field.
        rate_hz: fields a second.
        field_order: see `FieldOrder`.
        pixel_format: e.g. "GREY".
        buffers: fields that the driver holds while nobody dequeues.
        live: False for a recording, whose fields may repeat bit for bit.
        waits_for_reader: fields come as fast as they are read and none is lost by reading late; the capture
            thread then reads only while a capture takes them.
        counts_losses: `sequence` grows by more than one when a field is lost.
        tells_signal: `signal()` can be believed.
        time_sigma_ns: how nearly a field's time is the middle of its exposure.
        details: what else a person may want to know.
        remarks: what a person has to know, in sentences: a rate of 25 Hz, a bus that is too slow.
    """

    driver: str
    card: str
    standard: str
    columns: int
    field_rows: int
    rate_hz: float
    field_order: FieldOrder
    pixel_format: str
    buffers: int
    live: bool
    counts_losses: bool
    tells_signal: bool
    time_sigma_ns: int
    waits_for_reader: bool = False
    details: dict[str, str] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()


class GrabbedField(NamedTuple):
    """One field out of a driver's buffer.

    Attributes:
        field: its grey values, a view that is valid only inside the `dequeue` block.
        time_ns: middle of the exposure, CLOCK_MONOTONIC, as nearly as the driver lets it be known.
        sequence: the driver's own count of *fields*, or None where it has none.
        damage: None, or in a few words what the driver says is wrong with it.
    """

    field: Field
    time_ns: int
    sequence: int | None
    damage: str | None


class Grabber(Protocol):
    """A frame grabber."""

    def open(self) -> StreamInfo:
        """Opens the device and starts streaming.

        Raises:
            DeviceAbsent: it is not there; trying again later may help.
            DeviceRefused: it is there and says no.
            StreamFailed: it is there, but does not answer as it should; `reset` may help.
        """
        ...

    def dequeue(self, timeout_s: float) -> AbstractContextManager[Sequence[GrabbedField]]:
        """The fields that have come, the older first; waits up to `timeout_s` for the first of them.

        The fields are views into the driver's buffer; leaving the block gives the buffer back. An empty
        sequence means that nothing came in time.

        Raises:
            DeviceLost: it went away.
            StreamFailed: it is there, but streams no more; `restart` may help.
            StreamEnded: a recording has no further field.
            PictureError: a recording's next picture cannot be read; the ones before it were delivered.
        """
        ...

    def signal(self) -> Signal:
        """Whether there is a camera at the input; asked between fields, never blocks."""
        ...

    def restart(self) -> StreamInfo:
        """Stops and starts the stream of the open device; what waits in its buffers is dropped.

        Raises:
            DeviceLost: it is not open, or it went away.
            StreamFailed: it does not start.
            DeviceRefused: what is granted now is not what was granted before.
        """
        ...

    def reset(self) -> None:
        """Resets the closed device as pulling its plug would, where that can be done by software.

        Raises:
            DeviceAbsent: it is not there.
            DeviceRefused: it cannot be reset, or not with these rights; the hint says what is missing.
        """
        ...

    def close(self) -> None:
        """Stops and lets go of the device; safe twice, and after an `open` that failed."""
        ...
