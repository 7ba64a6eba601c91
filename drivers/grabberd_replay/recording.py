"""Interface of every kind of recording to the driver."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from grabberd.acquisition import FieldOrder, GrabbedField

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
        """Closes the recording; may be called twice."""
        ...


def counts_like_numbers(sequences: Sequence[int | None], numbers: Sequence[int]) -> bool:
    """True if the driver's count grew with the field numbers, and so showed every loss."""
    if not sequences or None in sequences:
        return False
    first = sequences[0]
    assert first is not None
    return all(s is not None and s - first == n - numbers[0] for s, n in zip(sequences, numbers, strict=True))
