"""A capture file as a recording."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from grabberd.archive import CaptureReader, RecordedField
from grabberd.core.field import FieldOrder, unpack
from grabberd.core.ledger import Outcome
from grabberd.errors import CaptureFileError, PictureError
from grabberd.instrument.acquisition import GrabbedField
from grabberd_replay.recording import Batch, Format, Recording


class CaptureRecording(Recording):
    """The fields of a capture, one per batch; damaged ones are delivered as damaged.

    Raises:
        CaptureFileError: the file is no capture, is damaged, or has no fields.
    """

    def __init__(self, path: Path) -> None:
        self._reader = CaptureReader(path)
        first = next(self._reader.fields(), None)
        if first is None:
            self._reader.close()
            raise CaptureFileError(f"{path} has no fields", "choose a capture with fields")
        meta, packed = self._reader.meta, first.numbered.packed
        stream: dict[str, Any] = dict(meta.device.get("stream") or {})
        self.format = Format(
            columns=packed.columns,
            field_rows=packed.rows,
            rate_hz=meta.rate_hz,
            field_order=FieldOrder(stream.get("field_order", FieldOrder.ALTERNATE)),
            pixel_format="GREY",
            counts_losses=bool(stream.get("counts_losses", False)),
            details={"capture": meta.id, "bits": str(packed.bits), "lines": meta.lines},
        )

    def batches(self) -> Iterator[Batch]:
        """One field at a time, unpacked."""
        try:
            for recorded in self._reader.fields():
                yield (_grabbed(recorded),)
        except CaptureFileError as error:
            raise PictureError(error.message, error.hint) from error

    def close(self) -> None:
        """Closes the file."""
        self._reader.close()


def _grabbed(recorded: RecordedField) -> GrabbedField:
    numbered = recorded.numbered
    damage = None if recorded.outcome is Outcome.RECEIVED else recorded.reason or str(recorded.outcome)
    return GrabbedField(unpack(numbered.packed), numbered.time_ns, numbered.sequence, damage)
