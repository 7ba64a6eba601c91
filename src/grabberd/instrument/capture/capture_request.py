"""A capture before it records: its request, its group, and what is fixed when it is started or armed."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from grabberd.archive.catalogue.capture_documents import document_without_fields
from grabberd.clock import Moment
from grabberd.documents.captures import CaptureDocument, GroupDocument


@dataclass(frozen=True, slots=True)
class CaptureRequest:
    """Options of one capture; it ends after `fields` nominal field times, or when it is stopped.

    Attributes:
        fields: Length in fields, lost ones included; None: until stopped.
        bits: Bits per pixel; None: as configured.
        lines: "doubled" or "field"; None: doubled at 1 bit, field otherwise.
        pre_trigger_fields: Number of fields before the request, or before the trigger, that belong to the
            capture, as far as the ring still has them.
        overrun: "count" the fields that the ring has overwritten before they were recorded, or "stop" there.
        on_interruption: "continue" with the gap in the ledger when the device fails to deliver, or "end" the
            capture there; None: as configured.
        note: Free text.
        labels: Cow, teat, liner, …
    """

    fields: int | None = None
    bits: int | None = None
    lines: str | None = None
    pre_trigger_fields: int = 0
    overrun: str = "count"
    on_interruption: str | None = None
    note: str = ""
    labels: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Group:
    """Captures of several devices that start at the same moment.

    Attributes:
        id: Id of the group.
        devices: Names of the devices, one capture each.
    """

    id: str
    devices: tuple[str, ...]

    def document(self, start: Moment | None) -> GroupDocument:
        """The group as each of its captures stores it; without a start while it is armed."""
        return GroupDocument(
            id=self.id,
            devices=list(self.devices),
            start_utc=None if start is None else start.utc,
            start_ns=None if start is None else start.ns,
        )


@dataclass(frozen=True, slots=True)
class NewCapture:
    """A capture that is being started or armed on one device.

    Attributes:
        id: Id of the capture.
        request: Its options.
        part: Path of its file while it is written.
        group: The group it belongs to, or None.
        armed_utc: Time at which it was armed; None if it starts at once.
    """

    id: str
    request: CaptureRequest
    part: Path
    group: Group | None = None
    armed_utc: str | None = None


@dataclass(frozen=True, slots=True)
class ArmedCapture:
    """A capture that waits for its trigger: its ring is configured, and nothing is on disk yet.

    Attributes:
        id: Id of the capture.
        device: Name of its device.
        armed_utc: Time at which it was armed.
        request: Its options; `fields` counts from the trigger.
        bits: Bits per pixel of the ring.
        lines: "doubled" or "field", as the ring has them; None for progressive pictures.
        rate_hz: Fields per second of the device.
        group: The group it is triggered with, or None.
    """

    id: str
    device: str
    armed_utc: str
    request: CaptureRequest
    bits: int
    lines: str | None
    rate_hz: float
    group: Group | None = None

    @property
    def document(self) -> CaptureDocument:
        """The capture as it is shown."""
        return document_without_fields(
            id=self.id,
            device=self.device,
            state="armed",
            created_utc=self.armed_utc,
            group=self.group and self.group.document(None),
            bits=self.bits,
            lines=self.lines,
            rate_hz=self.rate_hz,
            labels=dict(self.request.labels),
            note=self.request.note,
        )
