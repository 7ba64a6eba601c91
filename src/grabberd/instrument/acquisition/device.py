"""The driver contract, the interface of every frame grabber to the capture thread, and how drivers are found.

A driver is a separate package, found by name through the entry point group `grabberd.drivers`. It is
constructed with the options of its configuration (`Driver(**options)`) and raises `ValueError` with a clear
message for options it cannot use; nothing is opened before `open()`. Only one thread uses a grabber at a
time.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from enum import StrEnum
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any, NamedTuple, Protocol

from grabberd.core.channels.logger import Logger
from grabberd.core.field import Field, FieldOrder
from grabberd.errors import DriverMissing
from grabberd.registry import Registry


class Signal(StrEnum):
    """State of the camera's signal as reported by the grabber."""

    PRESENT = "present"
    ABSENT = "absent"
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True)
class StreamInfo:
    """The stream as granted (not as requested), and how far the driver can be trusted.

    Attributes:
        driver: Name of the driver.
        card: The device's own name.
        standard: Video standard, e.g. "PAL".
        columns: Pixels per row.
        field_rows: Rows of one delivered field, or of a progressive picture.
        rate_hz: Fields per second, or whole pictures where there are no fields.
        field_order: See `FieldOrder`.
        pixel_format: E.g. "GREY".
        buffers: Number of fields that the driver holds if none are dequeued: two for each buffer of a frame.
        live: False for a recording, whose fields may repeat bit for bit.
        counts_losses: True if `sequence` grows by more than one when a field is lost.
        tells_signal: True if `signal()` can be trusted.
        time_sigma_ns: Standard deviation of a field's time about the middle of its exposure.
        waits_for_reader: True if fields come as fast as they are read and reading late loses none; the
            capture thread then reads only while a capture takes them.
        details: Further information for people.
        remarks: Warnings for people, in sentences: a rate of 25 Hz, a bus that is too slow.
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

    @property
    def buffered_ns(self) -> int:
        """Time for which the driver's buffers last if no fields are taken."""
        return round(self.buffers * 1e9 / self.rate_hz)


class GrabbedField(NamedTuple):
    """One field out of a driver's buffer.

    Attributes:
        field: Grey values, a view that is valid only inside the `dequeue` block.
        time_ns: Middle of the exposure, CLOCK_MONOTONIC, as exactly as known to the driver.
        sequence: The driver's own count of *fields*, or None if it has none.
        damage: Fault reported by the driver in a few words, or None. "no signal" comes from a recording: the
            picture was not from the camera.
    """

    field: Field
    time_ns: int
    sequence: int | None
    damage: str | None


class Grabber(Protocol):
    """A frame grabber."""

    @property
    def called_ns(self) -> int:
        """Total time spent in calls to the device that should return at once, without waiting for fields; it
        reveals a hanging driver. It never decreases; 0 for a simulated device.
        """
        ...

    @property
    def found_empty(self) -> bool:
        """True if no field was waiting when the last `dequeue` started: then the program takes fields as fast
        as they come, even if the computer is busy.
        """
        ...

    def open(self) -> StreamInfo:
        """Open the device and start streaming.

        Raises:
            DeviceAbsent: The device is not connected; trying again later may help.
            DeviceRefused: The device is connected, but cannot be used as requested.
            StreamFailed: The device does not respond properly; `reset` may help.
        """
        ...

    def dequeue(self, timeout_s: float) -> AbstractContextManager[Sequence[GrabbedField]]:
        """Wait up to `timeout_s` for the next fields, the older first.

        The fields are views into the driver's buffer; leaving the block returns the buffer to the driver. An
        empty sequence means that nothing arrived in time.

        Raises:
            DeviceLost: The device has disappeared.
            StreamFailed: The device is connected, but no longer streams; `restart` may help.
            StreamEnded: A recording has no further field.
            PictureError: A recording's next picture cannot be read; those before it were delivered.
        """
        ...

    def signal(self) -> Signal:
        """Report whether a camera is connected; called between fields, never blocks."""
        ...

    def restart(self) -> StreamInfo:
        """Stop and restart the stream of the open device; fields waiting in its buffers are dropped.

        Raises:
            DeviceLost: The device is not open, or has disappeared.
            StreamFailed: The stream does not start.
            DeviceRefused: The granted stream differs from the previous one.
        """
        ...

    def reset(self) -> None:
        """Reset the closed device like unplugging it, if software can do that.

        Raises:
            DeviceAbsent: The device is not connected.
            DeviceRefused: The device cannot be reset, or not with these permissions; the hint says what is
                missing.
        """
        ...

    def close(self) -> None:
        """Stop streaming and release the device; safe to call twice, and after a failed `open`."""
        ...


