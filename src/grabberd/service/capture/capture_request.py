"""A capture that is about to begin."""

from dataclasses import dataclass
from pathlib import Path

from grabberd.service.capture.capture_group import Group
from grabberd.service.capture.recorder import CaptureRequest


@dataclass(frozen=True, slots=True)
class Planned:
    """Of one device.

    Attributes:
        id: of the capture.
        request: what is asked for.
        part: where it is written to.
        group: it is one of several that begin together, or None.
        armed_utc: since when it waits for its trigger; None where it does not.
    """

    id: str
    request: CaptureRequest
    part: Path
    group: Group | None = None
    armed_utc: str | None = None
