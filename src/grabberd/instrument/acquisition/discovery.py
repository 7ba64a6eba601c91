"""The installed drivers of grabbers and loggers, by name, and the devices that they find in this computer.

A driver that can search offers a function without arguments in the entry point group `grabberd.discovery`,
for loggers `grabberd.logger_discovery`. It opens devices to query them, never to stream, and lists a device
even if another program is using it, or no configuration names it. It can read the kernel's trees with
`by_number` and `attribute`.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path
from typing import Any, NamedTuple

from grabberd.core.channels.logger import Logger
from grabberd.errors import DriverMissing
from grabberd.instrument.acquisition.device import Grabber
from grabberd.registry import Registry

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
