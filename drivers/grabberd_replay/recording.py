"""Interface of every kind of recording to the driver."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from grabberd.core.field import FieldOrder
from grabberd.instrument.acquisition import GrabbedField

Batch = Sequence[GrabbedField]
"""The fields of one picture, the older first."""


@dataclass(frozen=True, slots=True)
class Format:
    """Properties of a recording's fields, in the terms of `StreamInfo`."""

    columns: int
    field_rows: int
    rate_hz: float
    field_order: FieldOrder
    pixel_format: str
    counts_losses: bool
    details: dict[str, str] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()


class Recording(Protocol):
    """An opened recording."""

    format: Format

    def batches(self) -> Iterator[Batch]:
        """Every picture's fields in order of time.

        Raises:
            PictureError, CaptureFileError: the next picture cannot be read; those before it were delivered.
        """
        ...

    def close(self) -> None:
        """Closes the recording; may be called twice. Nothing to do unless it keeps a file open."""
        return
