"""Grabbers that this computer has, configured or not: what drivers find when they look for them.

A driver that can look offers a function without arguments in the entry point group `grabberd.discovery`. It
opens devices to ask them, never to stream, and a device in use by somebody else is listed all the same.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from importlib.metadata import entry_points
from typing import Any

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
    """

    driver: str
    card: str
    options: Mapping[str, Any]
    verdict: Verdict
    remarks: tuple[str, ...] = ()
    facts: Mapping[str, str] = field(default_factory=dict)


Discovery = Callable[[], Sequence[FoundDevice]]


def discover() -> tuple[FoundDevice, ...]:
    """What all installed drivers find, sorted by driver as they found it."""
    finders: list[Discovery] = [entry.load() for entry in _sorted_entries()]
    return tuple(found for find in finders for found in find())


def _sorted_entries() -> Any:
    return sorted(entry_points(group=GROUP), key=lambda entry: entry.name)
