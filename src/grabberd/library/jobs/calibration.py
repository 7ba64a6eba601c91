"""Calibration of both virtual cameras from a capture of the calibration frame, and the report on it."""

import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from itertools import chain
from pathlib import Path

import numpy as np
from pydantic import ValidationError

from grabberd import __version__
from grabberd.archive.calibrations.calibration_catalog import CALIBRATION_FRAME_KEYS, calibration_frame_model
from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.measure_setups import location_settings, misfit, nominal_rig, settings_of_capture
from grabberd.bounded_documents import as_written
from grabberd.config import RigConfig
from grabberd.core.calibration.adjustment.network import LENS
from grabberd.core.calibration.identification.frame_identification import IdentificationSettings
from grabberd.core.calibration.identification.manual_identification import Mark
from grabberd.core.calibration.significance import CheckLength
from grabberd.core.chain.calibration.acceptance.verdict import AcceptanceInputs, judge
from grabberd.core.chain.calibration.calibrate import calibrate
from grabberd.core.chain.calibration.calibration_result import CalibrateResult, CalibrateSettings
from grabberd.core.chain.calibration.report_document import report_document
from grabberd.core.chain.locating import px_per_mm
from grabberd.core.field import NumberedField
from grabberd.core.geometry import PARAMETERS, Calibration, NominalRig
from grabberd.core.measurement import LocationSettings
from grabberd.core.measurement.marks import KEY as MARKS
from grabberd.core.reconstruction import ObjectModel
from grabberd.documents.calibration_reports import CalibrationReport
from grabberd.documents.document import JsonObject
from grabberd.documents.requests import CalibrationOptions, CaptureMark, CertifiedLength, TargetMark
from grabberd.errors import InputError, said
from grabberd.runtime import SystemClock, iso_utc
from grabberd.work.job_spec import Progress, counted, portion

_LOCATED = 0.8
"""Share of the work that location is; the adjustment cannot tell how far it is."""


@dataclass(frozen=True, slots=True)
class CalibrationOutput:
    """A calibration, and the report of how it was made."""

    calibration: Calibration
    report: CalibrationReport


def calibrate_files(
    progress: Progress,
    *,
    paths: Sequence[Path],
    calibration_frame: JsonObject,
    options: CalibrationOptions,
    note: str | None = None,
    previous: JsonObject | None = None,
    rig: RigConfig | None = None,
    by_hand: Sequence[Sequence[Mark]] = (),
) -> CalibrationOutput:
    """Calibrates from sealed captures; nothing is written.

    Args:
        progress: Called with the share that is done.
        paths: Captures of the calibration frame, one for each of its poses before the same rig.
        calibration_frame: Document of the calibration frame.
        options: Options of the adjustment; those that are None default as in `CalibrateSettings`.
        note: Free text, kept with the calibration.
        previous: Document of the calibration to compare with.
        rig: The nominal rig; None for the one in the capture's own configuration.
        by_hand: Targets that are marked by hand in each capture, in order, besides those of the options.

    Raises:
        InputError: Calibration frame, options or rig are invalid.
        CaptureFileError: The capture cannot be read.
        MeasurementError: The capture determines no calibration; the message says why.
    """
    model = _without(calibration_frame_model(calibration_frame), options.dropped or ())
    marks = list(_marks(options.marks or (), by_hand, paths))
    with CaptureReader(paths[0]) as reader:
        reader.check_unchanged(runs=())
        rig = rig or recorded_rig(reader)
        nominal = nominal_rig(rig)
        settings = _settings(options, recorded_location(reader, nominal))
        share = _LOCATED / len(paths)
        fields = counted(reader.received(), reader.field_count, portion(progress, 0.0, share))
        further = _Further(paths[1:], reader, progress, share)
        known = AcceptanceInputs(
            None if previous is None else Calibration.from_document(previous),
            _check_length(options, calibration_frame, model),
        )
        poses = (_of_rig(one, rig) for one in chain([fields], further))
        result = calibrate(poses, nominal, model, settings, marks)
        about = {
            **_about(reader, calibration_frame, note, rig),
            "other_captures": further.ids,
            "dropped": sorted(options.dropped or ()),
        }
    report = CalibrationReport.model_validate(report_document(result, about, judge(result, known)))
    return CalibrationOutput(_calibration(result, about, report), report)


