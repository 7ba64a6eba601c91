"""From a capture of the calibration frame to a calibration and its report: a job, and a command."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from grabberd import __version__
from grabberd.calibration import LENS, Mark
from grabberd.config import RigConfig
from grabberd.errors import InputError
from grabberd.field import NumberedField
from grabberd.geometry import PARAMETERS, NominalRig
from grabberd.processes.calibration.calibrate import calibrate
from grabberd.processes.calibration.calibration_result import CalibrateResult, CalibrateSettings
from grabberd.processes.calibration.report_document import report_document
from grabberd.reconstruction import ObjectModel
from grabberd.service.clock import SystemClock, iso_utc
from grabberd.service.jobs.job_runner import Progress
from grabberd.service.setup import location_settings, settings_of_capture
from grabberd.storage import CaptureReader
from grabberd.storage.state.calibration_store import CalibrationRecord, CalibrationStore

FRAME_KEYS = ("certificate", "temperature_C")
"""What a calibration frame's file may say beside its targets."""
_LOCATED = 0.8
"""Share of the work that location is."""


@dataclass(frozen=True, slots=True)
class Calibrated:
    """Two JSON documents: the `calibration`, and the `report` of how it was made."""

    calibration: dict[str, Any]
    report: dict[str, Any]


def calibrate_file(
    progress: Progress,
    *,
    path: Path,
    frame: Mapping[str, Any],
    options: Mapping[str, Any],
    rig: RigConfig | None = None,
    by_hand: Sequence[Mark] | None = None,
) -> Calibrated:
    """Calibrates from a sealed capture; nothing is written.

    Args:
        progress: is told the share that is done.
        path: a capture of the calibration frame.
        frame: the calibration frame's document.
        options: as the API takes them; what is missing or None is as `CalibrateSettings` has it.
        rig: the nominal rig; None: the one of the capture's own configuration.
        by_hand: identifications made by hand.

    Raises:
        InputError: frame or options are not what they should be.
        CaptureFileError: the capture cannot be read.
        MeasurementError: it determines no calibration; the message says why.
    """
    model = frame_model(frame)
    with CaptureReader(path) as reader:
        rig = rig or rig_of(reader)
        settings = settings_of(options, reader.meta.config)
        fields = _counted(reader.received(), reader.field_count, progress)
        result = calibrate(fields, nominal_rig(rig), model, settings, by_hand)
        about = _about(reader, frame, options, rig)
    report = report_document(result, about)
    return Calibrated(_document(result, about, report), report)


def calibrate_capture(
    capture: Path,
    frame_document: Mapping[str, Any],
    options: Mapping[str, Any],
    store: Path,
    progress: Progress,
) -> dict[str, Any]:
    """Calibrates and adds the calibration with its report to a `CalibrationStore` in `store`.

    Returns:
        Its id, as `calibration`.

    Raises:
        GrabberdError: as `calibrate_file`.
    """
    made = calibrate_file(progress, path=capture, frame=frame_document, options=options)
    calibration = CalibrationStore(store).add(made.calibration, CalibrationRecord(), report=made.report)
    return {"calibration": calibration.id}


def frame_model(frame: Mapping[str, Any]) -> ObjectModel:
    """The targets of a calibration frame's document.

    Raises:
        InputError: it is none.
    """
    return ObjectModel.from_document({key: frame[key] for key in frame if key not in FRAME_KEYS})


def nominal_rig(rig: RigConfig) -> NominalRig:
    """The configuration's rig as the core takes it."""
    return NominalRig(
        columns=rig.columns,
        lines=rig.lines,
        left=(rig.views.left.first_column, rig.views.left.end_column),
        right=(rig.views.right.first_column, rig.views.right.end_column),
        distance_mm=rig.distance_mm,
        base_mm=rig.base_mm,
        convergence_deg=rig.convergence_deg,
        focal_length_mm=rig.focal_length_mm,
        pixel_x_mm=rig.pixel_x_mm,
        pixel_y_mm=rig.pixel_y_mm,
    )


