"""A capture before it records: what is fixed when it is started or armed."""

from pathlib import Path
from typing import NamedTuple

from grabberd.documents.captures import CaptureDocument, GroupDocument
from grabberd.documents.requests import CaptureRequest


class NewCapture(NamedTuple):
    """A capture that is being started or armed on one device.

    Attributes:
        id: Id of the capture.
        request: Its options, with its length in `fields`.
        part: Path of its file while it is written.
        group: The group it belongs to, without its start, or None.
        armed_utc: Time at which it was armed; None if it starts at once.
    """

    id: str
    request: CaptureRequest
    part: Path
    group: GroupDocument | None = None
    armed_utc: str | None = None


class ArmedCapture(NamedTuple):
    """A capture that waits for its trigger: its ring is configured, and nothing is on disk yet.

    Attributes:
        document: The capture as it is shown.
        request: Its options; `fields` counts from the trigger.
    """

    document: CaptureDocument
    request: CaptureRequest

    @property
    def id(self) -> str:
        """Id of the capture."""
        return self.document.id

    @property
    def group(self) -> GroupDocument | None:
        """The group it is triggered with, or None."""
        return self.document.group