def _without(model: ObjectModel, dropped: Sequence[int]) -> ObjectModel:
    """The calibration frame without some of its targets.

    Raises:
        InputError: It does not have one of them.
    """
    if unknown := [one for one in dropped if one not in model.target]:
        raise InputError(
            f"calibration frame {model.name} has no target {', '.join(map(str, unknown))} to leave out",
            "name targets by their ids in the calibration frame's file",
        )
    left = model.select(np.flatnonzero(~np.isin(model.target, dropped)))
    if len(left) < (least := IdentificationSettings().least_targets):
        raise InputError(
            f"calibration frame {model.name} has {len(left)} targets without those to leave out; {least} "
            "are needed",
            "leave out fewer",
        )
    return left


def as_mark(one: TargetMark) -> Mark:
    """A mark as the calibration takes it."""
    return Mark(one.view, one.target, one.x_px, one.y_px)


def _marks(
    given: Sequence[CaptureMark], by_hand: Sequence[Sequence[Mark]], paths: Sequence[Path]
) -> Iterator[list[Mark]]:
    """Yield the marks of each capture, in order.

    Raises:
        InputError: One is of another capture, or a capture has no list.
    """
    if by_hand and len(by_hand) != len(paths):
        raise InputError(
            f"there are marks of {len(by_hand)} captures, and {len(paths)} to calibrate from",
            "give the marks of each capture in the order of the captures; a list of none has a header alone",
        )
    ids = [_capture_id(path) for path in paths] if given else [""] * len(paths)
    if unknown := {one.capture for one in given if one.capture} - set(ids):
        raise InputError(
            f"targets are marked in capture {', '.join(sorted(unknown))}, which takes no part",
            "mark targets of the captures that are named",
        )
    for number, capture in enumerate(ids):
        own = [as_mark(one) for one in given if (one.capture or ids[0]) == capture]
        yield [*own, *(by_hand[number] if by_hand else ())]


def _capture_id(path: Path) -> str:
    with CaptureReader(path) as reader:
        return reader.meta.id


def _of_rig(fields: Iterable[NumberedField], rig: RigConfig) -> Iterator[NumberedField]:
    """The fields, each of which has the rig's size.

    Raises:
        InputError: One has another.
    """
    for numbered in fields:
        packed = numbered.packed
        if (packed.columns, packed.frame_lines) != (rig.columns, rig.lines):
            raise misfit(rig, packed.columns, packed.frame_lines)
        yield numbered


class _Further:
    """Fields of captures after the first, one capture after the other; `ids` are of those read so far."""

    def __init__(self, paths: Sequence[Path], first: CaptureReader, progress: Progress, share: float) -> None:
        self.ids: list[str] = []
        self._paths, self._first, self._progress, self._share = paths, first, progress, share

    def __iter__(self) -> Iterator[Iterator[NumberedField]]:
        for number, path in enumerate(self._paths, start=1):
            with CaptureReader(path) as reader:
                reader.check_unchanged(runs=())
                self._check_same_rig(reader)
                self.ids.append(reader.meta.id)
                part = portion(self._progress, number * self._share, (number + 1) * self._share)
                yield counted(reader.received(), reader.field_count, part)

    def _check_same_rig(self, reader: CaptureReader) -> None:
        """Check that a capture is of another pose before the same rig.

        Raises:
            InputError: It is the first one again, or its rig or its way to make fields is another.
        """
        first, meta = self._first.meta, reader.meta
        if meta.id in {first.id, *self.ids}:
            raise InputError(f"capture {meta.id} is named twice", "name each pose's capture once")
        mine = (first.config.get("rig"), first.bits, first.lines)
        if mine != (meta.config.get("rig"), meta.bits, meta.lines):
            raise InputError(
                f"capture {meta.id} has another rig, bits or lines than capture {first.id}",
                "take all poses of the calibration frame with one configuration",
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
            f"the capture's own configuration has no usable rig: {said(error.errors()[0]['msg'])}",
            "name a configuration with the rig's nominal geometry",
        ) from error


def recorded_location(reader: CaptureReader, nominal: NominalRig) -> LocationSettings:
    """Settings of target location from a capture's own configuration."""
    return location_settings(settings_of_capture(reader.meta.config), px_per_mm(nominal))