def settings_of(options: Mapping[str, Any], config: Mapping[str, Any]) -> CalibrateSettings:
    """How it is computed, from the API's options and the capture's configuration.

    Raises:
        InputError: an option has no such value.
    """
    given = {key: value for key, value in options.items() if value is not None}
    _check_choice(given, "weights", ("honest", "equal"))
    _check_choice(given, "frame", ("weighted", "held"))
    default = CalibrateSettings()
    return CalibrateSettings(
        equal_weights=given.get("weights") == "equal",
        held=given.get("frame") == "held",
        free=tuple(given.get("free", PARAMETERS)),
        shared=_shared(given.get("shared", False)),
        tied=bool(given.get("tied", default.tied)),
        alpha=given.get("alpha", default.alpha),
        local_field=bool(given.get("local_field", default.local_field)),
        handedness=given.get("handedness"),
        location=location_settings(settings_of_capture(config)),
    )


def _shared(given: bool | Sequence[str]) -> tuple[str, ...]:
    """All terms of the lens, none, or those named."""
    if isinstance(given, bool):
        return LENS if given else ()
    return tuple(given)


def _check_choice(given: Mapping[str, Any], key: str, known: Sequence[str]) -> None:
    if key in given and given[key] not in known:
        raise InputError(f"{key} {given[key]!r} is none of {', '.join(known)}", "choose one of them")


def rig_of(reader: CaptureReader) -> RigConfig:
    """The nominal rig of a capture's own configuration.

    Raises:
        InputError: it has none.
    """
    try:
        return RigConfig.model_validate(reader.meta.config.get("rig", {}))
    except ValidationError as error:
        raise InputError(
            f"the capture's own configuration has no usable rig: {error.errors()[0]['msg']}",
            "name a configuration with the rig's nominal geometry",
        ) from error


def _about(
    reader: CaptureReader, frame: Mapping[str, Any], options: Mapping[str, Any], rig: RigConfig
) -> dict[str, Any]:
    created, meta = iso_utc(SystemClock().utc_now()), reader.meta
    return {
        "id": _id(meta.id, created),
        "created_utc": created,
        "version": f"grabberd {__version__}",
        "note": options.get("note"),
        "glass": rig.glass.model_dump() if rig.glass else None,
        "capture": {
            "id": meta.id,
            "device": meta.device.get("name"),
            "started_utc": meta.created_utc,
            "fields": reader.field_count,
            "bits": meta.bits,
            "lines": meta.lines,
        },
        **{key: frame.get(key) for key in FRAME_KEYS},
    }


def _id(capture: str, created_utc: str) -> str:
    """A name of its own: the capture's and the moment's."""
    moment = datetime.fromisoformat(created_utc).strftime("%Y%m%dT%H%M%S")
    return f"{re.sub('[^0-9A-Za-z_-]+', '-', capture)[:50]}-{moment}"


def _document(result: CalibrateResult, about: Mapping[str, Any], report: Mapping[str, Any]) -> dict[str, Any]:
    """The calibration itself; of its report, what a later reader of the file alone would ask for."""
    frame = result.frame
    details = {
        "capture": about["capture"],
        "calibration_frame": {"name": frame.name, "targets": len(frame), "sigma_mm": frame.sigma_mm},
        **{key: about[key] for key in FRAME_KEYS},
        "note": about["note"],
        "version": about["version"],
        "sigma0": result.adjustment.sigma0,
        **{key: report[key] for key in ("settings", "tests", "dropped", "warnings")},
    }
    source = f"capture {about['capture']['id']} of calibration frame {frame.name}"
    calibration = result.calibration(about["id"], about["created_utc"], source, about["glass"], details)
    return calibration.to_document()


def _counted(fields: Iterator[NumberedField], count: int, progress: Progress) -> Iterator[NumberedField]:
    for done, field in enumerate(fields):
        if done % 10 == 0:
            progress(_LOCATED * done / max(count, 1))
        yield field
