"""Industrial I/O devices and their channels in sysfs."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from grabberd.instrument.acquisition.device import SYSTEM, Roots, attribute, by_number

_CHANNEL = re.compile(r"^in_(?P<name>(?P<kind>pressure|voltage|current|resistance|temp)\w*?)_(raw|input)$")
_UNITS = {"pressure": "kPa", "voltage": "mV", "current": "mA", "resistance": "Ohm", "temp": "m°C"}
"""Units of channels once scale and offset are applied, as the kernel's ABI has them."""


@dataclass(frozen=True, slots=True)
class IioChannel:
    """One channel of a device.

    Attributes:
        name: Name, e.g. "pressure" or "voltage0".
        unit: Its unit after scale and offset.
        file: The file that its value is read from.
        is_processed: True if the kernel gives the value in that unit.
        scale, offset: value = (raw + offset) · scale.
    """

    name: str
    unit: str
    file: Path
    is_processed: bool
    scale: float
    offset: float

    def value(self, raw: float) -> float:
        """The value in `unit`."""
        return raw if self.is_processed else (raw + self.offset) * self.scale


@dataclass(frozen=True, slots=True)
class IioDevice:
    """One device.

    Attributes:
        folder: Its folder in sysfs.
        node: Its character device.
        name: The chip's name; `label`: what the device tree or its firmware calls it, or "".
    """

    folder: Path
    node: Path
    name: str
    label: str

    @property
    def number(self) -> str:
        """Name of the folder, which may change when the computer starts."""
        return self.folder.name

    @property
    def streams(self) -> bool:
        """True if it has a buffer with times."""
        return (self.folder / "buffer" / "enable").exists() and (
            self.folder / "scan_elements" / "in_timestamp_en"
        ).exists()

    def is_called(self, name: str) -> bool:
        """True if a configuration means this device."""
        return name in (self.label, self.name, self.number)

    def channels(self) -> tuple[IioChannel, ...]:
        """Channels that can be read, by name."""
        found: dict[str, IioChannel] = {}
        for file in sorted(self.folder.glob("in_*")):
            match = _CHANNEL.match(file.name)
            # A processed value is what the kernel's driver would make of a raw one: it needs no scale.
            if match and (match["name"] not in found or file.name.endswith("_input")):
                found[match["name"]] = self._channel(match["name"], match["kind"], file)
        return tuple(found.values())

    def _channel(self, name: str, kind: str, file: Path) -> IioChannel:
        is_processed = file.name.endswith("_input")
        scale, offset = (
            next(
                (number(self.folder / f"in_{of}_{what}") for of in (name, kind) if self._has(of, what)), usual
            )
            for what, usual in (("scale", 1.0), ("offset", 0.0))
        )
        return IioChannel(name, _UNITS[kind], file, is_processed, scale, offset)

    def _has(self, name: str, what: str) -> bool:
        return (self.folder / f"in_{name}_{what}").exists()


def iio_devices(roots: Roots = SYSTEM) -> Sequence[IioDevice]:
    """All devices, by number; triggers are none."""
    return [
        IioDevice(entry, roots.dev / entry.name, attribute(entry / "name"), attribute(entry / "label"))
        for entry in by_number(roots.sys / "bus" / "iio" / "devices", "iio:device*")
    ]


def number(file: Path) -> float:
    """Number in an attribute; NaN if it is not there or is none."""
    try:
        return float(attribute(file))
    except ValueError:
        return math.nan
