"""A capture that waits for its trigger."""

from dataclasses import dataclass

from grabberd.service.capture.capture_group import Group
from grabberd.service.capture.recorder import CaptureRequest


@dataclass(frozen=True, slots=True)
class ArmedCapture:
    """An armed capture: the ring is kept as it wants it, and nothing is on disk.

    Attributes:
        id: of the capture.
        device: it is to be made with.
        armed_utc: since when it waits.
        request: its `fields` count from the trigger on.
        bits: of the ring; `lines`: of the ring.
        group: it begins together with the others of it; None: alone.
    """

    id: str
    device: str
    armed_utc: str
    request: CaptureRequest
    bits: int
    lines: str
    group: Group | None = None
