"""Re-measures one sealed capture into a file of a data set: the task of a worker process."""

import errno
import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from grabberd import __version__
from grabberd.archive.capture.content_digest import content_sha256, document_sha256
from grabberd.archive.capture.digests import Damage, left_out_in_words
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.export.dataset import read_about, write_dataset_file
from grabberd.archive.export.points_columns import rows_of
from grabberd.archive.measure_setups import INCLUDE_DAMAGED, check_rig, measure_setup, settings_of_capture
from grabberd.config import RigConfig
from grabberd.core.chain.columns import Rows
from grabberd.core.chain.measure import MeasureSetup, measured_groups
from grabberd.core.reconstruction import CoverageTally
from grabberd.core.reconstruction.coverage import coverage_document
from grabberd.core.reconstruction.field_order import FieldOrderCheck
from grabberd.documents.devices import FieldOrderDocument
from grabberd.documents.document import JsonObject
from grabberd.errors import CaptureFileError, GrabberdError, NotReady, StorageError

FULL = {errno.ENOSPC, errno.EDQUOT, errno.EROFS}
"""Errors that every further task would run into as well."""
DOCUMENTS_CACHED = 64
"""Nearly all tasks of a worker share one calibration and one object model."""


@dataclass(frozen=True, slots=True)
class Recipe:
    """Documents and settings that captures are measured with.

    Attributes:
        calibration: SHA-256 of the calibration's document.
        object: SHA-256 of the object model's document; None for each capture's own.
        settings: Settings that replace a capture's own, such as `method`.
    """

    calibration: str
    object: str | None = None
    settings: JsonObject = field(default_factory=dict)

    def to_document(self) -> JsonObject:
        """Returns it as a file of the data set keeps it, under `asked`."""
        return {"calibration": self.calibration, "object": self.object, "settings": dict(self.settings)}


@dataclass(frozen=True, slots=True)
class CaptureTask:
    """A capture to re-measure; its paths must mean the same on every computer that works.

    Attributes:
        capture: File of the capture; `barn`: where it was recorded.
        target: File to write; `part`: its name until it is complete.
        documents: Folder of calibrations and object models, SHA256.json.
        recipe: What to measure it with.
        span: Maximum number of its fields.
    """

    capture: Path
    barn: str
    target: Path
    part: Path
    documents: Path
    recipe: Recipe
    span: int


class TaskResult(NamedTuple):
    """Result of a task; `hopeless` marks a problem that every other task would have as well;
    `warning` says what is wrong with the points.
    """

    state: Literal["measured", "unchanged", "failed"]
    fields: int = 0
    points: int = 0
    problem: str = ""
    hint: str = ""
    hopeless: bool = False
    warning: str = ""


def reprocess_capture(task: CaptureTask) -> TaskResult:
    """Re-measures one capture. It raises nothing: an error that cannot be pickled would end the process."""
    try:
        return _measured(task)
    except GrabberdError as error:
        return TaskResult("failed", problem=error.message, hint=error.hint, hopeless=_is_full(error))
    except Exception as error:
        hint = "this is a fault of the program; please report it"
        return TaskResult("failed", problem=f"{type(error).__name__}: {error}", hint=hint)


def _measured(task: CaptureTask) -> TaskResult:
    left_out: list[Damage] = []
    with CaptureReader(task.capture, left_out) as reader:
        reader.check_unchanged(runs=())
        made_with = _made_with(task, reader)
        about = _about(task, reader, made_with)
        if task.target.exists() and _same(read_about(task.target), about):
            return TaskResult("unchanged")
        setup = measure_setup(made_with, made_with["settings"])
        _check_rig(setup, reader)
        tally = CoverageTally(setup.calibration, setup.object_model)
        order = FieldOrderCheck(setup.object_model.target) if reader.meta.is_interlaced else None
        include_damaged = made_with["settings"].get(INCLUDE_DAMAGED, False)
        groups = _rows(reader, setup, tally, order, and_damaged=include_damaged)

        def found(fields: int) -> JsonObject:
            return {"coverage": coverage_document(tally.result(), reader.missing_fields(fields))}

        fields, points = write_dataset_file(task.part, task.target, groups, about, found)
    of_order = None if order is None else FieldOrderDocument.of(order.finish()).warning
    warnings = [*left_out_in_words(left_out), of_order or ""]
    return TaskResult("measured", fields, points, warning="; ".join(filter(None, warnings)))


def _rows(
    reader: CaptureReader,
    setup: MeasureSetup,
    tally: CoverageTally,
    order: FieldOrderCheck | None,
    *,
    and_damaged: bool,
) -> Iterator[tuple[int, Rows]]:
    first_ns = reader.first_time_ns or 0

    for group in measured_groups(reader.received(and_damaged=and_damaged), setup, tally):
        if order is not None:
            for one in group:
                order.add(one.n, one.points)
        n, times_ns = np.array([(one.n, one.time_ns) for one in group], np.int64).T
        yield len(group), rows_of(n, times_ns, [one.points for one in group], reader.meta, first_ns)


def _made_with(task: CaptureTask, reader: CaptureReader) -> JsonObject:
    own = next((run.made_with["object"] for run in reversed(reader.runs) if run.made_with["object"]), None)
    object_model = own if task.recipe.object is None else _document(task.documents, task.recipe.object)
    if object_model is None:
        raise NotReady(
            f"capture {reader.meta.id} was taken without an object model", "name one with --object"
        )
    settings = settings_of_capture(reader.meta.config) | dict(task.recipe.settings)
    calibration = _document(task.documents, task.recipe.calibration)
    return {"calibration": calibration, "object": object_model, "settings": settings}


@lru_cache(DOCUMENTS_CACHED)
def _document(folder: Path, sha256: str) -> Any:
    try:
        return json.loads((folder / f"{sha256}.json").read_bytes())
    except OSError as error:
        raise StorageError(
            f"{folder} cannot be read: {error.strerror}", "mount --out at the same path on every computer"
        ) from error


def _about(task: CaptureTask, reader: CaptureReader, made_with: JsonObject) -> JsonObject:
    meta, known = reader.meta, task.capture.stat()
    capture = {
        "id": meta.id,
        "file": task.capture.name,
        "created_utc": meta.created_utc,
        "content_sha256": content_sha256(task.capture, meta),
        "bytes": known.st_size,
        "mtime_ns": known.st_mtime_ns,
    }
    calibration, object_model = made_with["calibration"], made_with["object"]
    return {
        "capture": capture,
        "device": str(meta.device.get("name", "")),
        "site": {**meta.site, "barn": task.barn},
        "labels": dict(meta.labels),
        "note": meta.note,
        "calibration": {"id": calibration.get("id"), "sha256": task.recipe.calibration},
        "object": {"name": object_model.get("name"), "sha256": document_sha256(object_model)},
        "parameters": made_with["settings"],
        "version": __version__,
        "asked": task.recipe.to_document(),
    }


def _same(there: JsonObject, about: JsonObject) -> bool:
    """True if a file was made from the same content; the capture's own file may have been copied since."""
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
        raise CaptureFileError(f"{reader.path}: its rig is invalid: {error}", hint) from error
    check_rig(setup.calibration, known)


def _is_full(error: GrabberdError) -> bool:
    cause = error.__cause__
    return isinstance(error, StorageError) and isinstance(cause, OSError) and cause.errno in FULL
