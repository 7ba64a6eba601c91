"""Calibrates both virtual cameras from a capture of the calibration frame, and reports how it went."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Any, Protocol

from pydantic import ValidationError

from grabberd import __version__
from grabberd.acquisition.clock import SystemClock, iso_utc
from grabberd.calibration import LENS, Mark
from grabberd.config import RigConfig
from grabberd.errors import ExtraMissing, InputError
from grabberd.geometry import PARAMETERS, NominalRig
from grabberd.processes.calibration.calibrate import calibrate
from grabberd.processes.calibration.calibration_result import CalibrateResult, CalibrateSettings
from grabberd.processes.calibration.report_document import report_document
from grabberd.service.calibrations.calibration_frames import (
    CALIBRATION_FRAME_KEYS,
    calibration_frame_model,
)
from grabberd.service.jobs.progress import Progress, counted, portion
from grabberd.service.jobs.runner import JobSpec
from grabberd.service.setup import location_settings, settings_of_capture
from grabberd.storage import CaptureReader
from grabberd.storage.state.calibration_store import CalibrationRecord, CalibrationStore

_LOCATED = 0.8
"""Share of the work that location is; the adjustment cannot tell how far it is."""


@dataclass(frozen=True, slots=True)
class CalibrationOutput:
    """Two JSON documents: the `calibration`, and the `report` of how it was made."""

    calibration: dict[str, Any]
    report: dict[str, Any]


class Calibrator(Protocol):
    """A function at module level that calibrates from a capture, such as `calibrate_file`."""

    def __call__(
        self,
        progress: Progress,
        *,
        path: Path,
        calibration_frame: Mapping[str, Any],
        options: Mapping[str, Any],
    ) -> CalibrationOutput:
        """Calibrates; nothing is written."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationJob(JobSpec):
    """Calibrates from a capture, draws the report and stores all of it at once, or nothing.

    Attributes:
        path: Path of the capture; this, the calibration frame and the options as `calibrate_file` takes them.
        store: Folder of the `CalibrationStore`.
        device: Name of the device the calibration will belong to.
        note: Free text, kept with the calibration.
        calibrator: Function that calibrates.
    """

    kind = "calibrate"
    path: Path
    calibration_frame: Mapping[str, Any]
    options: Mapping[str, Any]
    store: Path
    device: str
    calibrator: Calibrator
    note: str = ""

    def run(self, progress: Progress) -> dict[str, Any]:
        """Calibrates and stores.

        Returns:
            The id of the new calibration, as `calibration`.

        Raises:
            Conflict: The id is taken.
            GrabberdError: The calibrator refuses the capture.
        """
        options = {**self.options, **({"note": self.note} if self.note else {})}
        made = self.calibrator(
            progress, path=self.path, calibration_frame=self.calibration_frame, options=options
        )
        record = CalibrationRecord(self.device, "capture", note=self.note, capture=self.subject)
        page, record = _drawn(made.report, record)
        record = replace(record, stored_utc=iso_utc(SystemClock().utc_now()))
        stored = CalibrationStore(self.store).add(made.calibration, record, report=made.report, page=page)
        return {"calibration": stored.id}


def _drawn(report: Mapping[str, Any], record: CalibrationRecord) -> tuple[str | None, CalibrationRecord]:
    """Draws the report as a page; where that fails, the record says why.

    A bug in a picture must not cost the calibration.
    """
    try:
        from grabberd.reports import calibration_html  # noqa: PLC0415 - the daemon never draws

        return calibration_html(report), record
    except ExtraMissing as error:
        return None, replace(record, missing_extra=error.extra)
    except Exception as error:
        return None, replace(record, page_problem=f"{type(error).__name__}: {error}")