def _settings(options: CalibrationOptions, location: LocationSettings) -> CalibrateSettings:
    """Combines the options with the settings for locating blobs."""
    default = CalibrateSettings()
    return CalibrateSettings(
        equal_weights=options.weights == "equal",
        held=options.frame == "held",
        free=PARAMETERS if options.free is None else tuple(options.free),
        shared=_shared(options.shared or False),
        tied=default.tied if options.tied is None else options.tied,
        alpha=default.alpha if options.alpha is None else options.alpha,
        local_field=default.local_field if options.local_field is None else options.local_field,
        handedness=options.handedness,
        turn_deg=options.turn_deg,
        location=location,
    )


_WRITE_LENGTH = "write check_length: {between: [1, 108], length_mm: …, sigma_mm: …}"


def _check_length(
    options: CalibrationOptions, calibration_frame: JsonObject, model: ObjectModel
) -> CheckLength | None:
    """Reads the check length from the options or, by default, from the calibration frame's document.

    Raises:
        InputError: It is invalid, or is between targets that the frame does not have.
    """
    try:
        given = options.check_length or (
            as_written(document, CertifiedLength.model_validate)
            if (document := calibration_frame.get("check_length")) is not None
            else None
        )
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(map(str, ("check_length", *first["loc"])))
        given_as = "" if isinstance(first["input"], dict) else f", not {first['input']!r}"
        raise InputError(
            f"the calibration frame's {where}: {said(first['msg'])}{given_as}", _WRITE_LENGTH
        ) from error
    except ValueError as error:
        raise InputError(f"the calibration frame's check_length: {error}", _WRITE_LENGTH) from error
    if given is None:
        return None
    first_id, second_id = given.between
    unknown = [one for one in given.between if one not in model.target]
    if unknown or first_id == second_id:
        raise InputError(
            f"the check length is between targets {first_id} and {second_id}, which must be two of "
            f"calibration frame {model.name}",
            "name two targets by their ids in the calibration frame's file",
        )
    return CheckLength(first_id, second_id, given.length_mm, given.sigma_mm)


def _shared(given: bool | Sequence[str]) -> tuple[str, ...]:
    """Names the lens terms that both views share: all, none, or those given."""
    if isinstance(given, bool):
        return LENS if given else ()
    return tuple(given)


def _about(
    reader: CaptureReader, calibration_frame: JsonObject, note: str | None, rig: RigConfig
) -> JsonObject:
    created, meta = iso_utc(SystemClock().utc_now()), reader.meta
    return {
        "id": _id(meta.id, created),
        "created_utc": created,
        "version": f"grabberd {__version__}",
        "note": note,
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


def _volume(report: CalibrationReport) -> JsonObject | None:
    """The volume of the calibration frame's targets, and the pointing σ of one field there."""
    if report.validity is None:
        return None
    return report.validity.model_dump(mode="json", include={"volume_mm", "pointing_px"})


def _calibration(result: CalibrateResult, about: JsonObject, report: CalibrationReport) -> Calibration:
    """Builds the calibration; of its report it holds what a later reader of this file alone would ask for."""
    frame = result.frame
    details = {
        "capture": about["capture"],
        "calibration_frame": {
            "name": frame.name,
            "targets": len(frame),
            "sigma_mm": frame.sigma_mm,
            "turn_deg": result.identification.orientation.turn_deg,
            "dropped": about["dropped"],
        },
        **{key: about[key] for key in CALIBRATION_FRAME_KEYS},
        "note": about["note"],
        "version": about["version"],
        "sigma0": result.adjustment.sigma0,
        "volume": _volume(report),
        **report.model_dump(mode="json", include={"settings", "tests", "dropped"}),
        **({"poses": report.model_dump(mode="json")["result"]["poses"]} if report.result.poses else {}),
        **({MARKS: result.marks.to_document()} if result.marks else {}),
        "acceptance": report.acceptance.model_dump(mode="json", include={"verdict", "reasons"}),
    }
    source = f"capture {about['capture']['id']} of calibration frame {frame.name}"
    return result.calibration(about["id"], about["created_utc"], source, about["glass"], details)
