"""Grabbers that this computer has, configured or not: what drivers find when they look for them.

A driver that can look offers a function without arguments in the entry point group `grabberd.discovery`. It
opens devices to ask them, never to stream, and a device in use by somebody else is listed all the same.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from grabberd.errors import DriverMissing

GROUP = "grabberd.discovery"


class Verdict(StrEnum):
    """What to think of a grabber, in a word."""

    RECOMMENDED = "recommended"
    USABLE = "usable"
    DOUBTFUL = "doubtful"
    UNUSABLE = "unusable"


@dataclass(frozen=True, slots=True)
class FoundDevice:
    """A grabber that is there.

    Attributes:
        driver: the driver's name in the configuration, e.g. "v4l2".
        card: the device's own name.
        options: of the configuration, naming it as lastingly as it can be named.
        verdict: in a word; `remarks`: why, and what to mind, in sentences.
        facts: what else is known, in the order in which it is to be read: node, by-path, USB port, formats …
        other_options: other ways in which a configuration may name it.
    """

    driver: str
    card: str
    options: Mapping[str, Any]
    verdict: Verdict
    remarks: tuple[str, ...] = ()
    facts: Mapping[str, str] = field(default_factory=dict)
    other_options: tuple[Mapping[str, Any], ...] = ()

    def is_meant_by(self, driver: str, options: Mapping[str, Any]) -> bool:
        """Whether a configuration with this driver and these options, or more of them, names it."""
        ways = (self.options, *self.other_options)
        return driver == self.driver and any(_contains(options, way) for way in ways)


Discovery = Callable[[], Sequence[FoundDevice]]


def discover() -> tuple[FoundDevice, ...]:
    """What all installed drivers find, sorted by driver as they found it.

    Raises:
        DriverMissing: one of them cannot be imported.
    """
    entries = sorted(entry_points(group=GROUP), key=lambda entry: entry.name)
    return tuple(found for entry in entries for found in _load(entry)())


def _load(entry: EntryPoint) -> Discovery:
    try:
        find: Discovery = entry.load()
    except (ImportError, AttributeError) as error:
        raise DriverMissing(
            f"driver '{entry.name}' cannot look for its devices: {error}", "install the driver's package anew"
        ) from error
    return find


def _contains(options: Mapping[str, Any], way: Mapping[str, Any]) -> bool:
    return all(str(options.get(key)).casefold() == str(value).casefold() for key, value in way.items())
