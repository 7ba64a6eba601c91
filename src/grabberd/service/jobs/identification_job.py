"""Which targets of the calibration frame a capture shows: a job, since it looks at many fields."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from grabberd.calibration import MeanImages
from grabberd.field import NumberedField
from grabberd.processes.calibration.identify import SeenFrame, identify
from grabberd.reconstruction import ObjectModel
from grabberd.service.calibrations.calibration_frames import frame_document
from grabberd.service.jobs.calibrate_file import frame_model, nominal_rig, rig_of
from grabberd.service.jobs.job_runner import Job, Progress
from grabberd.service.setup import location_settings, settings_of_capture
from grabberd.storage import CaptureReader

if TYPE_CHECKING:
    from grabberd.service.service import Service

VIEWS = ("left", "right")
ENOUGH_FIELDS = 16
"""More do not show more targets."""
QUICKEST = "centroid"
"""Which target is which does not hang on hundredths of a pixel."""
_LOCATED = 0.9
"""Share of the work that location is."""


def order_identification(
    service: "Service", capture_id: str, frame: str | Mapping[str, Any] | None = None
) -> Job:
    """Queues the identification of the calibration frame in a sealed capture.

    Args:
        service: whose capture it is.
        capture_id: of the capture.
        frame: the calibration frame's name or its document; None: the one there is.

    Raises:
        NotFound: there is no capture or calibration frame of that name.
        Conflict: the capture is still running.
    """
    path = service.archive.sealed_path(capture_id)
    return service.jobs.submit("identify", capture_id, identify_file, path=path, frame=frame_document(frame))


def identify_file(progress: Progress, *, path: Path, frame: Mapping[str, Any]) -> dict[str, Any]:
    """Finds the targets of a calibration frame in a sealed capture of it.

    Returns:
        For each view the targets that were found, those that are missing and the images that are none;
        `problem` says why, where it is not clear which target is which; `moved`, that nothing stood still.

    Raises:
        InputError: the calibration frame or the rig is not what it should be; CaptureFileError: the capture.
        MeasurementError: the capture has no fields.
    """
    model = frame_model(frame)
    with CaptureReader(path) as reader:
        fields = list(_spread(reader))
        seen = identify(
            _counted(fields, progress),
            nominal_rig(rig_of(reader)),
            model,
            replace(location_settings(settings_of_capture(reader.meta.config)), method=QUICKEST),
        )
        about = {"capture": reader.meta.id, "calibration_frame": model.name, "of": len(model)}
    return {**about, "picture": _picture(fields, seen.moved), **_document(seen, model)}


def _spread(reader: CaptureReader) -> Iterator[NumberedField]:
    """Some fields of all of the capture; an odd step, so that both parities come."""
    step = max(1, reader.field_count // ENOUGH_FIELDS) | 1
    return islice(reader.received(), 0, None, step)


def _counted(fields: list[NumberedField], progress: Progress) -> Iterator[NumberedField]:
    for done, field in enumerate(fields):
        progress(_LOCATED * done / len(fields))
        yield field


def _picture(fields: list[NumberedField], moved: bool) -> dict[str, int]:
    """The field to show the targets on, and where its rows lie in the frame."""
    chosen = fields[0 if moved else len(fields) // 2]
    return {"field": chosen.n, "y0": chosen.packed.y0, "y_step": chosen.packed.y_step}


def _document(seen: SeenFrame, model: ObjectModel) -> dict[str, Any]:
    sides = zip(VIEWS, seen.images, seen.target, strict=True)
    refusal = seen.refusal
    return {
        "views": {name: _view(images, target, model) for name, images, target in sides},
        "moved": seen.moved,
        "problem": {"message": refusal.message, "hint": refusal.hint} if refusal else None,
    }


def _view(images: MeanImages, target: NDArray[np.intp], model: ObjectModel) -> dict[str, Any]:
    places = [{"x_px": round(x, 2), "y_px": round(y, 2)} for x, y in images.xy_px.tolist()]
    found = [
        {"target": int(model.target[index]), **place}
        for index, place in zip(target, places, strict=True)
        if index >= 0
    ]
    known = {one["target"] for one in found}
    return {
        "found": sorted(found, key=lambda one: one["target"]),
        "missing": [one for one in model.target.tolist() if one not in known],
        "other": [place for index, place in zip(target, places, strict=True) if index < 0],
    }