def calibrate_file(
    progress: Progress,
    *,
    path: Path,
    calibration_frame: Mapping[str, Any],
    options: Mapping[str, Any],
    rig: RigConfig | None = None,
    by_hand: Sequence[Mark] | None = None,
) -> CalibrationOutput:
    """Calibrates from a sealed capture; nothing is written.

    Args:
        progress: Called with the share that is done.
        path: A capture of the calibration frame.
        calibration_frame: Document of the calibration frame.
        options: As the API takes them; those missing or None default as in `CalibrateSettings`.
        rig: The nominal rig; None for the one in the capture's own configuration.
        by_hand: Identifications made by hand.

    Raises:
        InputError: Calibration frame, options or rig are invalid.
        CaptureFileError: The capture cannot be read.
        MeasurementError: The capture determines no calibration; the message says why.
    """
    model = calibration_frame_model(calibration_frame)
    with CaptureReader(path) as reader:
        rig = rig or recorded_rig(reader)
        settings = _settings(options, reader.meta.config)
        fields = counted(reader.received(), reader.field_count, portion(progress, 0.0, _LOCATED))
        result = calibrate(fields, nominal_rig(rig), model, settings, by_hand)
        about = _about(reader, calibration_frame, options, rig)
    report = report_document(result, about)
    return CalibrationOutput(_document(result, about, report), report)


def nominal_rig(rig: RigConfig) -> NominalRig:
    """Converts a configured rig to the type that the core takes."""
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


def recorded_rig(reader: CaptureReader) -> RigConfig:
    """Reads the nominal rig from a capture's own configuration.

    Raises:
        InputError: The configuration has none.
    """
    try:
        return RigConfig.model_validate(reader.meta.config.get("rig", {}))
    except ValidationError as error:
        raise InputError(
            f"the capture's own configuration has no usable rig: {error.errors()[0]['msg']}",
            "name a configuration with the rig's nominal geometry",
        ) from error


def _settings(options: Mapping[str, Any], config: Mapping[str, Any]) -> CalibrateSettings:
    """Combines the API's options with the location settings of the capture's configuration.

    Raises:
        InputError: An option has an unknown value.
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
    """Names the lens terms that both views share: all, none, or those given."""
    if isinstance(given, bool):
        return LENS if given else ()
    return tuple(given)


def _check_choice(given: Mapping[str, Any], key: str, known: Sequence[str]) -> None:
    if key in given and given[key] not in known:
        raise InputError(f"{key} {given[key]!r} is not one of {', '.join(known)}", "choose one of them")


def _about(
    reader: CaptureReader, calibration_frame: Mapping[str, Any], options: Mapping[str, Any], rig: RigConfig
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
        **{key: calibration_frame.get(key) for key in CALIBRATION_FRAME_KEYS},
    }


def _id(capture: str, created_utc: str) -> str:
    """Makes an id that no other calibration has, from the capture's id and the time."""
    moment = datetime.fromisoformat(created_utc).strftime("%Y%m%dT%H%M%S")
    # 50 and the 16 of the time stay below the 80 characters that a calibration's id may have.
    return f"{re.sub('[^0-9A-Za-z_-]+', '-', capture)[:50]}-{moment}"


def _document(result: CalibrateResult, about: Mapping[str, Any], report: Mapping[str, Any]) -> dict[str, Any]:
    """Builds the calibration; of its report it holds what a later reader of this file alone would ask for."""
    frame = result.frame
    details = {
        "capture": about["capture"],
        "calibration_frame": {"name": frame.name, "targets": len(frame), "sigma_mm": frame.sigma_mm},
        **{key: about[key] for key in CALIBRATION_FRAME_KEYS},
        "note": about["note"],
        "version": about["version"],
        "sigma0": result.adjustment.sigma0,
        **{key: report[key] for key in ("settings", "tests", "dropped", "warnings")},
    }
    source = f"capture {about['capture']['id']} of calibration frame {frame.name}"
    calibration = result.calibration(about["id"], about["created_utc"], source, about["glass"], details)
    return calibration.to_document()
