"""A device that streams scans through its character device, each stamped by the kernel."""

import errno
import os
import select
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np

from grabberd.clock import Clock
from grabberd.core.channels import Anomaly, Dating, MissingReadings, Readings
from grabberd.errors import DeviceLost, DeviceRefused, StreamFailed
from grabberd_loggers.iio.scan import TIMESTAMP, Element, ScanFormat
from grabberd_loggers.iio.tree import IioChannel, IioDevice, number, text

_SCANS = 4096
_LENGTH = 1024
"""Scans that the kernel holds for the reader."""
_FARTHEST_NS = 10_000_000_000
OTHER_CLOCK, BACKWARD = "a time is not of the clock of the fields", "a time runs backward"
_GONE = "plug the sensor in again, or load its driver; grabberd retries automatically"


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
        if text(file) != "monotonic":
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
            Element(name, round(number(folder / f"in_{name}_index")), text(folder / f"in_{name}_type"))
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
    with file.open("wb", buffering=0) as attribute:
        attribute.write(value.encode())