GRABBERS: Registry[Grabber] = Registry("grabberd.drivers")
LOGGERS: Registry[Logger] = Registry("grabberd.loggers")


GRABBER_SEARCH, LOGGER_SEARCH = "grabberd.discovery", "grabberd.logger_discovery"


class Verdict(StrEnum):
    """Suitability of a device."""

    RECOMMENDED = "recommended"
    USABLE = "usable"
    DOUBTFUL = "doubtful"
    UNUSABLE = "unusable"


@dataclass(frozen=True, slots=True)
class FoundDevice:
    """A grabber or logger found in this computer.

    Attributes:
        driver: Name of the driver in the configuration, e.g. "v4l2".
        card: The device's own name.
        options: Options for the configuration that identify the device as permanently as possible.
        verdict: Suitability.
        remarks: Reasons for the verdict and warnings, in sentences.
        facts: Further facts in reading order: node, by-path, USB port, formats …
        other_options: Other options by which a configuration may name it.
    """

    driver: str
    card: str
    options: Mapping[str, Any]
    verdict: Verdict
    remarks: tuple[str, ...] = ()
    facts: Mapping[str, str] = field(default_factory=dict)
    other_options: tuple[Mapping[str, Any], ...] = ()

    def is_meant_by(self, driver: str, options: Mapping[str, Any]) -> bool:
        """True if a configuration with this driver and at least these options names this device."""
        ways = (self.options, *self.other_options)
        return driver == self.driver and any(_contains(options, way) for way in ways)


Discovery = Callable[[], Sequence[FoundDevice]]


class Roots(NamedTuple):
    """Root folders of the kernel's and udev's trees."""

    sys: Path = Path("/sys")
    dev: Path = Path("/dev")


SYSTEM = Roots()
"""Root folders of this computer."""


def by_number(folder: Path, pattern: str) -> list[Path]:
    """Entries of a folder that match a pattern, by their number: video10 comes after video9."""
    return sorted(folder.glob(pattern), key=lambda entry: (len(entry.name), entry.name))


def attribute(file: Path) -> str:
    """Text of an attribute in sysfs; "" if it does not exist or its device has just disappeared."""
    try:
        return file.read_text(encoding="utf-8", errors="replace").strip(" \t\r\n\0")
    except OSError:
        return ""


def discover(group: str = GRABBER_SEARCH) -> tuple[FoundDevice, ...]:
    """List the devices that all installed drivers find, ordered by driver name.

    Args:
        group: Entry point group of the searches: `GRABBER_SEARCH` or `LOGGER_SEARCH`.

    Raises:
        DriverMissing: A driver cannot be imported.
    """
    entries = sorted(entry_points(group=group), key=lambda entry: entry.name)
    return tuple(found for entry in entries for found in _load(entry)())


def _load(entry: EntryPoint) -> Discovery:
    try:
        find: Discovery = entry.load()
    except (ImportError, AttributeError) as error:
        raise DriverMissing(
            f"driver '{entry.name}' cannot search for devices: {error}", "reinstall the driver's package"
        ) from error
    return find


def _contains(options: Mapping[str, Any], way: Mapping[str, Any]) -> bool:
    return all(str(options.get(key)).casefold() == str(value).casefold() for key, value in way.items())
