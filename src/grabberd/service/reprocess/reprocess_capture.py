"""One sealed capture measured again into a file of a data set: what a worker process does."""

import errno
import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, NamedTuple

from grabberd import __version__
from grabberd.config import RigConfig
from grabberd.errors import CaptureFileError, GrabberdError, NotReady, StorageError
from grabberd.processes.columns import Rows
from grabberd.processes.measure import MeasuredField, MeasureSetup
from grabberd.processes.reprocess import measured_groups
from grabberd.service.setup import check_rig, measure_setup, settings_of_capture
from grabberd.storage import CaptureReader
from grabberd.storage.capture.content_digest import content_sha256, document_sha256
from grabberd.storage.export.dataset_file import read_about, write_dataset_file
from grabberd.storage.export.points_columns import moment_of, rows_of

FULL = {errno.ENOSPC, errno.EDQUOT, errno.EROFS}
DOCUMENTS_KEPT = 64


@dataclass(frozen=True, slots=True)
class Asked:
    """What a capture is to be measured with: SHA-256 of the documents, and settings other than its own.

    Attributes:
        calibration: of the calibration; `object`: of the object model, None for the capture's own.
        settings: such as `method`.
    """

    calibration: str
    object: str | None = None
    settings: Mapping[str, Any] = field(default_factory=dict)

    def to_document(self) -> dict[str, Any]:
        """As a file of the data set keeps it."""
        return {"calibration": self.calibration, "object": self.object, "settings": dict(self.settings)}


@dataclass(frozen=True, slots=True)
class Order:
    """A capture to be measured; paths are those of the computer that asks, and of all that work for it.

    Attributes:
        capture: the file; `barn`: where it was recorded.
        target: the file to write; `part`: its name until it is whole.
        documents: the folder of calibrations and object models, SHA256.json.
        span: how many fields it has at most.
    """

    capture: Path
    barn: str
    target: Path
    part: Path
    documents: Path
    asked: Asked
    span: int


class Outcome(NamedTuple):
    """What became of an order; `hopeless` is a problem that all others would have as well."""

    state: Literal["measured", "unchanged", "failed"]
    fields: int = 0
    points: int = 0
    problem: str = ""
    hint: str = ""
    hopeless: bool = False


def measure_capture(order: Order) -> Outcome:
    """Measures one capture; no error leaves it, for what cannot be pickled would end the whole process."""
    try:
        return _measured(order)
    except GrabberdError as error:
        return Outcome("failed", problem=error.message, hint=error.hint, hopeless=_is_full(error))
    except Exception as error:
        hint = "this is a fault of the program; please report it"
        return Outcome("failed", problem=f"{type(error).__name__}: {error}", hint=hint)


def _measured(order: Order) -> Outcome:
    with CaptureReader(order.capture) as reader:
        made_with = _made_with(order, reader)
        about = _about(order, reader, made_with)
        if order.target.exists() and _same(read_about(order.target), about):
            return Outcome("unchanged")
        setup = measure_setup(made_with, made_with["settings"])
        _check_rig(setup, reader)
        groups = _rows(reader, setup)
        fields, points = write_dataset_file(order.part, order.target, groups, about)
    return Outcome("measured", fields, points)


def _rows(reader: CaptureReader, setup: MeasureSetup) -> Iterator[list[Rows]]:
    first_ns = reader.first_time_ns or 0

    def rows(one: MeasuredField) -> Rows:
        return rows_of(one.n, (one.time_ns - first_ns) / 1e9, moment_of(one.time_ns, reader.meta), one.points)

    for group in measured_groups(reader.received(), setup):
        yield [rows(one) for one in group]


def _made_with(order: Order, reader: CaptureReader) -> dict[str, Any]:
    own = next((run.made_with["object"] for run in reversed(reader.runs) if run.made_with["object"]), None)
    object_model = own if order.asked.object is None else _document(order.documents, order.asked.object)
    if object_model is None:
        raise NotReady(
            f"capture {reader.meta.id} was taken without an object model", "name one with --object"
        )
    settings = settings_of_capture(reader.meta.config) | dict(order.asked.settings)
    calibration = _document(order.documents, order.asked.calibration)
    return {"calibration": calibration, "object": object_model, "settings": settings}


@lru_cache(DOCUMENTS_KEPT)
def _document(folder: Path, sha256: str) -> Any:
    try:
        return json.loads((folder / f"{sha256}.json").read_bytes())
    except OSError as error:
        raise StorageError(
            f"{folder} cannot be read: {error.strerror}", "mount --out at the same path on every computer"
        ) from error


def _about(order: Order, reader: CaptureReader, made_with: Mapping[str, Any]) -> dict[str, Any]:
    meta, known = reader.meta, order.capture.stat()
    capture = {
        "id": meta.id,
        "file": order.capture.name,
        "created_utc": meta.created_utc,
        "content_sha256": content_sha256(order.capture, meta),
        "bytes": known.st_size,
        "mtime_ns": known.st_mtime_ns,
    }
    calibration, object_model = made_with["calibration"], made_with["object"]
    return {
        "capture": capture,
        "device": str(meta.device.get("name", "")),
        "site": {**meta.site, "barn": order.barn},
        "labels": dict(meta.labels),
        "note": meta.note,
        "calibration": {"id": calibration.get("id"), "sha256": order.asked.calibration},
        "object": {"name": object_model.get("name"), "sha256": document_sha256(object_model)},
        "parameters": made_with["settings"],
        "version": __version__,
        "asked": order.asked.to_document(),
    }


def _same(there: Mapping[str, Any], about: Mapping[str, Any]) -> bool:
    """Whether a file was made from the same; the capture's own may have been copied since."""
    keys = ("calibration", "object", "parameters", "version", "site")
    content = (there.get("capture") or {}).get("content_sha256")
    return content == about["capture"]["content_sha256"] and all(there.get(key) == about[key] for key in keys)


def _check_rig(setup: MeasureSetup, reader: CaptureReader) -> None:
    rig = reader.meta.config.get("rig")
    if rig is None:
        return
    try:
        known = RigConfig.model_validate(rig)
    except ValueError as error:
        hint = "measure it with the version that it was recorded with"
        raise CaptureFileError(f"{reader.path}: its rig is not understood: {error}", hint) from error
    check_rig(setup.calibration, known)


def _is_full(error: GrabberdError) -> bool:
    cause = error.__cause__
    return isinstance(error, StorageError) and isinstance(cause, OSError) and cause.errno in FULL
