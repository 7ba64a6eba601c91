"""Two ways to read a device: polled, one file a channel at a steady rate, or in scans through its character
device, each stamped by the kernel, whose bytes are decoded by the types that the kernel states.
"""

import errno
import math
import os
import re
import select
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from grabberd.core.channels import Anomaly, Dating, MissingReadings, Readings
from grabberd.errors import DeviceLost, DeviceRefused, StreamFailed, count_of
from grabberd.instrument.acquisition.device import attribute
from grabberd.runtime import Clock
from grabberd.tables import LARGEST_NUMBER
from grabberd_loggers.iio.tree import IioChannel, IioDevice, number

MISSED = "a reading was left out: the one before took too long"
FAILED, NOT_A_NUMBER = "a channel could not be read", "not a number"
_GONE = "plug the sensor in again, or load its driver; grabberd retries automatically"
_USUAL_NS = 200_000
"""Time that a conversion usually takes."""


class PolledChannels:
    """Reads channels one after the other, at a steady rate.

    Args:
        channels: Channels to read.
        rate_hz: Readings per second.
        clock: Clock that they are read by.

    Raises:
        OSError: A channel cannot be opened.
    """

    dating = Dating.MONOTONIC
    time_sigma_ns = _USUAL_NS

    def __init__(self, channels: Sequence[IioChannel], rate_hz: float, clock: Clock) -> None:
        self._channels, self._clock = channels, clock
        self._period_ns = round(1e9 / rate_hz)
        self.rate_hz: float | None = rate_hz
        self._files: list[int] = []
        try:
            self._files += [os.open(channel.file, os.O_RDONLY) for channel in channels]
        except OSError:
            self.close()
            raise
        self._due_ns = clock.now_ns()

    def read(self, timeout_s: float) -> Readings:
        """The next reading, once it is due.

        Raises:
            DeviceLost: The device went away.
        """
        wait_ns = self._due_ns - self._clock.now_ns()
        if wait_ns > timeout_s * 1e9:
            self._clock.sleep(timeout_s)
            return Readings.none(len(self._channels))
        self._clock.sleep(wait_ns / 1e9)
        begin_ns = self._clock.now_ns()
        anomalies: list[Anomaly] = []
        values = [
            self._value(*one, begin_ns, anomalies) for one in zip(self._channels, self._files, strict=True)
        ]
        end_ns = self._clock.now_ns()
        anomalies += self._next(end_ns)
        middle = np.array([(begin_ns + end_ns) // 2], np.int64)
        sigma_ns = max(round((end_ns - begin_ns) / math.sqrt(12)), 1_000)
        return Readings(middle, np.array([values]), tuple(anomalies), sigma_ns)

    def close(self) -> None:
        """Close the files."""
        while self._files:
            os.close(self._files.pop())

    def _next(self, now_ns: int) -> list[Anomaly]:
        """Put the next reading off to the first due time that has not passed."""
        self._due_ns += self._period_ns
        missed = max(-(-(now_ns - self._due_ns) // self._period_ns), 0)
        self._due_ns += missed * self._period_ns
        return [Anomaly(now_ns, MISSED, count_of(missed, "reading"), missed)] if missed else []

    def _value(self, channel: IioChannel, file: int, now_ns: int, anomalies: list[Anomaly]) -> float:
        try:
            content = os.pread(file, 64, 0)
        except OSError as error:
            if not channel.file.exists():
                raise DeviceLost(f"{channel.file.parent} is gone", _GONE) from error
            anomalies.append(Anomaly(now_ns, FAILED, f"{channel.name}: {error.strerror}", 1))
            return math.nan
        if not content and not channel.file.exists():
            raise DeviceLost(f"{channel.file.parent} is gone", _GONE)
        try:
            raw = float(content)
        except ValueError:
            raw = math.nan
        if not abs(raw) <= LARGEST_NUMBER:
            anomalies.append(Anomaly(now_ns, NOT_A_NUMBER, f"{channel.name}: {content[:40]!r}", 1))
            return math.nan
        return channel.value(raw)


TIMESTAMP = "timestamp"
_TYPE = re.compile(
    r"^(?P<order>le|be):(?P<sign>[su])(?P<bits>\d+)/(?P<storage>8|16|32|64)(X(?P<repeat>\d+))?(>>(?P<shift>\d+))?$"
)


class Element(NamedTuple):
    """A channel in a scan.

    Attributes:
        name: Its name.
        position: Its place among the others, from 0.
        type: What the kernel states, e.g. "le:s24/32>>8".
    """

    name: str
    position: int
    type: str


@dataclass(frozen=True, slots=True)
class _Place:
    offset: int
    dtype: np.dtype[np.generic]
    shift: int
    bits: int
    is_signed: bool


class ScanFormat:
    """Decodes the bytes of scans.

    Every element lies at a multiple of its own size, and a scan is as long as a multiple of the largest.

    Args:
        elements: The enabled channels, the timestamp among them.

    Raises:
        ValueError: A type is none that is known.
    """

    def __init__(self, elements: Sequence[Element]) -> None:
        end, largest = 0, 1
        self._places: dict[str, _Place] = {}
        for element in sorted(elements, key=lambda one: one.position):
            place, size = _placed(element, end)
            self._places[element.name] = place
            end, largest = place.offset + size, max(largest, size)
        self.bytes = -(-end // largest) * largest

    def decode(self, data: bytes) -> dict[str, NDArray[np.int64]]:
        """Numbers of each channel in whole scans."""
        scans = np.frombuffer(data, np.uint8).reshape(-1, self.bytes)
        return {name: _numbers(scans, place) for name, place in self._places.items()}


def _placed(element: Element, end: int) -> tuple[_Place, int]:
    match = _TYPE.match(element.type)
    if match is None or int(match["repeat"] or 1) != 1:
        raise ValueError(f"{element.name} has the type {element.type!r}, which is not known")
    size = int(match["storage"]) // 8
    bits, shift = int(match["bits"]), int(match["shift"] or 0)
    if not 0 < bits + shift <= 8 * size:
        raise ValueError(f"{element.name} has the type {element.type!r}, which is impossible")
    offset = -(-end // size) * size
    dtype = np.dtype(f"{'<' if match['order'] == 'le' else '>'}u{size}")
    return _Place(offset, dtype, shift, bits, match["sign"] == "s"), size


def _numbers(scans: NDArray[np.uint8], place: _Place) -> NDArray[np.int64]:
    cells = np.ascontiguousarray(scans[:, place.offset : place.offset + place.dtype.itemsize])
    raw = cells.view(place.dtype)[:, 0].astype(np.uint64) >> np.uint64(place.shift)
    unused = np.uint64(64 - place.bits)
    # Shifted to the top and back: the second shift fills in the sign, or zeros.
    top = raw << unused
    return top.view(np.int64) >> np.int64(unused) if place.is_signed else (top >> unused).astype(np.int64)


_SCANS = 4096
_LENGTH = 1024
"""Scans that the kernel holds for the reader."""
_FARTHEST_NS = 10_000_000_000
OTHER_CLOCK, BACKWARD = "a time is not of the clock of the fields", "a time runs backward"


class BufferedChannels:
    """Reads scans of a device's buffer.

    Args:
        device: The device.
        channels: Channels to read.
        rate_hz: Sampling frequency to ask for; None: as it is.
        trigger: Name of the trigger to use; None: as it is.
        clock: Clock that stamps are compared with.

    Raises:
        OSError: An attribute cannot be written, or the character device cannot be opened.
        DeviceRefused: The device cannot stamp in CLOCK_MONOTONIC, or its scans cannot be decoded.
    """

    dating = Dating.MONOTONIC
    time_sigma_ns = 100_000

    def __init__(
        self,
        device: IioDevice,
        channels: Sequence[IioChannel],
        rate_hz: float | None,
        trigger: str | None,
        clock: Clock,
    ) -> None:
        self._device, self._channels, self._clock = device, channels, clock
        self._rest = b""
        self._file: int | None = None
        self._newest_ns = -1
        self._missing = MissingReadings()
        _write(device.folder / "buffer" / "enable", "0")
        self._choose_clock()
        self._set_up(rate_hz, trigger)
        self._format = self._chosen_format()
        self._file = os.open(device.node, os.O_RDONLY | os.O_NONBLOCK)
        try:
            _write(device.folder / "buffer" / "enable", "1")
        except OSError:
            self.close()
            raise
        frequency = number(device.folder / "sampling_frequency")
        self.rate_hz: float | None = frequency if frequency > 0 else rate_hz

    def read(self, timeout_s: float) -> Readings:
        """The scans that have come.

        Raises:
            DeviceLost: The device went away.
            StreamFailed: It cannot be read.
        """
        assert self._file is not None
        poll = select.poll()
        poll.register(self._file, select.POLLIN)
        if not poll.poll(timeout_s * 1000):
            return Readings.none(len(self._channels))
        data = self._rest + self._bytes(self._file)
        whole = len(data) // self._format.bytes * self._format.bytes
        self._rest = data[whole:]
        return self._readings(data[:whole]) if whole else Readings.none(len(self._channels))

    def close(self) -> None:
        """Stop the buffer, and close the character device."""
        if self._file is not None:
            os.close(self._file)
            self._file = None
            with suppress(OSError):  # the device may be gone, and its buffer with it
                _write(self._device.folder / "buffer" / "enable", "0")

    def _bytes(self, file: int) -> bytes:
        try:
            data = os.read(file, _SCANS * self._format.bytes)
        except BlockingIOError:
            return b""
        except OSError as error:
            if error.errno in (errno.ENODEV, errno.EIO, errno.ENXIO):
                raise DeviceLost(f"{self._device.node} is gone", _GONE) from error
            raise StreamFailed(f"{self._device.node} cannot be read: {error.strerror}", _GONE) from error
        if not data:
            raise DeviceLost(f"{self._device.node} is gone", _GONE)
        return data

    def _readings(self, data: bytes) -> Readings:
        now_ns = self._clock.now_ns()
        columns = self._format.decode(data)
        time_ns = columns[TIMESTAMP]
        far = np.abs(time_ns - now_ns) > _FARTHEST_NS
        newest = np.maximum.accumulate(np.concatenate([[self._newest_ns], np.where(far, -1, time_ns)]))
        backward = ~far & (time_ns <= newest[:-1])
        good = ~far & ~backward
        self._newest_ns = int(newest[-1])
        anomalies = [
            Anomaly(now_ns, reason, f"{int(time_ns[bad][0])} ns", int(bad.sum()))
            for reason, bad in ((OTHER_CLOCK, far), (BACKWARD, backward))
            if bad.any()
        ]
        raw = [columns[channel.name].astype(np.float64) for channel in self._channels]
        values = np.column_stack(
            [(one + channel.offset) * channel.scale for one, channel in zip(raw, self._channels, strict=True)]
        )
        missing = self._missing.look(time_ns[good], now_ns) if good.any() else ()
        return Readings(time_ns[good], values[good], (*anomalies, *missing), self.time_sigma_ns)

    def _choose_clock(self) -> None:
        file = self._device.folder / "current_timestamp_clock"
        if file.exists():
            _write(file, "monotonic")
        if attribute(file) != "monotonic":
            raise DeviceRefused(
                f"{self._device.number} does not stamp its scans in CLOCK_MONOTONIC",
                "poll it instead: buffered: false",
            )

    def _set_up(self, rate_hz: float | None, trigger: str | None) -> None:
        folder = self._device.folder
        if trigger is not None:
            _write(folder / "trigger" / "current_trigger", trigger)
        if rate_hz is not None and (folder / "sampling_frequency").exists():
            _write(folder / "sampling_frequency", f"{rate_hz:g}")
        wanted = {channel.name for channel in self._channels} | {TIMESTAMP}
        for file in sorted((folder / "scan_elements").glob("in_*_en")):
            name = file.name.removeprefix("in_").removesuffix("_en")
            _write(file, "1" if name in wanted else "0")
        _write(folder / "buffer" / "length", str(_LENGTH))

    def _chosen_format(self) -> ScanFormat:
        folder = self._device.folder / "scan_elements"
        names = [*(channel.name for channel in self._channels), TIMESTAMP]
        elements = [
            Element(name, round(number(folder / f"in_{name}_index")), attribute(folder / f"in_{name}_type"))
            for name in names
            if (folder / f"in_{name}_index").exists()
        ]
        lacking = set(names) - {element.name for element in elements}
        if lacking:
            raise DeviceRefused(
                f"the buffer of {self._device.number} has no {', '.join(sorted(lacking))}",
                "choose other channels, or poll it: buffered: false",
            )
        try:
            return ScanFormat(elements)
        except ValueError as error:
            hint = "poll it instead: buffered: false"
            raise DeviceRefused(f"{self._device.number}: {error}", hint) from error


def _write(file: Path, value: str) -> None:
    # Unbuffered: the kernel answers to the write itself.
    with file.open("wb", buffering=0) as unbuffered:
        unbuffered.write(value.encode())
