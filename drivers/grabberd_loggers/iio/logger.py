"""The driver `iio`: a sensor or converter of the kernel's, polled or streaming, as a logger."""

import errno
from typing import Any

from pydantic import Field

from grabberd.core.channels import LoggerInfo, Readings
from grabberd.errors import Cause, DeviceAbsent, DeviceLost, DeviceRefused
from grabberd.instrument.acquisition.device import SYSTEM, Roots
from grabberd.runtime import Clock, SystemClock
from grabberd_loggers.iio.readers import BufferedChannels, PolledChannels
from grabberd_loggers.iio.tree import IioChannel, IioDevice, iio_devices
from grabberd_loggers.options import Options, read_options

_RATE_HZ = 200.0


class IioOptions(Options):
    """All options.

    Attributes:
        device: label or name of the device, or its number, as iio:device0, which may change.
        channels: names of the channels, as pressure or voltage0; by default all.
        rate_hz: readings per second.
        buffered: true: scans with the kernel's own times; false: polled; by default what it can do.
        trigger: name of the trigger of its buffer.
    """

    device: str = Field(min_length=1)
    channels: tuple[str, ...] | None = Field(None, min_length=1, max_length=64)
    rate_hz: float | None = Field(None, gt=0, le=100_000, allow_inf_nan=False)
    buffered: bool | None = None
    trigger: str | None = None


class IioLogger:
    """A device of the industrial I/O subsystem; `IioOptions` lists its options."""

    def __init__(self, *, clock: Clock | None = None, roots: Roots = SYSTEM, **options: Any) -> None:
        """Checks the options; nothing is opened.

        Args:
            clock: clock that it is read by; by default the machine's.
            roots: root folders of the kernel's trees.
            options: see `IioOptions`.

        Raises:
            ValueError: an option is unknown or not allowed; the message has a line for each.
        """
        self._options = read_options(IioOptions, options)
        self._clock, self._roots = clock or SystemClock(), roots
        self._reader: PolledChannels | BufferedChannels | None = None

    def open(self) -> LoggerInfo:
        """Opens the device's channels; see `Logger.open`."""
        if self._reader is not None:
            raise DeviceRefused("the IIO logger is open already", "close it first")
        device = self._found()
        channels = self._chosen(device)
        buffered = device.streams if self._options.buffered is None else self._options.buffered
        try:
            self._reader = reader = self._opened(device, channels, buffered)
        except OSError as error:
            raise _not_opened(device, error) from error
        return LoggerInfo(
            driver="iio",
            model=device.label or device.name or device.number,
            channels=tuple(channel.name for channel in channels),
            units=tuple(channel.unit for channel in channels),
            rate_hz=reader.rate_hz,
            dating=reader.dating,
            time_sigma_ns=reader.time_sigma_ns,
            details={
                "device": device.number,
                "name": device.name,
                "read": "buffered" if buffered else "polled",
            },
        )

    def read(self, timeout_s: float) -> Readings:
        """Waits for the next readings; see `Logger.read`."""
        if self._reader is None:
            raise DeviceLost("the IIO logger is not open", "open it first")
        return self._reader.read(timeout_s)

    def close(self) -> None:
        """Stops reading."""
        if self._reader is not None:
            self._reader.close()
            self._reader = None

    def _opened(
        self, device: IioDevice, channels: tuple[IioChannel, ...], buffered: bool
    ) -> PolledChannels | BufferedChannels:
        options = self._options
        if buffered:
            return BufferedChannels(device, channels, options.rate_hz, options.trigger, self._clock)
        return PolledChannels(channels, options.rate_hz or _RATE_HZ, self._clock)

    def _found(self) -> IioDevice:
        wanted = self._options.device
        found = [device for device in iio_devices(self._roots) if device.is_called(wanted)]
        if not found:
            present = ", ".join(f"{device.number} ({device.name})" for device in iio_devices(self._roots))
            raise DeviceAbsent(
                f"there is no IIO device {wanted!r}; present are: {present or 'none'}",
                "plug it in or load its driver; 'grabberd devices' lists what the kernel knows",
            )
        if len(found) > 1:
            numbers = ", ".join(device.number for device in found)
            hint = "name it by its label or number"
            raise DeviceRefused(f"{numbers} are all called {wanted!r}", hint, Cause.SEVERAL_DEVICES)
        return found[0]

    def _chosen(self, device: IioDevice) -> tuple[IioChannel, ...]:
        known = {channel.name: channel for channel in device.channels()}
        wanted = self._options.channels or tuple(known)
        unknown = [name for name in wanted if name not in known]
        if unknown or not wanted:
            raise DeviceRefused(
                f"{device.number} has no {', '.join(unknown) or 'channels'}; "
                f"it has: {', '.join(known) or 'none'}",
                "correct the channels in the options",
            )
        return tuple(known[name] for name in wanted)


def _not_opened(device: IioDevice, error: OSError) -> DeviceAbsent | DeviceRefused:
    what = f"{error.filename or device.number}: {error.strerror}"
    if error.errno in (errno.EACCES, errno.EPERM, errno.EROFS):
        hint = "let grabberd's user write it (udev rule, loggers.conf), or poll it: buffered: false"
        return DeviceRefused(f"{device.number} may not be used: {what}", hint, Cause.NO_RIGHTS)
    if error.errno == errno.EBUSY:
        return DeviceRefused(f"another program has {device.number}: {what}", "end it", Cause.DEVICE_BUSY)
    if error.errno in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
        return DeviceAbsent(f"{device.number} is gone: {what}", "plug it in again, or load its driver")
    return DeviceRefused(f"{device.number} cannot be used: {what}", "check channels, rate_hz and trigger")
